"""Random numbers of a component, declared without CasADi."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from .declaration import Component, Dimension
from .parts import DeclarationError, check_parts


@dataclass(frozen=True, slots=True)
class Draw:
    """Random numbers that are drawn anew on every occasion of one kind.

    Attributes
    ----------
    name, size
        Attribute of ``w``, and its number of elements (a column).
    each
        A constant of the build: ``size`` numbers (and scales) are drawn for each of that many;
        None: once.
    kind
        ``normal``: mean 0, variance 1. ``uniform``: an integer below 2**53, as a float; compare it
        with ``probability * 2**53`` or scale it by ``2**-53``.
    occasion
        ``initial``, ``tick``, or the name of a loop.
    scale
        Scalar parameters, one per number. If the parameter is 0, its number has no effect: it is 0
        and is not drawn. Empty: always drawn.
    """

    name: str
    kind: Literal["normal", "uniform"]
    occasion: str
    size: int = 1
    scale: tuple[str, ...] = ()
    each: Dimension | None = None

    def __post_init__(self) -> None:
        check_parts(self)
        if self.scale and len(self.scale) != self.size:
            raise DeclarationError(
                f"{self.name}: must have {self.size} scales, got {len(self.scale)}"
            )

    def of(self, component: Component) -> Draw:
        """The draw with all its numbers, for the constants of a component."""
        if self.each is None:
            return self
        times = component.constants[self.each.name]
        return replace(self, size=times * self.size, scale=times * self.scale, each=None)

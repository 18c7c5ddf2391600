"""Declaration of a receiver; each is a module of ``receivers``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from ..declaration import Component
from ..parts import DeclarationError, check_parts

if TYPE_CHECKING:
    from ..equations import Equations

Beacons = Literal["platform", "buoys", "survey"]
"""Nature of the errors of the beacons' positions: shared, from one platform's GPS and IMU; from a
GPS on each buoy; or from a survey of each beacon."""


@dataclass(frozen=True)
class ReceiverDeclaration:
    """A receiver: its variables, its equations, its purpose and its limits.

    Attributes
    ----------
    component
        Declaration of its variables.
    purpose
        Its purpose, in a few words.
    unfit
        Kinds of beacons it is unfit for: what goes wrong there, and what to do.
    equations
        Makes its equations; None: they are the ``EQUATIONS`` of the module with its name in the
        receivers' folder.
    place
        Its place in lists, if not given by its number.
    """

    component: Component
    purpose: str = ""
    unfit: Mapping[Beacons, str] = field(default_factory=dict)
    equations: Callable[[], Equations] | None = None
    place: int | None = None

    def __post_init__(self) -> None:
        check_parts(self)
        if self.unfit and not self.purpose:
            raise DeclarationError(
                f"{self.component.name}: must have a purpose, as there are beacons it is unfit for"
            )


def in_order(receivers: Mapping[str, ReceiverDeclaration]) -> Mapping[str, ReceiverDeclaration]:
    """Receivers in the order of lists."""

    def place(item: tuple[str, ReceiverDeclaration]) -> tuple[int, int]:
        number, place = item[1].component.number, item[1].place
        return (number if place is None else place, number)

    return dict(sorted(receivers.items(), key=place))

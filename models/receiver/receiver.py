"""What a receiver declares of itself; each is a module of ``receivers``, found there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from ..declaration import Component

if TYPE_CHECKING:
    from ..equations import Equations

Beacons = Literal["platform", "buoys", "survey"]
"""What the errors of the beacons' places are: those of one platform's GPS and IMU, which all share;
those of a GPS on each buoy; or those of a survey of each."""


@dataclass(frozen=True)
class ReceiverDeclaration:
    """A receiver: its variables, its equations, what it is for and what it cannot bear.

    Attributes
    ----------
    component
        Its variables.
    purpose
        What it is for, in a few words.
    unfit
        Beacons that it is not for: what is the matter there, and what to do.
    equations
        Makes its equations; None: they are the ``EQUATIONS`` of the module of the receivers' folder
        that has its name.
    place
        Where it stands in lists, if not by its number.
    """

    component: Component
    purpose: str = ""
    unfit: Mapping[Beacons, str] = field(default_factory=dict)
    equations: Callable[[], Equations] | None = None
    place: int | None = None

    def __post_init__(self) -> None:
        if self.unfit and not self.purpose:
            raise ValueError(
                f"{self.component.name}: must have a purpose, as there is something it is not for"
            )


def in_order(receivers: Mapping[str, ReceiverDeclaration]) -> Mapping[str, ReceiverDeclaration]:
    """Receivers in the order of lists."""

    def place(item: tuple[str, ReceiverDeclaration]) -> tuple[int, int]:
        number, place = item[1].component.number, item[1].place
        return (number if place is None else place, number)

    return dict(sorted(receivers.items(), key=place))

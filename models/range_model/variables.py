"""Declaration of the range model: distances and their derivatives, for use in other filters."""

from __future__ import annotations

from ..arrangement import usual
from ..declaration import Component, input_, output
from ..ports import BEACONS

COMPONENT = Component(
    name="RangeModel",
    number=7,
    description="Ranges from beacons to a receiver, with directional derivatives",
    interval=None,
    variables=(
        input_("position", "Position of the receiver, NED", "m", shape=(3,),
               start=(10.0, 0.0, 5.0)),
        input_("beacon_position", "Positions of the beacons, NED", "m", shape=(BEACONS, 3),
               start=usual),
        output("range", "Distance from each beacon to the receiver", "m", shape=(BEACONS,)),
    ),
    step_size=0.1,
    stop_time=1.0,
)

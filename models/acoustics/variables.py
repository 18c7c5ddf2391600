"""Declaration of the Acoustics: a one-way channel from the beacons to the diver."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, product

from ..declaration import (
    Component,
    Condition,
    choice,
    is_one_of,
    noise_keys,
    not_zero,
    output,
    parameter,
    switch,
    tick_interval,
)
from ..numbered import alternatives
from ..ports import (
    BEACON_POSITIONS,
    BEACONS,
    BROADCAST,
    MOTION,
    PING_POSE,
    RECEPTION,
    REPORTED_POSE,
    ports,
    terminal,
)
from .contents import CONTENTS, PACKET_CONTENT, POSED
from .range_errors import FOUND
from .schedules import ORDERED, SCHEDULE, SCHEDULES

_CLOCK = ("clock_offset_std", "clock_drift_std")


def _random() -> Iterator[tuple[Condition, ...]]:
    """Requirements for anything to be random; in each group, at least one condition must hold."""
    for first, *rest in product(*(it.random for it in FOUND.values() if it.random)):
        yield not_zero(*first, "loss_probability", *_CLOCK, *chain(*rest))


def _in_turn(shape: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(range(1, shape[0] + 1))


COMPONENT = Component(
    name="Acoustics",
    number=3,
    description="One-way ranging, one beacon per slot or all at once, with noise, loss, outliers "
    "and clock errors",
    interval="sampling_time",
    variables=(
        tick_interval("sampling_time", "Time between pings: the slot of the round robin"),
        *noise_keys(*_random()),
        choice("schedule", f"Whether {alternatives(it.words for it in SCHEDULES.values())}",
               SCHEDULE, 1),
        parameter("slot_order", "Beacon that pings in each slot of a round", shape=(BEACONS,),
                  type="Int32", start=_in_turn, min=1, max=BEACONS.most,
                  needs=((is_one_of("schedule", SCHEDULE, *ORDERED),),)),
        parameter("sound_speed", "True speed of sound", "m/s", start=1500.0, min=1.0, max=10000.0),
        parameter("assumed_sound_speed", "Speed of sound that the receiver uses to form ranges",
                  "m/s", start=1500.0, min=1.0, max=10000.0),
        switch("motion_during_travel", "Whether the diver moves while the sound travels", True),
        *FOUND["noise"].parameters,
        parameter("loss_probability", "Probability that a packet is lost", start=0.0, min=0.0,
                  max=1.0),
        *FOUND["outliers"].parameters,
        parameter("clock_offset", "Receiver's clock minus the beacons' clock at the start", "s"),
        parameter("clock_offset_std", "Standard deviation of the offset that each run adds to it",
                  "s", min=0.0),
        parameter("clock_drift", "Drift of the receiver's clock", "s/s", min=-0.1, max=0.1),
        parameter("clock_drift_std", "Standard deviation of the drift that each run adds", "s/s",
                  min=0.0),
        parameter("clock_sync_age", "Time between the last synchronisation of the clocks and "
                  "the start; they drift during it", "s", min=0.0,
                  needs=(not_zero("clock_drift", "clock_drift_std"),)),
        parameter("processing_delay", "Time the receiver takes before it stamps an arrival", "s",
                  min=0.0, max=1.0),
        parameter("processing_delay_correction", "Delay that the receiver subtracts", "s",
                  min=0.0, max=1.0),
        choice("packet_content", "What a packet says about the platform: "
               + alternatives(it.words for it in CONTENTS.values()), PACKET_CONTENT, 1),
        parameter("packet_resolution", "Positions in a packet are multiples of this; 0: not "
                  "rounded", "m", min=0.0, max=1000.0),
        parameter("packet_angle_resolution", "Angles in a packet are multiples of this; 0: not "
                  "rounded", "rad", min=0.0, max=1.0,
                  needs=((is_one_of("packet_content", PACKET_CONTENT, *POSED),),)),
        *(v for name, it in FOUND.items() if name not in ("noise", "outliers")
          for v in it.parameters),
        *ports(MOTION, "input", "target_"),
        *ports(BEACON_POSITIONS, "input"),
        *ports(REPORTED_POSE, "input"),
        *ports(RECEPTION, "output"),
        output("true_range", "Length of the sound's path for each range", "m", shape=(BEACONS,),
               variability="discrete"),
        *ports(PING_POSE, "output"),
    ),
    terminals=(
        *BROADCAST,
        terminal("reception", "reception", "Newest reception from each beacon", RECEPTION),
        terminal("pose", "pose", "The platform's pose in the packets of those receptions",
                 PING_POSE),
    ),
)

"""Declaration of the Acoustics: the channel between beacons and diver."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, product
from math import pi

from ..declaration import (
    Component,
    Condition,
    Variable,
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
from .ranging import INVERTED, RANGING, RANGINGS
from .schedules import ORDERED, SCHEDULE, SCHEDULES

_CLOCK = ("clock_offset_std", "clock_drift_std")
_TURNAROUND = ("turnaround_std", "turnaround_bias_std", "turnaround_beacon_std")
_LOSSES = ("loss_probability", "shadow_loss_probability")
_ANSWERED = tuple(name for name, it in RANGINGS.items() if it.legs > 1)
_CLOCKED = (is_one_of("ranging", RANGING, *(name for name in RANGINGS if name not in _ANSWERED)),)
_TWO_WAY = (is_one_of("ranging", RANGING, *_ANSWERED),)
_INVERTED = (is_one_of("ranging", RANGING, *INVERTED),)
_SYNCHRONISED = (
    *not_zero("common_clock"),
    is_one_of("ranging", RANGING, *(name for name in RANGINGS if name not in INVERTED)),
)
_IN_TURN = (is_one_of("ranging", RANGING, *(name for name in RANGINGS if name not in INVERTED)),)


def _random() -> Iterator[tuple[Condition, ...]]:
    """Requirements for anything to be random; in each group, at least one condition must hold."""
    clock = (not_zero(*_CLOCK), _CLOCKED, _SYNCHRONISED)
    turnaround = (not_zero(*_TURNAROUND), _TWO_WAY)
    common = (not_zero("range_common_std"), _INVERTED, _SYNCHRONISED)
    for first, *rest in product(*(it.random for it in FOUND.values() if it.random)):
        for one, other, third in product(clock, turnaround, common):
            if (one, other) != (_CLOCKED, _TWO_WAY):  # one of these always holds
                yield (
                    *not_zero(*first, *_LOSSES), *one, *other, *third, *not_zero(*chain(*rest))
                )


PROFILE = 8
"""Largest number of points of a profile of the speed of sound."""
CHANNEL = (
    parameter("loss_burst_length", "Mean number of packets of a beacon that are lost in a row; "
              "0: each is lost independently of the others", min=0.0, max=1e6,
              needs=(not_zero("loss_probability"),)),
    parameter("water_depth", "Depth of the bottom below the mean surface; 0: no bottom", "m",
              min=0.0, max=12000.0,
              needs=(not_zero(*_LOSSES), not_zero("bottom_echo_probability"))),
    parameter("surface_echo_probability", "Probability that the echo from the surface arrives "
              "where the direct path is lost", min=0.0, max=1.0,
              needs=(not_zero(*_LOSSES),)),
    parameter("bottom_echo_probability", "Probability that the echo from the bottom arrives where "
              "the direct path is lost", min=0.0, max=1.0,
              needs=(not_zero(*_LOSSES), not_zero("water_depth"))),
    Variable("profile_count", "Number of points of the profile of the speed of sound; 0: it is the "
             "same everywhere", "parameter", start=0, min=0, max=PROFILE, type="Int32"),
    parameter("profile_depth", "Depths of the points, increasing", "m", shape=(PROFILE,),
              min=0.0, max=12000.0, needs=(not_zero("profile_count"),)),
    parameter("profile_speed", "True speeds of sound at these depths", "m/s", shape=(PROFILE,),
              start=1500.0, min=1.0, max=10000.0, needs=(not_zero("profile_count"),)),
)
"""Bursts of losses, echoes, and the profile of the speed of sound."""
SHADOW = (
    parameter("shadow_loss_probability", "Probability that the diver's body takes a packet from a "
              "beacon in the middle of its shadow, in addition to other losses; 0: no shadow",
              min=0.0, max=1.0),
    parameter("shadow_half_width", "Angle from the middle of the shadow at which half of this "
              "probability is left", "rad", start=pi / 4, min=0.01, max=pi / 2,
              needs=(not_zero("shadow_loss_probability"),)),
    parameter("shadow_direction", "Middle of the shadow, clockwise from the diver's course: "
              "behind the diver, unless the hydrophone is on the other side of the body", "rad",
              start=pi, min=-2 * pi, max=2 * pi,
              needs=(not_zero("shadow_loss_probability"),)),
)
"""The shadow of the diver's body."""
TURNAROUND = (
    choice("ranging", f"Whether {alternatives(it.words for it in RANGINGS.values())}", RANGING, 1),
    parameter("turnaround", "Time from the end of a request to the start of the answer, as the "
              "diver knows it", "s", min=0.0, max=100.0, needs=(_TWO_WAY,)),
    parameter("turnaround_std", "Standard deviation of each answer's error in it", "s", min=0.0,
              max=1.0, needs=(_TWO_WAY,)),
    parameter("turnaround_bias_std", "Standard deviation of the error in it that all answers of a "
              "run share", "s", min=0.0, max=1.0, needs=(_TWO_WAY,)),
    parameter("turnaround_beacon_std", "Standard deviation of the error in it that all answers of "
              "a beacon share in a run, drawn for each beacon", "s", min=0.0, max=1.0,
              needs=(_TWO_WAY,)),
)
"""The way to range, and the delay of answers."""
ARRIVALS = (
    parameter("range_resolution", "Step of the times of arrival, as a range; 0: they are not "
              "rounded", "m", min=0.0, max=1000.0, needs=(_INVERTED,)),
    parameter("range_common_std", "Standard deviation of the error that all arrivals of a ping "
              "share, besides the noise of each", "m", min=0.0, max=1e6,
              needs=(_INVERTED, _SYNCHRONISED)),
    switch("common_clock", "Whether beacons and diver have a common clock; without one, only the "
           "differences of the arrivals of a ping are known", True, needs=(_INVERTED,)),
    switch("arrivals_shared", "Whether all arrivals of a ping are lost or late together, as at "
           "hydrophones a few centimetres apart", False, needs=(_INVERTED,)),
)
"""How exactly beacons time the diver's ping, and what their arrivals have in common."""


def _in_turn(shape: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(range(1, shape[0] + 1))


COMPONENT = Component(
    name="Acoustics",
    number=3,
    description="Ranging, one-way, two-way or inverted, one beacon per slot or all at once, with "
    "noise, loss, outliers and clock errors",
    interval="sampling_time",
    variables=(
        tick_interval("sampling_time", "Time between pings: the slot of the round robin"),
        *noise_keys(*_random()),
        choice("schedule", f"Whether {alternatives(it.words for it in SCHEDULES.values())}",
               SCHEDULE, 1, needs=(_IN_TURN,)),
        parameter("slot_order", "Beacon that pings in each slot of a round", shape=(BEACONS,),
                  type="Int32", start=_in_turn, min=1, max=BEACONS.most,
                  needs=((is_one_of("schedule", SCHEDULE, *ORDERED),), _IN_TURN)),
        parameter("sound_speed", "True speed of sound", "m/s", start=1500.0, min=1.0, max=10000.0),
        parameter("assumed_sound_speed", "Speed of sound that the receiver uses to form ranges",
                  "m/s", start=1500.0, min=1.0, max=10000.0),
        switch("motion_during_travel", "Whether the diver moves while the sound travels", True),
        *FOUND["noise"].parameters,
        parameter("loss_probability", "Probability that a packet is lost", start=0.0, min=0.0,
                  max=1.0),
        *FOUND["outliers"].parameters,
        parameter("clock_offset", "Receiver's clock minus the beacons' clock at the start", "s",
                  needs=(_CLOCKED, _SYNCHRONISED)),
        parameter("clock_offset_std", "Standard deviation of the offset that each run adds to it",
                  "s", min=0.0, needs=(_CLOCKED, _SYNCHRONISED)),
        parameter("clock_drift", "Drift of the receiver's clock", "s/s", min=-0.1, max=0.1,
                  needs=(_CLOCKED, _SYNCHRONISED)),
        parameter("clock_drift_std", "Standard deviation of the drift that each run adds", "s/s",
                  min=0.0, needs=(_CLOCKED, _SYNCHRONISED)),
        parameter("clock_sync_age", "Time between the last synchronisation of the clocks and "
                  "the start; they drift during it", "s", min=0.0,
                  needs=(not_zero("clock_drift", "clock_drift_std"), _CLOCKED, _SYNCHRONISED)),
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
        *CHANNEL,
        *TURNAROUND,
        *ARRIVALS,
        *SHADOW,
        *ports(MOTION, "input", "target_"),
        *ports(BEACON_POSITIONS, "input"),
        *ports(REPORTED_POSE, "input"),
        *ports(RECEPTION, "output"),
        output("true_range", "Length of the sound's direct path for each range", "m",
               shape=(BEACONS,), variability="discrete"),
        *ports(PING_POSE, "output"),
    ),
    terminals=(
        *BROADCAST,
        terminal("reception", "reception", "Newest reception from each beacon", RECEPTION),
        terminal("pose", "pose", "The platform's pose in the packets of those receptions",
                 PING_POSE),
    ),
)

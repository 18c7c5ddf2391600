"""Declaration of the Target: the diver's motion and the tablet's depth sensor."""

from __future__ import annotations

from math import pi

from ..declaration import (
    Component,
    Condition,
    Dimension,
    Variable,
    choice,
    is_one_of,
    noise_keys,
    not_zero,
    output,
    parameter,
    tick_interval,
)
from ..ports import DEPTH, MOTION, ports, terminal

WAYPOINTS = 64
TRACK_POINTS = Dimension(16, "track_points", 2, 4096)
"""Most points of a recorded track."""

TRAJECTORIES = {
    1: "straight_line",
    2: "semicircle",
    3: "circle",
    4: "square",
    5: "spiral",
    6: "random_path",
    7: "waypoints",
    8: "white_noise_acceleration",
    9: "file",
}

_HORIZONTAL = ("straight_line", "semicircle", "circle", "square", "spiral", "random_path")


def _on(*trajectories: str) -> tuple[Condition, ...]:
    """The condition that the trajectory is one of these."""
    return (is_one_of("trajectory", TRAJECTORIES, *trajectories),)


_MOVING = not_zero("speed")
_PATHS = _on(*_HORIZONTAL, "waypoints")
_TRACK = _on("file")
_STOCHASTIC = "white_noise_acceleration"
_RANDOM = (
    (*not_zero("depth_std", "depth_bias_std"), *_on("random_path", _STOCHASTIC)),
    (
        *not_zero("depth_std", "depth_bias_std", "acceleration_psd", "initial_position_std",
                  "initial_velocity_std"),
        *_on("random_path"),
    ),
)

COMPONENT = Component(
    name="Target",
    number=1,
    description="A diver who moves along a path and carries a depth sensor",
    interval="sampling_time",
    variant="trajectory",
    variables=(
        choice("trajectory", "Path of the diver", TRAJECTORIES, 2),
        tick_interval("sampling_time", "Time between readings of the depth sensor"),
        *noise_keys(*_RANDOM),
        parameter("speed", "Speed along the path, in space", "m/s", start=0.5, min=0.0, max=20.0,
                  needs=(_PATHS,)),
        parameter("departure_time", "Time after the start at which the motion begins", "s",
                  start=0.0, min=0.0, max=1e9,
                  needs=((*_PATHS, *_TRACK), (*_MOVING, *_TRACK))),
        parameter("center", "Centre of the semicircle, circle, square, spiral or box; first point "
                  "of the straight line; north and east", "m", shape=(2,),
                  needs=(_on(*_HORIZONTAL),)),
        parameter("heading", "Direction of the straight line; bearing from the centre to the first "
                  "point of semicircle, circle and spiral; direction of the square's first side",
                  "rad", start=0.0, min=-2 * pi, max=2 * pi,
                  needs=(_on("straight_line", "semicircle", "circle", "square", "spiral"),)),
        parameter("depth_start", "Depth at the beginning of the path", "m", start=5.0, min=0.0,
                  max=11000.0, needs=(_on(*_HORIZONTAL),)),
        parameter("depth_end", "Depth at the end of the path; in between it changes in proportion "
                  "to the distance gone", "m", start=5.0, min=0.0, max=11000.0,
                  needs=(_on(*_HORIZONTAL), _MOVING)),
        parameter("radius", "Radius of semicircle and circle", "m", start=15.0, min=0.01, max=1e5,
                  needs=(_on("semicircle", "circle"),)),
        parameter("turns", "Number of turns of circle and spiral", start=2.0, min=0.01, max=1000.0,
                  needs=(_on("circle", "spiral"), _MOVING)),
        parameter("side", "Side of the square", "m", start=15.0, min=0.01, max=1e5,
                  needs=(_on("square"),)),
        parameter("spiral_radius", "Distance from the centre at the beginning and at the end of "
                  "the spiral", "m", shape=(2,), start=(2.5, 25.0), min=0.0, max=1e5,
                  needs=(_on("spiral"),)),
        parameter("path_length", "Length of straight line and random path, in the horizontal",
                  "m", start=150.0, min=0.0, max=1e6,
                  needs=(_on("straight_line", "random_path"), _MOVING)),
        parameter("leg_length", "Mean length of a leg of the random path (exponential)", "m",
                  start=8.0, min=0.01, max=1e5, needs=(_on("random_path"), _MOVING)),
        parameter("box", "Half the width of the box that holds the random path, north and east",
                  "m", shape=(2,), start=25.0, min=0.1, max=1e5, needs=(_on("random_path"),)),
        Variable("waypoint_count", "Number of waypoints in use", "parameter", start=2, min=2,
                 max=WAYPOINTS, type="Int32", needs=(_on("waypoints"), _MOVING)),
        parameter("waypoint", "Waypoints, NED", "m", shape=(WAYPOINTS, 3), min=-1e5, max=1e5,
                  needs=(_on("waypoints"),)),
        Variable("track_count", "Number of points of the track in use", "parameter", start=2, min=2,
                 max=TRACK_POINTS, type="Int32", needs=(_TRACK,)),
        parameter("track_time", "When the diver is at the points of the track, from the departure; "
                  "each later than the one before", "s", shape=(TRACK_POINTS,), min=0.0, max=1e9,
                  needs=(_TRACK,)),
        parameter("track", "Points of the track, NED; the diver rests before the first one and "
                  "after the last one", "m", shape=(TRACK_POINTS, 3), min=-1e5, max=1e5,
                  needs=(_TRACK,)),
        parameter("initial_position", "Mean of the first position of the white-noise-acceleration "
                  "motion, NED", "m", shape=(3,), start=(15.0, 0.0, 5.0),
                  needs=(_on(_STOCHASTIC),)),
        parameter("initial_position_std", "Standard deviation of that position, per axis", "m",
                  start=0.0, min=0.0, needs=(_on(_STOCHASTIC),)),
        parameter("initial_velocity", "Mean of the first velocity of that motion, NED", "m/s",
                  shape=(3,), needs=(_on(_STOCHASTIC),)),
        parameter("initial_velocity_std", "Standard deviation of that velocity, per axis", "m/s",
                  start=0.0, min=0.0, needs=(_on(_STOCHASTIC),)),
        parameter("acceleration_psd", "Power spectral density q of the white acceleration, per "
                  "axis", "m2/s3", start=0.01, min=0.0, needs=(_on(_STOCHASTIC),)),
        parameter("depth_std", "Standard deviation of the depth sensor's white noise", "m",
                  start=0.1, min=0.0),
        parameter("depth_bias", "Constant error of the depth sensor, the same in every run", "m"),
        parameter("depth_bias_std", "Standard deviation of what a run adds to that error", "m",
                  min=0.0),
        *ports(MOTION, "output"),
        *ports(DEPTH, "output"),
        output("true_depth", "True depth at the time of the newest reading", "m",
               variability="discrete"),
        output("path_duration", "Time from the start to the end of the path; 0 for a motion "
               "without an end", "s", variability="discrete"),
    ),
    terminals=(terminal("depth_sensor", "depth", "Newest reading of the depth sensor", DEPTH),),
)

"""Declaration of the Platform: beacons on a floating cross or at given points, GPS and IMU."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi

from ..arrangement import ARM, DEPTH, usual
from ..declaration import (
    Component,
    Condition,
    Dimension,
    Needs,
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
from ..ports import BEACON_POSITIONS, BEACONS, BROADCAST, REPORTED_POSE, ports
from .spectrum import DEVELOPED, LEAST_PERIOD

ANGLES = ("roll", "pitch", "yaw")
DIRECTIONS = {"surge": "north", "sway": "east", "heave": "down"}
DISPLACEMENTS = tuple(DIRECTIONS)
MOTION = {0: "sines", 1: "spectrum"}
WAVES = 16
"""Largest number of waves in a spectrum. More would slow down every run, even with sines."""
BOAT_POINTS = Dimension(1, "boat_points", 1, 1024)
"""Largest number of points of a boat's track. With one there is none, and no code for it."""
ARRANGEMENT = {1: "cross", 2: "given"}
_CROSS, _GIVEN = ((is_one_of("arrangement", ARRANGEMENT, name),) for name in ARRANGEMENT.values())

_GPS_AXES = ("horizontal", "vertical")
_IMU_AXES = ("tilt", "heading")


def _any(sensor: str, axes: tuple[str, ...], *parts: str) -> tuple[Condition, ...]:
    """Conditions that a part of a sensor's error is not zero, one for each part."""
    return not_zero(*(f"{sensor}_{axis}_{part}" for part in parts for axis in axes))


_REDRAWN = (*_any("gps", _GPS_AXES, "std", "markov_std"),
            *_any("imu", _IMU_AXES, "std", "markov_std"))
_DRAWN = (*_REDRAWN, *_any("gps", _GPS_AXES, "bias_std"), *_any("imu", _IMU_AXES, "turn_on_std"),
          *not_zero("mounting_std", "misalignment_tilt_std", "misalignment_heading_std"))
_WAVES = not_zero(*(f"{axis}_amplitude" for axis in (*ANGLES, *DISPLACEMENTS)))
_SINES, _SPECTRUM = ((is_one_of("motion", MOTION, name),) for name in MOTION.values())
_SEA = not_zero("wave_height")
_MOORED = not_zero("watch_circle")
_SWINGS = not_zero("yaw_amplitude")
_RANDOM_PHASES = (Condition("random_phases", (1,)),)
_RANDOM = (
    # Sensors, or phases of sines that move something, or a spectrum with waves or a mooring.
    (*_DRAWN, *_RANDOM_PHASES, *_SPECTRUM),
    (*_DRAWN, *_RANDOM_PHASES, *_SEA, *_MOORED),
    (*_DRAWN, *_WAVES, *_SPECTRUM),
    (*_DRAWN, *_WAVES, *_SEA, *_MOORED),
    (*_DRAWN, *_SINES, *_SWINGS, *_SEA, *_MOORED),
)
_SHARED = (Condition("gps_shared", (1,)),)
_ON_TRACK = not_zero("track_count")
_STRAIGHT = (Condition("track_count", (0,)),)
_WARM = not_zero("imu_temperature_offset", "imu_temperature_rate")
_TILTED = ((*not_zero("roll_amplitude", "pitch_amplitude"), *_SPECTRUM), (*_SINES, *_SEA))
_INCLINED = {"tilt": _TILTED, "heading": (_SWINGS,)}


def _motion_name(axis: str) -> str:
    return f"{axis} ({DIRECTIONS[axis]})" if axis in DIRECTIONS else axis


def _waves() -> tuple[Variable, ...]:
    """Amplitude, frequency and phase of each axis in the paper's wave equation (section 4)."""
    variables: list[Variable] = []
    for axis in (*ANGLES, *DISPLACEMENTS):
        # The swing about the mooring is a sine in every sea.
        moves = () if axis == "yaw" else (_SINES,)
        wave = (*moves, not_zero(f"{axis}_amplitude"))
        variables += (
            parameter(f"{axis}_amplitude", f"Amplitude of {_motion_name(axis)}",
                      "rad" if axis in ANGLES else "m", min=0.0,
                      max=pi / 2 if axis in ANGLES else 1000.0, needs=moves),
            parameter(f"{axis}_frequency", f"Frequency of {axis}", "Hz", start=0.25, min=0.0,
                      max=100.0, needs=wave),
            parameter(f"{axis}_phase", f"Phase of {axis} at time 0, if phases are not random",
                      "rad", min=-2 * pi, max=2 * pi,
                      needs=(*wave, (Condition("random_phases", (0,)),))),
        )
    return tuple(variables)


def _sea() -> tuple[Variable, ...]:
    """A sea with a spectrum, the body that floats in it, and its mooring."""
    wavy = (_SPECTRUM, _SEA)
    return (
        parameter("wave_height", "Significant height of the waves", "m", min=0.0, max=30.0,
                  needs=(_SPECTRUM,)),
        parameter("wave_period", "Peak period of the waves", "s", start=DEVELOPED,
                  min=LEAST_PERIOD, max=60.0, named={"developed": DEVELOPED}, needs=wavy),
        parameter("wave_peak_enhancement", "Peak enhancement of the JONSWAP spectrum; 1: that of "
                  "Pierson and Moskowitz", start=1.0, min=1.0, max=7.0, needs=wavy),
        parameter("wave_direction", "Mean direction in which the waves run, clockwise from north",
                  "rad", min=-2 * pi, max=2 * pi, needs=wavy),
        parameter("wave_spreading", "Standard deviation of the waves' directions; 0: "
                  "long-crested", "rad", min=0.0, max=pi, needs=wavy),
        parameter("wave_components", "Number of waves", start=WAVES, min=1, max=WAVES,
                  type="Int32", needs=wavy),
        parameter("raft_size", "Length and width of the body that follows the waves", "m",
                  start=1.6, min=0.1, max=100.0, needs=wavy),
        parameter("raft_draught", "Its depth, at which the waves are weaker than above", "m",
                  start=0.1, min=0.0, max=20.0, needs=wavy),
        parameter("watch_circle", "Radius that a moored platform stays in for 95 % of the time; "
                  "0: it does not drift", "m", min=0.0, max=1000.0, needs=(_SPECTRUM,)),
        parameter("mooring_time", "Time in which the mooring pulls the platform back", "s",
                  start=30.0, min=0.1, max=1e5, needs=(_SPECTRUM, _MOORED)),
    )


def _way() -> tuple[Variable, ...]:
    """The way of a boat: at one speed along one course, or a recorded track."""
    return (
        parameter("boat_speed", "Speed of a boat under way, along its course; 0: the platform "
                  "stays where it is", "m/s", min=0.0, max=20.0, needs=(_STRAIGHT,)),
        parameter("boat_course", "Course of a boat under way, clockwise from north", "rad",
                  min=-2 * pi, max=2 * pi, needs=(_STRAIGHT, not_zero("boat_speed"))),
        Variable("track_count", "Number of points of the boat's track in use; 0: it has none",
                 "parameter", start=0, min=0, max=BOAT_POINTS, type="Int32"),
        parameter("departure_time", "Time after the start at which the boat is at time 0 of its "
                  "track", "s", min=0.0, max=1e9, needs=(_ON_TRACK,)),
        parameter("track_time", "Times of the points of the boat's track from the departure; "
                  "strictly increasing", "s", shape=(BOAT_POINTS,), min=0.0, max=1e9,
                  needs=(_ON_TRACK,)),
        parameter("track", "Points of the boat's track, north and east of its mean position; it "
                  "rests before the first one and after the last one", "m",
                  shape=(BOAT_POINTS, 2), min=-1e5, max=1e5, needs=(_ON_TRACK,)),
        parameter("track_heading", "Yaw at the points of the track, in addition to the mean one; "
                  "not wrapped", "rad", shape=(BOAT_POINTS,), min=-1e4, max=1e4,
                  needs=(_ON_TRACK,)),
    )


def _imu(
    part: str, unit: str | None, description: str, signed: bool,
    needs: Mapping[str, Needs] | None = None,
) -> tuple[Variable, ...]:
    """One part of the IMU error, for tilt (roll and pitch alike) and for heading."""
    return tuple(
        parameter(f"imu_{angle}_{part}", f"{description}, {what}", unit,
                  min=None if signed else 0.0,
                  needs=(_SHARED, *(needs[angle] if needs else ())))
        for angle, what in (("tilt", "of roll and of pitch"), ("heading", "of yaw"))
    )


def _gps(part: str, description: str) -> tuple[Variable, ...]:
    """One part of the GPS error, horizontal (north and east alike) and vertical."""
    return tuple(
        parameter(f"gps_{direction}_{part}", f"{description}, {what}", "m", min=0.0)
        for direction, what in (("horizontal", "of north and of east"), ("vertical", "of down"))
    )


COMPONENT = Component(
    name="Platform",
    number=2,
    description="A moored platform in waves; broadcasts its beacons' positions from GPS and IMU",
    interval="sampling_time",
    variant="motion",
    variables=(
        tick_interval("sampling_time", "Time between draws of the GPS and IMU errors",
                      needs=((*_REDRAWN, *_SPECTRUM), (*_REDRAWN, *_MOORED))),
        *noise_keys(*_RANDOM),
        parameter("mean_position", "Mean position of the reference point, NED; of a boat under "
                  "way at the start; where a boat's track has its origin", "m", shape=(3,)),
        parameter("mean_heading", "Mean yaw", "rad", min=-2 * pi, max=2 * pi),
        choice("arrangement", "Where the beacons are: at the ends of a cross with equal arms, the "
               "first one forward, or at given positions", ARRANGEMENT, 1),
        parameter("arm_length", "Length of each arm of the cross: the paper's baseline", "m",
                  start=ARM, min=0.001, max=1000.0, needs=(_CROSS,)),
        parameter("beacon_depth", "Depth of the beacons below the reference point, body frame",
                  "m", start=DEPTH, min=-100.0, max=100.0, needs=(_CROSS,)),
        parameter("beacon", "Nominal position of each beacon, body frame: forward, right, down",
                  "m", shape=(BEACONS, 3), start=usual, min=-1e4, max=1e4, needs=(_GIVEN,)),
        parameter("beacon_scale", "Factor on all horizontal offsets of the beacons", start=1.0,
                  min=0.001, max=1000.0),
        *_way(),
        choice("motion", "The platform's motion: the paper's sines, or a sea with a spectrum",
               MOTION, 0),
        switch("random_phases", "Whether the phases of all sines are drawn from the seed", True,
               needs=(_WAVES, (*_SINES, *_SWINGS))),
        *_waves(),
        *_sea(),
        parameter("mounting_error", "Installation error of each beacon, body frame; unknown to the "
                  "platform", "m", shape=(BEACONS, 3), needs=(_SHARED,)),
        parameter("mounting_std", "Standard deviation of the error that each run adds to it, per "
                  "beacon and axis: of mounting, or of surveying beacons on the bottom", "m",
                  min=0.0,
                  needs=(_SHARED,)),
        *(parameter(f"misalignment_{angle}_std", "Standard deviation of the rotation of all "
                    f"beacons together {what}, drawn for each run: that of mounting their frame",
                    "rad", min=0.0, max=1.0, needs=(_SHARED,))
          for angle, what in (("tilt", "in roll and in pitch"), ("heading", "in heading"))),
        switch("gps_shared", "Whether one GPS and one IMU place all beacons; if not, each beacon "
               "hangs below a buoy with its own GPS, whose errors are independent", True),
        parameter("gps_antenna_offset", "Position of the GPS antenna relative to the reference "
                  "point, body frame; unknown to the platform", "m", shape=(3,),
                  needs=(_SHARED,)),
        *_gps("std", "GPS: standard deviation of white noise per sample"),
        *_gps("bias_std", "GPS: standard deviation of the constant error of a run"),
        *_gps("markov_std", "GPS: standard deviation of the Gauss-Markov error"),
        parameter("gps_correlation_time", "GPS: correlation time of the Gauss-Markov error", "s",
                  start=100.0, min=0.001, needs=(_any("gps", _GPS_AXES, "markov_std"),)),
        *_imu("std", "rad", "IMU: standard deviation of white noise per sample", False),
        *_imu("bias", "rad", "IMU: fixed error, the same in every run", True),
        *_imu("turn_on_std", "rad", "IMU: standard deviation of the run-to-run error", False),
        *_imu("markov_std", "rad", "IMU: standard deviation of the in-run Gauss-Markov error",
              False),
        parameter("imu_correlation_time", "IMU: correlation time of the Gauss-Markov error", "s",
                  start=100.0, min=0.001, needs=(_SHARED, _any("imu", _IMU_AXES, "markov_std"))),
        *_imu("drift", "rad/s", "IMU: in-run linear drift", True),
        *_imu("temperature_coefficient", "rad/K", "IMU: error per kelvin", True,
              dict.fromkeys(_IMU_AXES, (_WARM,))),
        parameter("imu_temperature_offset", "Temperature at the start minus that of calibration",
                  "K", needs=(_SHARED, _any("imu", _IMU_AXES, "temperature_coefficient"))),
        parameter("imu_temperature_rate", "Rate of change of the temperature", "K/s",
                  needs=(_SHARED, _any("imu", _IMU_AXES, "temperature_coefficient"))),
        *_imu("step", "rad", "IMU: sudden error after a shock", True),
        parameter("imu_step_time", "IMU: time of the shock after the start", "s", min=0.0,
                  needs=(_SHARED, _any("imu", _IMU_AXES, "step"))),
        *_imu("scale_factor_error", None, "IMU: scale factor error", True, _INCLINED),
        parameter("imu_misalignment", "IMU: rotation of the sensor axes about the body axes; "
                  "couples roll, pitch and yaw", "rad", shape=(3,), min=-pi / 4, max=pi / 4,
                  needs=(_SHARED, (*not_zero(*(f"{axis}_amplitude" for axis in ANGLES)),
                                   *_SPECTRUM), (*_SINES, *_SWINGS, *_SEA))),
        output("position", "True position of the reference point, NED", "m", shape=(3,)),
        output("attitude", "True roll, pitch, yaw", "rad", shape=(3,)),
        *ports(BEACON_POSITIONS, "output"),
        *ports(REPORTED_POSE, "output"),
    ),
    terminals=BROADCAST,
)

"""Declaration of the Platform: four beacons on a floating cross, with GPS and IMU."""

from __future__ import annotations

from math import pi

from ..declaration import Component, Variable, noise_keys, output, parameter, switch, tick_interval
from ..ports import BEACON_POSITIONS, BEACONS, ports

ANGLES = ("roll", "pitch", "yaw")
DIRECTIONS = {"surge": "north", "sway": "east", "heave": "down"}
DISPLACEMENTS = tuple(DIRECTIONS)


def _motion_name(axis: str) -> str:
    return f"{axis} ({DIRECTIONS[axis]})" if axis in DIRECTIONS else axis


def _waves() -> tuple[Variable, ...]:
    """Amplitude, frequency and phase of each axis, the paper's wave equation (section 4)."""
    return tuple(
        variable
        for axis in (*ANGLES, *DISPLACEMENTS)
        for variable in (
            parameter(f"{axis}_amplitude", f"Amplitude of {_motion_name(axis)}",
                      "rad" if axis in ANGLES else "m", min=0.0,
                      max=pi / 2 if axis in ANGLES else 1000.0),
            parameter(f"{axis}_frequency", f"Frequency of {axis}", "Hz", start=0.25, min=0.0,
                      max=100.0),
            parameter(f"{axis}_phase", f"Phase of {axis} at time 0, if phases are not random",
                      "rad", min=-2 * pi, max=2 * pi),
        )
    )


def _imu(part: str, unit: str | None, description: str, signed: bool) -> tuple[Variable, ...]:
    """One part of the IMU error, for tilt (roll and pitch each) and for heading."""
    return tuple(
        parameter(f"imu_{angle}_{part}", f"{description}, {what}", unit,
                  min=None if signed else 0.0)
        for angle, what in (("tilt", "of roll and of pitch"), ("heading", "of yaw"))
    )


def _gps(part: str, description: str) -> tuple[Variable, ...]:
    """One part of the GPS error, horizontal (north and east each) and vertical."""
    return tuple(
        parameter(f"gps_{direction}_{part}", f"{description}, {what}", "m", min=0.0)
        for direction, what in (("horizontal", "of north and of east"), ("vertical", "of down"))
    )


COMPONENT = Component(
    name="Platform",
    number=2,
    description="A moored platform in waves; it broadcasts its beacons' positions from GPS and IMU",
    interval="sampling_time",
    variables=(
        tick_interval("sampling_time", "Time between draws of the GPS and IMU errors"),
        *noise_keys(),
        parameter("mean_position", "Mean position of the reference point, NED", "m", shape=(3,)),
        parameter("mean_heading", "Mean yaw", "rad", min=-2 * pi, max=2 * pi),
        parameter("arm_length", "Length of each arm of the cross: the paper's baseline", "m",
                  start=3.0, min=0.001, max=1000.0),
        parameter("beacon_depth", "Depth of the beacons below the reference point, body frame",
                  "m", start=0.5, min=-100.0, max=100.0),
        switch("random_phases", "Whether the phases of all waves are drawn from the seed", True),
        *_waves(),
        parameter("mounting_error", "Installation error of each beacon, body frame; the platform "
                  "does not know it", "m", shape=(BEACONS, 3)),
        parameter("gps_antenna_offset", "Position of the GPS antenna relative to the reference "
                  "point, body frame; the platform does not know it", "m", shape=(3,)),
        *_gps("std", "GPS: standard deviation of white noise per sample"),
        *_gps("bias_std", "GPS: standard deviation of the constant error of a run"),
        *_gps("markov_std", "GPS: standard deviation of the Gauss-Markov error"),
        parameter("gps_correlation_time", "GPS: correlation time of the Gauss-Markov error", "s",
                  start=100.0, min=0.001),
        *_imu("std", "rad", "IMU: standard deviation of white noise per sample", False),
        *_imu("bias", "rad", "IMU: fixed error, the same in every run", True),
        *_imu("turn_on_std", "rad", "IMU: standard deviation of the run-to-run error", False),
        *_imu("markov_std", "rad", "IMU: standard deviation of the in-run Gauss-Markov error",
              False),
        parameter("imu_correlation_time", "IMU: correlation time of the Gauss-Markov error", "s",
                  start=100.0, min=0.001),
        *_imu("drift", "rad/s", "IMU: in-run linear drift", True),
        *_imu("temperature_coefficient", "rad/K", "IMU: error per kelvin", True),
        parameter("imu_temperature_offset", "Temperature at the start minus that of calibration",
                  "K"),
        parameter("imu_temperature_rate", "Rate of change of the temperature", "K/s"),
        *_imu("step", "rad", "IMU: sudden error after a shock", True),
        parameter("imu_step_time", "IMU: time of the shock after the start", "s", min=0.0),
        *_imu("scale_factor_error", None, "IMU: scale factor error", True),
        parameter("imu_misalignment", "IMU: rotation of the sensor axes about the body axes; "
                  "couples roll, pitch and yaw", "rad", shape=(3,), min=-pi / 4, max=pi / 4),
        output("position", "True position of the reference point, NED", "m", shape=(3,)),
        output("attitude", "True roll, pitch, yaw", "rad", shape=(3,)),
        *ports(BEACON_POSITIONS, "output"),
        output("reported_position", "Position of the reference point by GPS, NED", "m", shape=(3,)),
        output("reported_attitude", "Roll, pitch, yaw by IMU", "rad", shape=(3,)),
    ),
)

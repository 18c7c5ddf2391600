"""IMU grades (the paper's Table 1), and the errors of roll, pitch and heading they imply."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians

from ..preset import Preset


@dataclass(frozen=True, slots=True)
class Grade:
    """A row of Table 1, using the lower end of each range.

    Attributes
    ----------
    accelerometer_bias
        In mg, thousandths of standard gravity.
    gyro_bias
        In deg/h.
    """

    accelerometer_bias: float
    gyro_bias: float

    @property
    def tilt_bias(self) -> float:
        """Error of roll and pitch [rad]: accelerometer bias / g (small angles)."""
        return self.accelerometer_bias * 1e-3

    @property
    def heading_drift(self) -> float:
        """Rate of the heading error [rad/s]."""
        return radians(self.gyro_bias) / 3600.0


GRADES: Mapping[str, Grade] = {
    "marine": Grade(0.01, 0.001),
    "aviation": Grade(0.03, 0.01),
    "intermediate": Grade(0.1, 0.1),
    "tactical": Grade(1.0, 1.0),
    "consumer": Grade(3.0, 100.0),
}


def grade(name: str) -> Mapping[str, float]:
    """Parameters of the Platform for an IMU grade, by name, in SI units.

    Raises
    ------
    KeyError
        The name is not a key of `GRADES`.
    """
    chosen = GRADES[name]
    return {"imu_tilt_bias": chosen.tilt_bias, "imu_heading_drift": chosen.heading_drift}


PRESET = Preset(
    "imu_grade", "platform", "Sets the keys of the IMU that are not given: {}", grade, GRADES
)

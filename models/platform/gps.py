"""GPS grades: published accuracies, and the position errors that they imply.

Sources. What they do not state is estimated; the README of this folder marks these estimates.

standalone
    FAA, *GPS SPS Performance Analysis Report* for April to June 2013, as summarised in IFR
    magazine, "GPS/WAAS Scorecard": about 3 m horizontal and 4 m vertical, 95 %.
sbas
    FAA, *WAAS Performance Analysis Report* no. 10 (November 2004), executive summary: the worst
    site has 1.062 m horizontal and 1.790 m vertical, 95 %.
differential, rtk_fixed
    Trimble, *5700 GPS Receiver User Guide*, Table 9.2: L1 C/A code 0.50 m and 0.75 m (one sigma);
    RTK 1 cm + 1 ppm and 2 cm + 2 ppm (RMS). The base is close, so nothing is added per kilometre.
rtk_float
    NovAtel, *OEMV Family Installation and Operation User Manual*, Rev 5B, Table 17: RT-20, which
    does not fix ambiguities, 20 cm RMS, horizontal.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import log, sqrt

from ..preset import Preset

_RADIAL_95 = sqrt(-2.0 * log(0.05))
"""95th percentile of the length of a vector of two unit normals."""
_NORMAL_95 = 1.959964
"""Half the width of the interval that holds 95 % of a unit normal."""
_RADIAL_RMS = sqrt(2.0)
"""RMS length of a vector of two unit normals."""


@dataclass(frozen=True, slots=True)
class Grade:
    """Size of a position error, and how it varies over time.

    Attributes
    ----------
    horizontal, vertical
        Standard deviation of the total error; horizontal: per axis [m].
    white, markov, bias
        Shares of the variance that are white, that vary slowly, and that stay constant over a run.
    correlation_time
        Correlation time of the slowly varying part [s].
    """

    horizontal: float
    vertical: float
    white: float = 0.01
    markov: float = 0.49
    bias: float = 0.5
    correlation_time: float = 100.0

    @property
    def within(self) -> float:
        """Radius that holds 95 % of the horizontal errors [m]."""
        return self.horizontal * _RADIAL_95


GRADES: Mapping[str, Grade] = {
    "standalone": Grade(3.0 / _RADIAL_95, 4.0 / _NORMAL_95),
    "sbas": Grade(1.062 / _RADIAL_95, 1.790 / _NORMAL_95),
    "differential": Grade(0.50 / _RADIAL_RMS, 0.75),
    "rtk_float": Grade(0.20 / _RADIAL_RMS, 2.0 * 0.20 / _RADIAL_RMS, correlation_time=300.0),
    "rtk_fixed": Grade(0.01 / _RADIAL_RMS, 0.02, white=0.5, markov=0.5, bias=0.0),
}


def grade(name: str) -> Mapping[str, float]:
    """Parameters of the Platform for a GPS grade, by name, in SI units.

    Raises
    ------
    KeyError
        The name is not a key of `GRADES`.
    """
    chosen = GRADES[name]
    shares = {"std": chosen.white, "markov_std": chosen.markov, "bias_std": chosen.bias}
    axes = {"horizontal": chosen.horizontal, "vertical": chosen.vertical}
    errors = {
        # Four significant digits: more is not known, and the scenario file stays readable.
        f"gps_{axis}_{part}": float(f"{sqrt(share) * std:.4g}")
        for part, share in shares.items() for axis, std in axes.items()
    }
    return errors | {"gps_correlation_time": chosen.correlation_time}


PRESET = Preset(
    "gps_grade", "platform", "Sets the keys of the GPS that are not given: {}", grade, GRADES
)

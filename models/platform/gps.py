"""GPS grades: published accuracies, and the errors of a position that they imply.

Sources; what they do not say is an estimate, and is said to be one in the README of this folder.

standalone
    FAA, *GPS SPS Performance Analysis Report* for April to June 2013, as summarised in IFR
    magazine, "GPS/WAAS Scorecard": about 3 m horizontal and 4 m vertical, 95 %.
sbas
    FAA, *WAAS Performance Analysis Report* no. 10 (November 2004), executive summary: the worst
    site has 1.062 m horizontal and 1.790 m vertical, 95 %.
differential, rtk_fixed
    Trimble, *5700 GPS Receiver User Guide*, Table 9.2: L1 C/A code 0.50 m and 0.75 m (one sigma);
    RTK 1 cm + 1 ppm and 2 cm + 2 ppm (RMS). The base is near: nothing is added per kilometre.
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
"""95 % of the length of a vector of two unit normals."""
_NORMAL_95 = 1.959964
"""Half the width of the interval with 95 % of a unit normal."""
_RADIAL_RMS = sqrt(2.0)
"""RMS of the length of a vector of two unit normals."""


@dataclass(frozen=True, slots=True)
class Grade:
    """How far a position is off, and how the error varies.

    Attributes
    ----------
    horizontal, vertical
        Standard deviation of the whole error, horizontal per axis [m].
    white, markov, bias
        Shares of the variance that are white, vary slowly, and are constant over a run.
    correlation_time
        Of the part that varies slowly [s].
    """

    horizontal: float
    vertical: float
    white: float = 0.01
    markov: float = 0.49
    bias: float = 0.5
    correlation_time: float = 100.0


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
        # Four digits: nobody knows more, and a scenario file stays readable.
        f"gps_{axis}_{part}": float(f"{sqrt(share) * std:.4g}")
        for part, share in shares.items() for axis, std in axes.items()
    }
    return errors | {"gps_correlation_time": chosen.correlation_time}


PRESET = Preset("gps_grade", "platform", "Sets keys of the GPS not given: {}", grade, GRADES)

"""Clock grades: how fast a receiver's clock drifts from the beacons' clocks, as a fraction.

Sources. Published figures are limits or accuracies. Taking them as a standard deviation (for the
crystal, as two) is an estimate.

crystal
    Micro Crystal CC7V-T1A, a watch crystal: tolerance ±20 ppm (Microchip, *Selecting and Testing
    32 kHz Crystal Oscillators for AVR Microcontrollers*, AN2648, table of tested crystals).
tcxo
    Vig, *Introduction to Quartz Frequency Standards*, SLCET-TR-92-1 (1992), Table 1: ageing of 5 ·
    10⁻⁷ a year. (Including all effects of temperature, the accuracy over a year is 2 · 10⁻⁶.)
ocxo
    The same table: accuracy 10⁻⁸ over a year.
csac
    4 · 10⁻¹⁰: effect of temperature on a Symmetricom SA.45s, from its data sheet as quoted on the
    list time-nuts (24 January 2018). It ages by 6 to 9 · 10⁻¹⁰ a month (Microchip, "Chip Scale
    Atomic Clocks: Effects on Timing Error", part 2, 2020), so the figure holds for a clock that was
    calibrated within some weeks.
"""

from __future__ import annotations

from collections.abc import Mapping

from ..preset import Preset

GRADES: Mapping[str, float] = {"crystal": 1e-5, "tcxo": 5e-7, "ocxo": 1e-8, "csac": 4e-10}
"""Standard deviation of the drift over many clocks [s/s]."""


def grade(name: str) -> Mapping[str, float]:
    """Parameters of the Acoustics for a clock grade, by name, in SI units.

    The grade sets the spread from which each run draws a drift; the constant drift is zero.

    Raises
    ------
    KeyError
        The name is not a key of `GRADES`.
    """
    return {"clock_drift": 0.0, "clock_drift_std": GRADES[name]}


PRESET = Preset(
    "clock_grade", "acoustics", "Sets the keys of the receiver's clock that are not given: {}",
    grade, GRADES,
)

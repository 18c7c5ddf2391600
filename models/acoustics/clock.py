"""Clock grades: how fast a receiver's clock runs away from the beacons', as a fraction.

Sources; what is published is a limit or an accuracy, and that it is a standard deviation (for the
crystal two) is an estimate.

crystal
    Micro Crystal CC7V-T1A, a watch crystal: tolerance ±20 ppm (Microchip, *Selecting and Testing
    32 kHz Crystal Oscillators for AVR Microcontrollers*, AN2648, table of tested crystals).
tcxo
    Vig, *Introduction to Quartz Frequency Standards*, SLCET-TR-92-1 (1992), Table 1: it ages by
    5 · 10⁻⁷ a year. (With all that temperature does, its accuracy over a year is 2 · 10⁻⁶.)
ocxo
    The same table: accuracy 10⁻⁸ over a year.
csac
    4 · 10⁻¹⁰, what temperature does to a Symmetricom SA.45s, by its data sheet as quoted on the
    list time-nuts (24 January 2018); it ages by 6 to 9 · 10⁻¹⁰ a month (Microchip, "Chip Scale
    Atomic Clocks: Effects on Timing Error", part 2, 2020), so the figure is that of a clock
    calibrated within some weeks.
"""

from __future__ import annotations

from collections.abc import Mapping

from ..preset import Preset

GRADES: Mapping[str, float] = {"crystal": 1e-5, "tcxo": 5e-7, "ocxo": 1e-8, "csac": 4e-10}
"""Standard deviation of the drift over many clocks [s/s]."""


def grade(name: str) -> Mapping[str, float]:
    """Parameters of the Acoustics for a clock grade, by name, in SI units.

    The drift is drawn from the grade, so none is the same in every run.

    Raises
    ------
    KeyError
        The name is not a key of `GRADES`.
    """
    return {"clock_drift": 0.0, "clock_drift_std": GRADES[name]}


PRESET = Preset(
    "clock_grade", "acoustics", "Sets keys of the receiver's clock not given: {}", grade, GRADES
)

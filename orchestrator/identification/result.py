"""The answer of `identify`: the numbers of a device, and the scenario that simulates it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from math import sqrt
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from sblcosim.models.acoustics.ranging import INVERTED, legs

from .. import artifacts, style
from ..answer import Answer
from ..catalogue import Figure, Job, by_name, jobs
from ..data.estimates import Floats
from ..data.tables import Columns, TableColumn
from ..layout import fitted
from ..scenario.arrangement import has_own_errors
from ..scenario.scenario import Scenario
from ..words.shares import percent
from . import figures
from .device import YES, Device, Told

NUMBERS = Columns(
    "DeviceNumber",
    "A number of the device.",
    (),
    (
        TableColumn("parameter", "Its name; the number of a beacon in brackets.", type=str),
        TableColumn("estimate", "The most probable value; null if the log does not tell it."),
        TableColumn("low", "Lower end of its 95 % interval."),
        TableColumn("high", "Upper end of it."),
        TableColumn("unit", "Unit of the three.", type=str),
        TableColumn("told", "Whether the log tells the number.", type=Told),
        TableColumn("explanation", "Its meaning, or why the log does not tell it.", type=str),
    ),
)
_KEYS = {
    "range_std": "acoustics.range_std_m", "late_share": "acoustics.outlier_probability",
    "late_mean": "acoustics.outlier_mean_m", "loss_share": "acoustics.loss_probability",
    "depth_std": "target.depth_std_m",
}
"""Keys of a scenario that take a number as it is."""
_BURST = "acoustics.loss_burst_length"
_GPS_KEYS = {
    "gps_std": "platform.gps_horizontal_std_m",
    "gps_markov_std": "platform.gps_horizontal_markov_std_m",
    "gps_correlation_time": "platform.gps_correlation_time_s",
}


@dataclass(frozen=True, eq=False, repr=False)
class Identified(Answer):
    """A device, identified from a log.

    Attributes
    ----------
    log
        Name of the log.
    device
        Everything that it tells.
    base
        The scenario whose other keys are kept.
    said
        What was left out of the log, and where the base is from, as sentences.
    beacons
        Names of the beacons; without them, their numbers count.
    dive
        Keys of the scenario that dives as a log without a scenario did.
    """

    document = "identify"
    columns = MappingProxyType({"numbers": NUMBERS})

    log: str
    device: Device
    base: Scenario
    said: tuple[str, ...] = ()
    beacons: tuple[str, ...] = ()
    dive: Mapping[str, Any] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """Of a page."""
        return f"The device of {self.log}"

    @property
    def answer(self) -> str:
        """The noise of ranges and its late ones, and how much the log tells, in two sentences."""
        numbers = {n.parameter: n for n in self.device.numbers}
        noise, share, mean = (numbers[n] for n in ("range_std", "late_share", "late_mean"))
        late: str = share.told
        if late == YES and share.estimate is not None:
            late = f"{percent(share.estimate, '.2g')} are late"
            if mean.told == YES and mean.estimate is not None:
                late += f", by {mean.estimate:.2g} m on average"
        else:
            late = f"late ranges: {late}"
        told = sum(n.told == YES for n in numbers.values())
        first = "The log does not tell the noise of a range"
        if noise.told == YES and noise.low is not None and noise.high is not None:
            first = (f"A range has a noise of {noise.estimate:.3g} m ({noise.low:.3g} to "
                     f"{noise.high:.3g} m)")
        return f"{first}; {late}. The log tells {told} of {len(numbers)} numbers of the device."

    @property
    def numbers(self) -> pd.DataFrame:
        """The numbers, one row each, with the columns of `NUMBERS`."""
        return pd.DataFrame([asdict(n) for n in self.device.numbers], columns=NUMBERS.names)

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The numbers."""
        return {"numbers": self.numbers}

    @property
    def figures(self) -> list[Job]:
        """The residuals of the ranges by beacon."""
        return jobs(FIGURES, self)

    @property
    def remarks(self) -> Sequence[str]:
        """Remarks that are needed to read the numbers."""
        return [*self.said, *self.device.remarks, *self._shared()]

    def _shared(self) -> list[str]:
        """What all arrivals of a ping share cannot be told apart from the rest."""
        a = self.base.acoustics
        if a.ranging not in INVERTED or not (a.range_common_std_m or a.arrivals_shared):
            return []
        return [
            "not in this log: how much of the noise all arrivals of a ping share; "
            f"acoustics.range_std_m ({a.range_std_m:g} m) and range_common_std_m "
            f"({a.range_common_std_m:g} m) stay those of {self.base.name}"
        ]

    def overrides(self) -> dict[str, Any]:
        """Keys of the scenario that the log decides: what it does not tell keeps its value.

        The base's late ranges are kept where they cannot be told from noise or from turns, and a
        scale whose interval holds zero does not replace the base's. Correlated residuals tell less:
        the noise is then that of independent ranges that tell as much. Offsets that walk count as
        noise, too (`Device.white_std`), as no simulated device has them. Losses come in bursts
        where the interval of their length does not hold that of independent losses. The
        places of fixed beacons are known as well as the ranges tell, where they do.

        What all arrivals of a ping share is part of the noise of a range: both stay as they are.
        Of two-way ranges, a loss is that of either leg, an offset is a delay of the answer, and the
        noise of answers is part of that of ranges.
        """
        known, base = self.device.known, self.base
        changes: dict[str, Any] = {key: known[n] for n, key in _KEYS.items() if n in known}
        if "late_mean" not in known:  # a share without its mean is that of another device
            changes.pop(_KEYS["late_share"], None)
        if "loss_share" in known and self._legs > 1:  # of a range; both legs must arrive
            changes[_KEYS["loss_share"]] = 1 - sqrt(1 - known["loss_share"])
        changes |= self._bursts()
        if self._shared():
            changes.pop(_KEYS["range_std"], None)
        elif "range_std" in known:
            changes[_KEYS["range_std"]] = self.device.white_std(base.acoustics.outlier_probability)
        if "gps_std" in known or "gps_markov_std" in known:
            changes |= {key: known[n] for n, key in _GPS_KEYS.items() if n in known}
        assumed = base.acoustics.assumed_sound_speed_m_s
        (scale,) = (n for n in self.device.numbers if n.parameter == "range_scale")
        ends = (scale.low, scale.high) if scale.told == YES else (None, None)
        if ends[0] is not None and ends[1] is not None and ends[0] * ends[1] > 0:
            changes["acoustics.sound_speed_m_s"] = assumed / (1 + known["range_scale"])
        if has_own_errors(base.platform) and self.device.place_std is not None:
            changes["platform.mounting_std_m"] = self.device.place_std
        offsets = [v for n, v in known.items() if n.startswith("range_offset")]
        if offsets and self._legs == 1:
            changes["acoustics.clock_offset_s"] = float(np.mean(offsets)) / assumed
        elif offsets:  # the part of the turn-around that the diver does not know
            late = 2 * float(np.mean(offsets)) / assumed
            changes["acoustics.processing_delay_s"] = max(late, 0.0)
            changes["acoustics.processing_delay_correction_s"] = max(-late, 0.0)
        if self._legs > 1 and "range_std" in known:
            changes["acoustics.turnaround_std_s"] = 0.0  # it is part of the noise of the range
        return changes

    @property
    def _legs(self) -> int:
        return legs(self.base.acoustics.ranging)

    def _bursts(self) -> dict[str, Any]:
        """The mean length of bursts, if losses are not independent of each other."""
        numbers = {n.parameter: n for n in self.device.numbers}
        share, burst = numbers["loss_share"].estimate, numbers["loss_burst"]
        if share is None or burst.estimate is None or burst.low is None or burst.high is None:
            return {}
        if share >= 1 or burst.low <= 1 / (1 - share) <= burst.high:
            return {}
        if self._legs == 1:
            return {_BURST: max(burst.estimate, 1.0, share / (1 - share))}
        # Rounds without a loss end at the same rate as they begin, by either leg.
        p = 1 - sqrt(1 - share)
        begins = 1 - sqrt(max(1 - share / ((1 - share) * burst.estimate), 0.0))
        return {_BURST: max(p / ((1 - p) * begins), 1.0) if begins > 0 else 1.0}

    def scenario(self) -> Scenario:
        """The scenario that simulates the device: the base with what the log tells."""
        return self.base.override({**self.dive, **self.overrides()}.items())

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The answer, then the numbers.

        Parameters
        ----------
        verbose
            Add what each number means.
        width
            Columns to fit into; None: sentences are not wrapped.
        """
        rows = []
        for n in self.device.numbers:
            values = ("" if v is None else f"{v:.3g}" for v in (n.estimate, n.low, n.high))
            last = n.told if n.told == YES and not verbose else f"{n.told}: {n.explanation}"
            rows.append((n.parameter, *values, n.unit, last))
        heads = ("number", "estimate", "from", "to", "unit", "told by the log")
        widths = [max(len(row[i]) for row in (heads, *rows)) for i in range(len(heads) - 1)]
        lines = [
            "  ".join((
                row[0].ljust(widths[0]), *(row[i].rjust(widths[i]) for i in (1, 2, 3)),
                row[4].ljust(widths[4]), row[5],
            )).rstrip() for row in (heads, *rows)
        ]
        remarks = [f"  {line}" for line in self.remarks]
        return fitted("\n".join((self.answer, *remarks, "", *lines)), width)

    def to_json(self) -> dict[str, Any]:
        """Everything as plain data."""
        plain: dict[str, Any] = artifacts.plain({
            "log": self.log,
            "numbers": NUMBERS.rows(self.numbers),
            "correlation": {str(b + 1): v for b, v in self.device.correlation.items()},
            "overrides": self.overrides(),
            "remarks": list(self.remarks),
        })
        return plain

    def manifest(self) -> dict[str, Any]:
        """The log, and what it tells."""
        return {"identified": self.to_json()}

    def write(
        self, folder: Path, theme: style.ThemeName = "light", figures: bool = True
    ) -> None:
        """Write table, figure and scenario into an existing folder."""
        super().write(folder, theme, figures)
        (folder / "scenario.toml").write_text(
            self.scenario().dump_toml(folder, everything=False), "utf-8"
        )

    def _gist(self) -> str:
        return self.answer


def _residuals(found: Identified) -> tuple[Mapping[str, Floats], float, float, float]:
    """Residuals by beacon; noise, and share and mean excess of late ranges."""
    device = found.device
    innovation = device.of_ranges.by_range["innovation"][0]
    by_beacon = {
        found.beacons[b] if found.beacons else str(b + 1): innovation[device.ranges.beacon == b]
        for b in np.unique(device.ranges.beacon).tolist()
    }
    variance = device.of_ranges.by_range["variance"][0]
    _, share, mean, *_ = device.motion.parameters.tolist()
    return by_beacon, float(np.sqrt(np.median(variance))), share, mean


FIGURES: Mapping[str, Figure[Identified]] = by_name(
    Figure(
        "residuals", figures.plot_residuals, _residuals,
        lambda found: "Ranges minus what the filter expected, by beacon, with the density that the "
        "identified numbers give.",
        lambda found: "Histograms of residuals, one for each beacon, with a curve",
    ),
)
"""The figures of the answer."""

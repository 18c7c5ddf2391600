"""What is in a log: times, beacons, gaps, repeats, rates, flaws and a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from .. import artifacts, layout, style
from ..answer import Answer
from ..catalogue import Figure, Job, by_name, jobs
from ..data.estimates import Integers
from ..errors import shortened
from ..scenario.scenario import load
from ..shown import Picture
from ..words.lists import counted, first_of
from ..words.numbers import is_missing, rounded
from ..words.shares import percent
from .columns import SIGNED
from .figures import gaps, plot_log, series_of
from .folder import SCENARIO, write
from .log import GAP, Log, usual_pause
from .raw import REPEATED
from .read import read_log
from .tables import BEACONS, FLAWS, SERIES
from .times import date_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..style import ThemeName

_MOST_LINES = 5
"""Number of lines that the text names of each flaw; with ``verbose``, all."""


@dataclass(frozen=True, eq=False, repr=False)
class LogContents(Answer):
    """What is in a log.

    Attributes
    ----------
    log
        The log.
    beacons, series, flaws
        Tables with the columns of `sblcosim.logs.tables`.
    """

    document = "log"
    columns = MappingProxyType({"beacons": BEACONS, "series": SERIES, "flaws": FLAWS})

    log: Log
    beacons: pd.DataFrame
    series: pd.DataFrame
    flaws: pd.DataFrame

    def plot(self, axes: Sequence[Axes] | None = None, theme: ThemeName = "light") -> Picture:
        """The picture, two or three axes; see `sblcosim.logs.figures.plot_log`."""
        return Picture(plot_log(self.log, axes, theme), axes)

    def save(
        self, directory: str | Path, *, figures: bool = True, theme: ThemeName = "light",
        other: artifacts.Other = "refuse", log: bool = False,
    ) -> Path:
        """Like `Answer.save`, with the log in the project's own format if it is asked for.

        Parameters
        ----------
        log
            Whether to add the log in the folder ``log``: what can be used, and the scenario with
            its settings, if it has one.
        """
        style.named(theme)
        with artifacts.draft(directory, self.manifest(), other) as draft:
            self.write(draft.folder, theme, figures)
            if log:
                self._write_log(draft.folder / "log", Path(directory) / "log")
        return draft.saved

    def _write_log(self, folder: Path, place: Path) -> None:
        """Write the log into a new folder, which will be at `place` in the end."""
        scenario = self.log.scenario
        told = {"log": self.log.name, "log_sha256": self.log.sha256()}
        with artifacts.folder(folder, told) as part:
            write(self.log, part)
            if scenario is not None:
                settings = load(scenario).dump_toml(place, everything=False)
                (part / SCENARIO).write_text(settings, "utf-8")

    def to_json(self) -> dict[str, Any]:
        """Everything as plain data."""
        log = self.log
        plain: dict[str, Any] = artifacts.plain(
            {
                "name": log.name,
                "start_ns": log.start_ns,
                "stop_ns": log.stop_ns,
                "span_s": (log.stop_ns - log.start_ns) / 1e9,
                "start_utc": date_of(log.start_ns) if log.dated else None,
                "dimension": log.meta.dimension,
                "kinds": dict(log.kinds),
                "origin": None if log.meta.origin is None else log.meta.origin.model_dump(),
                "beacons": BEACONS.rows(self.beacons),
                "series": SERIES.rows(self.series),
                "flaws": FLAWS.rows(self.flaws),
                "remarks": self.remarks,
            }
        )
        return plain

    def manifest(self) -> dict[str, Any]:
        """The outcome."""
        return {"log": self.to_json()}

    @property
    def title(self) -> str:
        """Of a page."""
        return f"Log {self.log.name}"

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """Beacons, other values and flaws; those that have rows."""
        named = {"beacons": self.beacons, "series": self.series, "flaws": self.flaws}
        return {name: table for name, table in named.items() if len(table)}

    @property
    def figures(self) -> list[Job]:
        """The picture."""
        return jobs(FIGURES, self)

    @property
    def answer(self) -> str:
        """What is in the log, and when it was recorded."""
        log, span = self.log, (self.log.stop_ns - self.log.start_ns) / 1e9
        parts = []
        if len(log.receptions):
            parts.append(f"{_ranges(log)} of {counted(len(log.beacons), 'beacon')}")
        if len(log.depth):
            parts.append(counted(len(log.depth), "depth"))
        parts += [f"{len(it):,} positions by {name}" for name, it in log.fixes.items()]
        if log.truth is not None:
            parts.append(f"{len(log.truth.time_ns):,} true positions")
        when = (
            f"From {date_of(log.start_ns)} to {date_of(log.stop_ns)}, {_span(span)}"
            if log.dated else f"Time: {_span(span)}, without a date"
        )
        place = log.meta.origin
        where = "without a place on Earth" if place is None else (
            f"origin {place.latitude_deg:.6f}°, {place.longitude_deg:.6f}°"
        )
        plane = ", horizontal only" if log.meta.dimension == 2 else ""
        return f"{shortened(log.called)}: {', '.join(parts)}\n{when}; {where}{plane}"

    @property
    def remarks(self) -> list[str]:
        """What was found in the lines of the source, and what else must be known."""
        log, own = self.log, []
        if log.own_clock:
            own.append("the truth has a clock of its own, and is not in the picture's timeline")
        silent = [*self.beacons["beacon"][self.beacons["ranges"] == 0]]
        if silent:
            own.append(f"no range of {first_of(silent, 5)}")
        return [*log.counted(), *log.remarks, *log.without_depth(), *own]

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The answer, the tables, and what was found.

        Parameters
        ----------
        verbose
            Name all lines with flaws.
        width
            Columns to fit into; None: lines are not wrapped.
        """
        parts = [layout.fitted(self.answer, width)]
        for columns, table in ((BEACONS, self.beacons), (SERIES, self.series)):
            if len(table):
                heads = [columns.heading(it) for it in columns.printed]
                rows = [[_cell(it.name, row[it.name]) for it in columns.printed]
                        for row in table.to_dict("records")]
                right = range(1, len(heads))
                parts.append("\n".join(layout.table(rows, width, heads, [*right])))
        found = self.remarks if not verbose else [
            *(f"{it.file}: {it.entries:,} entries {'put right' if it.used else 'left out'}: "
              f"{it.flaw} (lines {it.lines})" for it in self.flaws.itertuples()),
            *self.remarks[len(self.log.counted()):],
        ]
        parts += [layout.fitted("\n".join(f"  {line}" for line in found), width)] if found else []
        return "\n\n".join(parts)

    def _gist(self) -> str:
        return f"of {self.log.name}"


def _ranges(log: Log) -> str:
    """How many ranges there are of each kind; those of the default kind need no word."""
    n, kinds = len(log.receptions), log.kinds
    if len(kinds) > 1:
        parts = (f"{percent(share)} {kind}" for kind, share in kinds.items())
        return f"{counted(n, 'range')} ({', '.join(parts)})"
    (kind,) = kinds
    if kind == SIGNED:
        return f"{counted(n, kind)} of arrivals"
    return counted(n, f"{kind} range" if kind in ("two-way", "inverted") else "range")


def _cell(name: str, value: Any) -> str:
    if name.endswith("_share"):
        return "–" if is_missing(value) else percent(value, ".0f")
    if isinstance(value, str):
        return layout.shorter(value, 32)
    if isinstance(value, int | np.integer):
        return f"{value:,}"
    return "–" if is_missing(value) else rounded(float(value))


def _span(seconds: float) -> str:
    if seconds < 120:
        return f"{rounded(seconds)} s"
    minutes = round(seconds / 60)
    return f"{minutes // 60} h {minutes % 60} min" if minutes >= 120 else f"{minutes} min"


FIGURES: Mapping[str, Figure[LogContents]] = by_name(
    Figure("log", plot_log, lambda it: (it.log,)),
)
"""The figures in the folder of what is in a log."""


def log(path: str | Path, mapping: str | Path | None = None) -> LogContents:
    """What is in a log, of whatever format.

    Parameters
    ----------
    path, mapping
        As for `sblcosim.read_log`.

    Raises
    ------
    ConfigurationError
        There is no such log, or it cannot be used.

    Examples
    --------
    >>> print(log("dive.jsonl"))                               # doctest: +SKIP
    """
    return contents_of(read_log(path, mapping))


def contents_of(found: Log) -> LogContents:
    """What is in a log that has been read."""
    return LogContents(found, _beacons(found), _series(found), _flaws(found))


def _beacons(log: Log) -> pd.DataFrame:
    heard, rows = log.receptions, []
    times = series_of(log)
    for i, name in enumerate(log.beacons):
        own = heard.range[heard.beacon == i]
        least, middle, most = np.quantile(own, (0, 0.5, 1)) if len(own) else (np.nan,) * 3
        rows.append(
            {"beacon": name, "ranges": len(own), **_timing(log, times[name], "receptions", name),
             "shortest_m": least, "median_m": middle, "longest_m": most}
        )
    return pd.DataFrame(rows, columns=BEACONS.names)


def _series(log: Log) -> pd.DataFrame:
    found: dict[str, tuple[Integers, str, str | None]] = {}
    if len(log.depth) or log.entries.get("depth"):
        found["depth"] = log.depth_ns, "depth", None
    if log.truth is not None:
        found["truth"] = log.truth.time_ns, "truth", None
    for name, fixes in log.fixes.items():
        found[f"fixes {name}"] = fixes.epoch_ns, "fixes", name
    rows = [
        {"series": name, "values": len(times), **_timing(log, times, table, of)}
        for name, (times, table, of) in found.items()
    ]
    return pd.DataFrame(rows, columns=SERIES.names)


def _timing(log: Log, times: Integers, table: str, of: str | None) -> dict[str, Any]:
    """What both tables say of values at these times."""
    flaws = [it for it in log.findings
             if it.table == table and not it.used and (of is None or it.of == of)]
    n, out = len(times), len(flaws)
    span = float(times[-1] - times[0]) / 1e9 if n > 1 else 0.0
    ends = _silent_ends(log, times)
    return {
        "left_out": out,
        "repeated": sum(it.what == REPEATED for it in flaws),
        "used_share": n / (n + out) if n + out else np.nan,
        "rate_Hz": (n - 1) / span if span > 0 else np.nan,
        "gaps": int(gaps(times).sum()) + len(ends) if n > 1 else 0,
        "longest_gap_s": float(max(np.diff(times).max(), *ends, 0)) / 1e9 if n > 1 else np.nan,
        "first_s": float(times[0] - log.start_ns) / 1e9 if n else np.nan,
        "last_s": float(times[-1] - log.start_ns) / 1e9 if n else np.nan,
    }


def _silent_ends(log: Log, times: Integers) -> list[int]:
    """Pauses before the first of some times and after the last that are gaps [ns]."""
    if len(times) < 2:
        return []
    ends = int(times[0]) - log.start_ns, log.stop_ns - int(times[-1])
    return [pause for pause in ends if pause > GAP * usual_pause(times)]


def _flaws(log: Log) -> pd.DataFrame:
    kinds: dict[tuple[str, str, bool], list[int]] = {}
    for it in log.findings:
        kinds.setdefault((it.file, it.what, it.used), []).append(it.line)
    rows = [
        {"file": file, "flaw": what, "used": used, "entries": len(lines),
         "lines": " ".join(map(str, dict.fromkeys(lines)))}
        for (file, what, used), lines in kinds.items()
    ]
    return pd.DataFrame(rows, columns=FLAWS.names)

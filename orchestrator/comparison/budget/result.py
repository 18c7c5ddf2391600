"""A budget of errors: in a sentence, a table, a figure, a folder."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
import pandas as pd

from ... import artifacts, layout, style
from ...answer import Answer
from ...catalogue import Job
from ...errors import ConfigurationError, nearest, quoted
from ...judge.definitions import LOST
from ...lazy import Module
from ...scenario.error_sources import SOURCES
from ...shown import Picture
from ...words.lists import listed
from ...words.numbers import short_length
from ...words.shares import percent, whole_percent
from .shares import CONFIDENCE
from .tables import ROWS, RowKind

if TYPE_CHECKING:
    from matplotlib.axes import Axes

drawings: Any = Module("sblcosim.comparison.budget.figures")

FRAMES: Mapping[str, str] = {
    "absolute": "absolute position",
    "own_relative": "position relative to the platform's true one",
}
"""Frames that a receiver and a bound share, and what the error is of."""
ALL, NONE, REMAINDER = "all", "what is left", "does not add up"
"""Names of the rows that are not sources."""
_NAMED = 4
"""Largest number of sources in the sentence."""
HALF_PERCENT = 0.005
"""Shares below this are shown as 0 %."""
_LEAST = 0.02
"""Shares below this are left out of the sentence."""


@dataclass(frozen=True, eq=False, repr=False)
class Budget(Answer):
    """Where the error of a receiver comes from.

    Attributes
    ----------
    table
        A row for each ``source`` and ``frame``, of a ``kind``: ``all`` (nothing switched),
        ``source``, ``together`` (some sources), ``rest`` (all switched) or ``remainder`` (what does
        not add up). ``rms_m`` is the error without the source. ``share`` is the part of the mean
        square that goes with it, with the 95 % interval from ``share_low`` to ``share_high``.
        ``alone_rms_m`` is the error with all others switched, ``alone_share`` what the source adds
        to the rest, as a part of the whole mean square. Columns ``bound_…`` are the same for the
        bound.
    runs, dropped
        Runs with each switch, and those left out because one of them failed.
    seed
        Seed of the first run.
    better
        Whether sources are replaced by better equipment, instead of switched off.
    untold
        Whether the receiver keeps the assumptions that it has without any switch.
    lost
        Share of the runs, without any switch, that end lost.
    bound_runs, bound_kind, acceleration_psd
        Runs over which the bound is averaged, ``bound`` or ``reference``, and its q [m²/s³].
    fixed
        Sources whose errors are the same in every run.
    equipment
        Better equipment in a few words, by source; empty if sources are switched off.
    unchanged
        Sources for which no better equipment is known.
    given
        Keys of the receiver that the scenario sets, so that no switch changes them.
    settings
        The scenario.
    """

    document = "budget"
    columns = MappingProxyType({"budget": ROWS})

    scenario: str
    receiver: str
    table: pd.DataFrame
    runs: int
    dropped: int
    seed: int
    better: bool
    untold: bool
    lost: float
    bound_runs: int
    bound_kind: str
    acceleration_psd: float | None
    fixed: tuple[str, ...] = ()
    equipment: Mapping[str, str] = field(default_factory=dict)
    unchanged: tuple[str, ...] = ()
    given: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)

    def of(self, frame: str = "absolute") -> pd.DataFrame:
        """The rows of a frame by source, the largest share first.

        Raises
        ------
        ConfigurationError
            The receiver has no error in this frame.
        """
        known = self.frames
        if frame not in known:
            raise ConfigurationError(
                f"frame: must be {' or '.join(known)} for {self.receiver}, got {quoted(frame)}"
                f"{nearest(frame, known)}"
            )
        rows = self.table[self.table["frame"] == frame].set_index("source")
        order = {kind: place for place, kind in enumerate(get_args(RowKind))}
        keys = rows.assign(order=rows["kind"].map(order), size=-rows["share"])
        return rows.loc[keys.sort_values(["order", "size"], kind="stable").index]

    @property
    def title(self) -> str:
        """Of a page."""
        return f"Budget of {self.scenario}"

    @property
    def answer(self) -> str:
        """The sources of the error in the absolute position, in a sentence."""
        return self.answer_of("absolute")

    @property
    def frames(self) -> list[str]:
        """Frames with an error."""
        return [*dict.fromkeys(self.table["frame"])]

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The budget."""
        return {"budget": self.table}

    @property
    def figures(self) -> list[Job]:
        """The shares in each frame."""
        return [
            Job(f"budget_{frame}", drawings.later("plot_budget"), (self, frame))
            for frame in self.frames
        ]

    @property
    def remarks(self) -> list[str]:
        """Remarks that are needed to read the numbers of the absolute position, one line each."""
        return [*self._notes("absolute")]

    def answer_of(self, frame: str) -> str:
        """The sources of the error in a frame, in a sentence."""
        rows = self.of(frame)
        found = rows[rows["kind"] == "source"]
        named = found[(found["share"] >= _LEAST) & (found["share_low"] > 0)].head(_NAMED)
        whole = short_length(rows["rms_m"].to_dict()[ALL])
        if named.empty:
            return f"{self.receiver}, {whole} RMS: no error stands out of {self.runs} runs"
        names = [
            self.label(name) if self.better else SOURCES[name].words
            for name in named.index.astype(str)
        ]
        shares = [whole_percent(share) for share in named["share"]]
        others = [f"{name} {share}" for name, share in zip(names[1:], shares[1:], strict=True)]
        first = f"{shares[0]} of the mean square is {names[0]}"
        if self.better:
            first = f"{names[0]} takes away {shares[0]} of the mean square"
        rms = short_length(named["rms_m"].iloc[0])
        parts = [f"{self.receiver}: {first}: {whole} → {rms} RMS"]
        parts += [", ".join(others)] if others else []
        left = float(rows["share"].to_dict()[NONE])
        if left >= _LEAST:
            done = "better" if self.better else "off"
            parts.append(f"{whole_percent(left)} is left with all {done}")
        added = float(named["share"].round(2).sum()) + (round(left, 2) if left >= _LEAST else 0)
        if added > 1.005:
            parts.append(
                "shares exceed 100 % because joint effects count for every error involved"
            )
        return "; ".join(parts)

    def label(self, source: str) -> str:
        """A row's name, with the better equipment, or with how all sources are switched."""
        done = "better" if self.better else "off"
        better = self.equipment.get(source, "")
        return {ALL: "nothing", NONE: f"{NONE}, all {done}"}.get(
            source, f"{source} → {better}" if better else source
        )

    def text(
        self, frame: str = "absolute", *, verbose: bool = False, width: int | None = None
    ) -> str:
        """The sentence, the table, and the remarks.

        Parameters
        ----------
        frame
            ``absolute``, or ``own_relative`` if the receiver has such an output.
        verbose
            Add the rows of sources of 0 %, the columns of each source alone and of what is
            possible, and how the numbers were made.
        width
            Columns of the terminal; None: lines are not wrapped.
        """
        none = [] if verbose else bars(self, frame, bound=False)[1]
        notes = [*self._notes(frame), *(self._method(frame) if verbose else ())]
        about = "" if frame == "absolute" else f"Error of the {FRAMES[frame]}. "
        lines = [f"{about}{self.answer_of(frame)}.", "", *self._rows(frame, verbose, none, width)]
        if none:
            names = listed([self.label(name) for name in none])
            lines.append(layout.fitted(f"{whole_percent(0.0)}: {names}", width))
        lines += [""] if notes else []
        fitted = [layout.fitted(line, width) for line in (lines[0], *notes)]
        return "\n".join([fitted[0], *lines[1:], *fitted[1:]])

    def _rows(
        self, frame: str, verbose: bool, left_out: Sequence[str], width: int | None
    ) -> Iterator[str]:
        done = "better" if self.better else "off"
        interval = percent(CONFIDENCE, ".0f")
        head = [done, ROWS.head("share"), interval, f"{ROWS.head('rms_m')} {done}"]
        bound = verbose and not np.isnan(self.of(frame)["bound_rms_m"]).all()
        if verbose:
            head += [ROWS.head("alone_share"), ROWS.head("alone_rms_m")]
        if bound:
            head += [self.bound_kind, f"its {ROWS.head('bound_rms_m')} {done}"]
        body = []
        for name, row in self.of(frame).drop(index=left_out).iterrows():
            cells = [
                self.label(str(name)),
                whole_percent(row["share"]), _interval(row["share_low"], row["share_high"]),
                short_length(row["rms_m"]),
            ]
            if verbose:
                cells += [whole_percent(row["alone_share"]), short_length(row["alone_rms_m"])]
            if bound:
                cells += [whole_percent(row["bound_share"]), short_length(row["bound_rms_m"])]
            body.append(cells)
        return layout.table(body, width, head, range(1, len(head)))

    def _notes(self, frame: str) -> Iterator[str]:
        """Remarks that are needed to read the numbers."""
        rows = self.of(frame)
        worse = rows[(rows["kind"] == "source") & (rows["share_high"] < 0)]["share"]
        if len(worse):
            named = ", ".join(f"{name} ({_negative(share)})" for name, share in worse.items())
            what = f"with better {named}" if self.better else f"without {named}"
            hint = "" if self.untold else "; compare --untold"
            yield (
                f"the error grows {what}: some errors cancel, or the receiver believes its model "
                f"too much then{hint}"
            )
        if self.untold:
            yield "untold: the receiver keeps its assumptions of the system with all errors"
        elif self.given:
            yield (
                f"the receiver is not told of a switch by what the scenario gives it: "
                f"{', '.join(self.given)}"
            )
        if self.fixed:
            yield (
                f"the same in every run, so this holds for their values and signs: "
                f"{', '.join(self.fixed)}"
            )
        if self.unchanged:
            yield f"nothing better is known for: {', '.join(self.unchanged)}"
        if self.lost > 0:
            lost = percent(self.lost, ".1f")
            yield f"lost in {lost} of the runs, which may make most of a mean square"
            yield LOST
        if self.dropped:
            which = "1 seed is left out: one of its runs" if self.dropped == 1 else (
                f"{self.dropped} seeds are left out: a run of theirs")
            yield f"{which} failed or has no estimate"

    def _method(self, frame: str) -> Iterator[str]:
        done = "made better" if self.better else "switched off"
        yield (
            f"{self.runs} runs with each switch, seeds from {self.seed} on, the same noise with "
            f"all; share: of the mean square over all runs, what goes when this alone is {done}; "
            f"alone: what it adds when all others are {done}"
        )
        yield (
            f"{percent(CONFIDENCE, '.0f')} intervals by a studentised bootstrap of whole seeds; "
            f"{REMAINDER}: the whole without the shares and what is left, as errors interact"
        )
        if self.bound_runs:
            unseen = self.unseen(frame)
            yield (
                f"{self.bound_kind}: the Cramér-Rao recursion along {self.bound_runs} runs, q = "
                f"{self.acceleration_psd:.2g} m²/s³ whatever is switched, of whoever is told"
                + (f"; it leaves out {listed(unseen)}" if unseen else "")
            )

    def unseen(self, frame: str = "absolute") -> list[str]:
        """Sources with a share of which the bound has no part, largest first."""
        rows = self.of(frame)
        seen = (rows["kind"] != "source") | (rows["bound_share"] != 0.0)
        names = rows.index[~seen & (rows["share"].abs() >= HALF_PERCENT)].astype(str)
        return [name for name in names if any(it.unmodelled for it in SOURCES[name].parts)]

    def plot(
        self, frame: str = "absolute", ax: Axes | None = None, theme: style.ThemeName = "light"
    ) -> Picture:
        """The shares as bars; see `sblcosim.comparison.budget.figures.plot_budget`."""
        return Picture(drawings.plot_budget(self, frame, ax, theme), ax)

    def to_json(self) -> dict[str, Any]:
        """Everything but the scenario as plain data."""
        plain: dict[str, Any] = artifacts.plain(
            {
                "scenario": self.scenario, "receiver": self.receiver,
                "answers": {frame: self.answer_of(frame) for frame in self.frames},
                "runs": self.runs, "dropped": self.dropped, "seed": self.seed,
                "better": self.better, "untold": self.untold, "lost": self.lost,
                "bound_runs": self.bound_runs, "bound_kind": self.bound_kind or None,
                "acceleration_psd_m2_s3": self.acceleration_psd,
                "fixed": self.fixed, "equipment": self.equipment,
                "unchanged": self.unchanged, "given": self.given,
                "rows": ROWS.rows(self.table),
            }
        )
        return plain

    def write(
        self, folder: Path, theme: style.ThemeName = "light", figures: bool = True
    ) -> None:
        """The table as CSV only, and a figure for each frame."""
        self.table.to_csv(folder / "budget.csv", index=False)
        for job in self.figures if figures else ():
            job.save(folder, theme)

    def manifest(self) -> dict[str, Any]:
        """Description of the runs; equal for equal budgets."""
        told = self.to_json()
        kept = ("receiver", "dropped", "seed", "better", "untold", "acceleration_psd_m2_s3")
        asked_runs = self.runs + self.dropped
        asked = list(dict.fromkeys(self.table["source"]))
        return {
            "budget": {key: told[key] for key in kept} | {"runs": asked_runs, "rows": asked},
            "scenario": artifacts.plain(self.settings),
        }

    def _gist(self) -> str:
        return f"of {self.scenario}: {self.answer}"



def _negative(share: float) -> str:
    """A share below 0, even if tiny."""
    return whole_percent(share) if share < -0.005 else f"−{percent(-share, '.1g')}"


def _interval(low: float, high: float) -> str:
    if np.isnan(low):
        return ""
    return f"{whole_percent(low).removesuffix(' %')} to {whole_percent(high).removesuffix(' %')}"


def bars(budget: Budget, frame: str, *, bound: bool = True) -> tuple[list[str], list[str]]:
    """The rows of a table or a figure, from top to bottom, and the sources of 0 % to be listed.

    For a source of 0 %, share and interval of the receiver are 0 %, and so is the share of the
    bound where it is shown.
    """
    rows = budget.of(frame)
    columns = ["share", "share_low", "share_high", *(["bound_share"] if bound else [])]
    none = (rows["kind"] == "source") & (rows[columns].abs() < HALF_PERCENT).where(
        rows[columns].notna(), True
    ).all(axis=1)
    shown = rows.index[(rows["kind"] != "all") & ~none]
    return [str(name) for name in shown], [str(name) for name in rows.index[none]]

"""A run in one line, and on a page of a notebook."""

from __future__ import annotations

from html import escape
from typing import Any

import pandas as pd

from .. import shown
from ..errors import SblcosimError
from ..judge.columns import ERRORS
from ..judge.definitions import FRAME_WORDS
from . import text

_HEADS = {
    "absolute": "absolute",
    "relative": "relative to the platform, as it reports",
    "own_relative": "relative, by own account",
}
"""Names of the frames in the first table; the folded ones use `definitions.FRAME_WORDS`."""


def gist(result: text.ToldResult) -> str:
    """What was run, and the RMS of each receiver's total error."""
    try:
        rms: Any = result.errors.xs(("absolute", "total"), level=("frame", "axis"))["rms_m"]
    except SblcosimError:
        return f"{result.scenario_name}: with a broken estimate; see errors"
    reached = [
        f"{name} {rms[name]:.2f} m" if pd.notna(rms[name]) else f"{name} without an estimate"
        for name in result.receivers
    ]
    failed = [f"{name} failed" for name in result.failures]
    return f"{result.scenario_name}: RMS error {', '.join([*reached, *failed])}"


def page(result: text.ToldResult) -> str:
    """HTML: the verdicts and a row for each receiver; tables and explanations are folded."""
    about = [text.about(result, name) for name in result.receivers]
    parts = (*about, [text.WITHIN, *text.notes(result)])
    words = "\n\n".join("\n".join(part) for part in parts)
    return shown.page(
        result.title,
        f"<p>{'<br>'.join(map(escape, text.verdicts(result)))}</p>",
        _html(_overview(result), 2),
        shown.folded("Errors by axis [m]", _html(_errors(result))),
        shown.folded("Errors within [m]", _html(_within(result))),
        shown.folded("About the receivers and these numbers", shown.verbatim(words)),
    )


def _overview(result: text.ToldResult) -> pd.DataFrame:
    """RMS and 95 % of the total error [m], a row for each receiver, a column for each frame."""
    columns: dict[tuple[str, str], Any] = {}
    for frame in text.frames_in(result.errors):
        rms = result.errors.xs((frame, "total"), level=("frame", "axis"))["rms_m"]
        within = result.percentiles.xs((frame, "total"), level=("frame", "length"))["p95_m"]
        columns |= {(_HEADS[frame], "RMS [m]"): rms, (_HEADS[frame], "95 % [m]"): within}
    return pd.DataFrame(columns).reindex(list(result.receivers)).rename_axis(None)


def _errors(result: text.ToldResult) -> pd.DataFrame:
    frames = {
        FRAME_WORDS[f]: result.errors.xs(f, level="frame")[[c.name for c in ERRORS.printed]]
        for f in text.frames_in(result.errors)
    }
    whole = result.errors.xs("absolute", level="frame").index
    return pd.concat(frames, axis=1).reindex(whole)


def _within(result: text.ToldResult) -> pd.DataFrame:
    return result.percentiles.rename(index=FRAME_WORDS, level="frame")


def _html(table: pd.DataFrame, digits: int = 3) -> str:
    return table.to_html(float_format=f"{{:.{digits}f}}".format, na_rep="–", border=0)

"""What an answer says and shows, as plain data to compare with what it said before.

Numbers stand as they are or, from columns and drawn data, as their count, their sum and a weighted
sum, so that each of them counts and its place, too.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import re
from collections.abc import Iterable, Mapping
from html import unescape
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import scipy
from matplotlib.artist import Artist
from matplotlib.axis import Axis
from matplotlib.collections import Collection
from matplotlib.colors import to_hex
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.spines import Spine
from matplotlib.text import Text

RECORDED = Path(__file__).parent / "unit" / "orchestrator" / "recorded_answers"


def told(answer: Any, here: Path) -> dict[str, Any]:
    """Sentences, tables and figures of an answer, but for the name of a folder."""
    found = {
        "sentences": [answer.title, *answer.answer.splitlines(), *answer.remarks, *answer.problems],
        "text": answer.text(verbose=True).splitlines(),
        "tables": {name: table_of(table) for name, table in answer.tables.items()},
        "figures": {job.name: drawn(job.axes()) for job in answer.figures},
    }
    plain: dict[str, Any] = json.loads(json.dumps(found).replace(str(here), "HERE"))
    return plain


def words_of(page: str, here: Path) -> list[str]:
    """What an HTML page says, but for its figures and the names of folder and runs."""
    bare = re.sub(r"<(svg|style|script)\b.*?</\1>", "", page, flags=re.DOTALL)
    said = re.sub(r"\b[0-9a-f]{16,}\b", "RUN", unescape(bare).replace(str(here), "HERE"))
    said = re.sub(r"\bsblcosim \d+\.\d+\S*", "sblcosim VERSION", said)
    lines = re.sub(r"<[^>]*>", "\n", said).splitlines()
    told = [line.strip() for line in lines if line.strip()]
    return told[: told.index("Software") if "Software" in told else None]


def table_of(table: pd.DataFrame) -> dict[str, Any]:
    """Each column: its words, or the digest of its numbers. Runs are named by their code."""
    flat = table.reset_index() if table.index.names != [None] else table
    return {str(name): column_of(flat[name]) for name in flat if name != "run_id"}


def column_of(values: pd.Series[Any]) -> Any:
    if values.dtype.kind in "iuf" or values.dtype == bool:
        return digest(values.to_numpy())
    return sorted({str(value) for value in values})[:20]


def digest(values: Any) -> list[float]:
    """Count, sum and weighted sum of the finite numbers, and the count of the others."""
    given = np.asarray(values, dtype=float).ravel()
    finite = np.where(np.isfinite(given), given, 0.0)
    weights = 1.5 + np.cos(np.arange(len(given)))
    others = int((~np.isfinite(given)).sum())
    return [len(given), others, rounded(finite.sum()), rounded(weights @ finite)]


def digest_of_all(arrays: Iterable[Any]) -> list[float]:
    """One number for each row of several arrays, in which small values count like large ones."""
    total: Any = 0.0
    for n, given in enumerate(arrays):
        values = np.asarray(given, dtype=float)
        values = values.reshape(len(values), -1)
        finite = np.where(np.isfinite(values), values, 0.0)
        weights = (1.5 + np.cos(np.arange(values.shape[1]))) / max(values.shape[1], 1)
        others = (finite != values).mean(axis=1)
        total = total + np.cos(2 * n) * (others + np.arcsinh(1e4 * finite) @ weights)
    return [rounded(float(value)) for value in total]


def rounded(value: float) -> float:
    return float(f"{value:.9g}")


def drawn(axes: Any) -> list[Any]:
    """All that is drawn in the figure of some axes, with its look."""
    figure = axes.figure
    figure.canvas.draw()
    parts = [
        ["axes", [round(float(v), 3) for v in part.get_position().bounds],
         digest([*part.get_xlim(), *part.get_ylim()]), part.get_xscale(), part.get_yscale(),
         [t.get_text() for t in (*part.get_xticklabels(), *part.get_yticklabels())]]
        for part in figure.axes
    ]  # fmt: skip
    looks = [look(artist) for artist in shown(figure)]
    return [["figure", digest(figure.get_size_inches())], *parts, *filter(None, looks)]


def shown(artist: Artist) -> Iterable[Artist]:
    """The visible artists below one, but for axis lines, whose ticks are told with the axes."""
    for child in artist.get_children():
        if child.get_visible() and not isinstance(child, Axis | Spine):
            yield child
            yield from shown(child)


def look(artist: Artist) -> list[Any]:
    match artist:
        case Text():
            if not artist.get_text().strip():
                return []
            return ["text", artist.get_text(), *map(rounded, (artist.get_fontsize(),
                    artist.get_rotation())), artist.get_ha(), artist.get_va(),
                    color(artist.get_color()), digest(artist.get_unitless_position())]  # fmt: skip
        case Line2D():
            return ["line", digest(artist.get_xydata()), color(artist.get_color()),
                    rounded(artist.get_linewidth()), str(artist.get_linestyle()),
                    str(artist.get_marker()), rounded(artist.get_markersize()),
                    rounded(artist.get_markeredgewidth()), color(artist.get_markerfacecolor()),
                    color(artist.get_markeredgecolor()), rounded(artist.get_zorder())]  # fmt: skip
        case Collection():
            return ["collection", digest(np.ma.filled(artist.get_offsets(), np.nan)),
                    digest(np.concatenate([p.vertices for p in artist.get_paths()] or [[]])),
                    digest(artist.get_facecolor()), digest(artist.get_edgecolor()),
                    digest(artist.get_linewidth()), digest(artist.get_alpha() or 1.0),
                    rounded(artist.get_zorder())]  # fmt: skip
        case Patch():
            return ["patch", digest(artist.get_path().vertices),
                    digest(artist.get_patch_transform().get_matrix()),
                    color(artist.get_facecolor()), color(artist.get_edgecolor()),
                    rounded(artist.get_linewidth()), rounded(artist.get_zorder())]  # fmt: skip
        case AxesImage():
            return ["image", digest(np.ma.filled(artist.get_array(), np.nan)),
                    digest(artist.get_extent()), str(artist.get_cmap().name)]  # fmt: skip
    return []


def color(value: Any) -> str:
    return str(to_hex(value, keep_alpha=True))


def check(name: str, found: Mapping[str, Any], least: float = 1e-6) -> None:
    """Compare with the recorded file; with ``SBLCOSIM_RECORD_ANSWERS`` set, write it instead.

    Other versions of libraries than those that recorded may draw otherwise, and round otherwise.

    Parameters
    ----------
    least
        Relative difference that counts: that to which processors agree.
    """
    path = RECORDED / f"{name.replace(', ', '-').replace(' ', '-')}.json"
    now = {"numbers by": [np.__version__, scipy.__version__], "drawn by": [mpl.__version__]}
    if os.environ.get("SBLCOSIM_RECORD_ANSWERS"):
        path.parent.mkdir(exist_ok=True)
        path.write_text(written({**now, **found}) + "\n", "utf-8")
    before = json.loads(path.read_text("utf-8"))
    tolerance = least if before.pop("numbers by") == now["numbers by"] else 1e-3
    if before.pop("drawn by") != now["drawn by"]:
        before, found = undrawn(before), undrawn(found)
    differences = [*compared(before, found, tolerance)]
    assert not differences, "\n".join(differences[:20])


def undrawn(found: Any) -> Any:
    """The same without figures."""
    if not isinstance(found, Mapping):
        return found
    return {name: undrawn(part) for name, part in found.items() if name != "figures"}


SEARCHED = 1e-3
"""Relative difference of numbers that a search finds, whose last steps depend on the processor."""


def written(found: Mapping[str, Any]) -> str:
    """One line for each sentence, column and artist."""
    parts = [f'"{name}": {_lines(part)}' for name, part in found.items()]
    return "{" + ",\n".join(parts) + "}"


def _lines(part: Any, depth: int = 0) -> str:
    if isinstance(part, Mapping):
        inner = [f"{json.dumps(k)}: {_lines(v, depth + 1)}" for k, v in part.items()]
        return "{\n" + ",\n".join(inner) + "}"
    if isinstance(part, list) and (depth == 0 or any(isinstance(v, list) for v in part)):
        return "[\n" + ",\n".join(json.dumps(v, ensure_ascii=False) for v in part) + "]"
    return json.dumps(part, ensure_ascii=False)


def compared(before: Any, now: Any, tolerance: float, where: str = "") -> Iterable[str]:
    """Where two differ."""
    if isinstance(before, dict) and isinstance(now, dict) and before.keys() == now.keys():
        for key in before:
            yield from compared(before[key], now[key], tolerance, f"{where} / {key}")
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        for n, (one, other) in enumerate(zip(before, now, strict=True)):
            yield from compared(one, other, tolerance, f"{where} / {n}")
    elif not same(before, now, tolerance):
        yield f"{where}: {before!r} was recorded, got {now!r}"


def same(before: Any, now: Any, tolerance: float) -> bool:
    if isinstance(before, float | int) and isinstance(now, float | int):
        return math.isclose(before, now, rel_tol=tolerance, abs_tol=tolerance / 100)
    return bool(before == now)


def fields_of(thing: Any) -> Any:
    """The numbers of a dataclass, of what it holds, too."""
    if dataclasses.is_dataclass(thing):
        return {f.name: fields_of(getattr(thing, f.name)) for f in dataclasses.fields(thing)}
    if isinstance(thing, Mapping):
        return {str(key): fields_of(value) for key, value in thing.items()}
    if isinstance(thing, tuple | list):
        return [fields_of(value) for value in thing]
    if isinstance(thing, np.ndarray) and thing.dtype.kind in "biuf":
        return digest(thing)
    if isinstance(thing, float | np.floating):
        return rounded(float(thing)) if math.isfinite(thing) else str(thing)
    if isinstance(thing, pd.DataFrame):
        return table_of(thing)
    return thing if isinstance(thing, str | bool | int | None) else type(thing).__name__

"""A run as one HTML file that plays it back, without a network and without any other file."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Callable, Mapping
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import jinja2
from sblcosim.fmus import files

from ..data.estimates import Floats, Integers
from ..errors import ConfigurationError
from ..style import LINES, THEMES, Theme, variables
from .bundle import bundled, source
from .columns import milli, packed
from .playback import Playback

NAME = "replay.html"
"""Name of the page in the folder of a run."""
_ROWS, _COLUMNS = (0, 1, 1, 2, 2, 2), (0, 0, 1, 0, 1, 2)
"""Elements of a lower triangle, row by row."""


def write(played: Playback, file: str | Path) -> Path:
    """Write a page; equal runs give equal bytes. It appears when it is complete.

    Raises
    ------
    ConfigurationError
        The file does not end in ``.html``, or cannot be written.
    """
    return saved(file, "replay", lambda: render(played))


def saved(file: str | Path, what: str, made: Callable[[], str], ending: str = ".html") -> Path:
    """Write the text of a page, which is made once its name is known to be right.

    Parameters
    ----------
    what
        What makes the page, for messages.
    ending
        Ending of the file.

    Raises
    ------
    ConfigurationError
        The file does not have the ending, or cannot be written.
    """
    target = Path(file)
    if target.suffix.lower() != ending:
        raise ConfigurationError(f"{what}: must be a file {ending}, got {file}")
    text = made()
    try:
        files.make_folder(target.parent)
        files.write_file(target, text.encode())
    except OSError as error:
        raise ConfigurationError(
            f"{what}: must be a file that can be written, got {file} ({error.strerror})"
        ) from error
    return target


def render(played: Playback) -> str:
    """Text of a page."""
    template = environment().get_template("replay.html.jinja")
    return filled(template, content(played), style("replay.css"), "web/js/replay", played=played)


def filled(
    template: jinja2.Template, told: Mapping[str, Any], css: str, main: str, **more: Any
) -> str:
    """Text of a page: its template with data, style and script, and the hashes of the two.

    Parameters
    ----------
    told
        What its script reads.
    main
        Its module, see `sblcosim.web.bundle.bundled`.
    more
        What else the template has.
    """
    # A script of data ends at the first tag that looks like its end.
    data = json.dumps(told, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
    script = f"\n{bundled(main)}\n"
    return template.render(
        content=told, data=data, css=css, script=script,
        hashes={"script": hash_of(script), "style": hash_of(css)}, **more,
    )


def content(played: Playback) -> dict[str, Any]:
    """What the script of a page reads; see ``js/data.js``."""
    columns = columns_of(played)
    return {
        "title": played.title,
        "start": (played.start_ns - played.zero_ns) / 1e9,
        "stop": (played.stop_ns - played.zero_ns) / 1e9,
        "error": played.error,
        "axes": played.axes,
        "arms": played.has_arms,
        "beacons": 0 if (there := _beacons(played)) is None else there.shape[1],
        "receivers": _styled(played),
        "columns": [[name, len(column)] for name, column in columns.items()],
        "data": packed(columns),
    }


def _beacons(played: Playback) -> Floats | None:
    return played.reported if played.beacons is None else played.beacons


def _styled(played: Playback) -> list[dict[str, Any]]:
    """Receivers with the colours and line styles of the figures."""
    styled, filters = [], 0
    for it in played.receivers:
        if it.is_fix:
            styled.append({"label": it.label, "fix": True, "colour": "soft", "dash": []})
            continue
        pattern = LINES[filters % len(LINES)]
        colour = filters % len(THEMES["light"].receivers)
        styled.append({
            "label": it.label, "fix": False, "colour": f"line-{colour}",
            "dash": [] if isinstance(pattern, str) else [*pattern[1]],
        })
        filters += 1
    return styled


def columns_of(played: Playback) -> dict[str, Integers]:
    """Times since the start [ms] and lengths [mm], by name of their column."""
    columns = {"time": _ms(played.time_ns, played)}
    if played.diver is not None:
        columns |= _axes("diver", played.diver)
    for name, points in (("beacon", played.beacons), ("reported", played.reported)):
        for i in range(0 if points is None else points.shape[1]):
            columns |= _axes(f"{name}.{i}", points[:, i]) if points is not None else {}
    for i, it in enumerate(played.receivers):
        times = {"epoch": it.epoch_ns, "since": it.since_ns, "until": it.until_ns}
        columns |= {f"{i}.{name}": _ms(time, played) for name, time in times.items()}
        columns |= _axes(f"{i}", it.position)
        if it.truth is not None:
            columns |= _axes(f"{i}.true", it.truth)
        if it.factor is not None:
            lower = milli(it.factor)[:, _ROWS, _COLUMNS]
            columns |= {f"{i}.L{k}": lower[:, k] for k in range(6)}
    return columns


def _axes(name: str, points: Floats) -> dict[str, Integers]:
    """Columns of points (n, 3)."""
    whole = milli(points)
    return {f"{name}.{axis}": whole[:, i] for i, axis in enumerate("xyz")}


def _ms(time_ns: Integers, played: Playback) -> Integers:
    return milli((time_ns - played.start_ns) / 1e9)


def colours(look: Theme) -> dict[str, str]:
    """A theme's colours by the names of CSS variables, and those that pages mix from them."""
    return variables(look) | {
        "muted": _mixed(look.ink, look.paper, 0.35),
        "panel": _mixed(look.paper, look.ink, 0.04),
        "water": _mixed(look.paper, "#0072b2", 0.07),
    }


def _mixed(one: str, other: str, share: float) -> str:
    """A colour between two."""
    pairs = [(int(one[i : i + 2], 16), int(other[i : i + 2], 16)) for i in (1, 3, 5)]
    return "#" + "".join(f"{round(a + share * (b - a)):02x}" for a, b in pairs)


def style(*names: str) -> str:
    """Style sheet of a page: what all pages share, then files of this room."""
    base = environment().get_template("base.css").render(
        themes={name: colours(look) for name, look in THEMES.items()}
    )
    return "\n".join((base, *map(source, names)))


def hash_of(text: str) -> str:
    """Hash of a script or style for a content security policy."""
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"


@cache
def environment() -> jinja2.Environment:
    """Templates of this room, by the names of their files."""
    return jinja2.Environment(
        loader=jinja2.FunctionLoader(source),
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )

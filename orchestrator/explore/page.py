"""The page of a scenario as one HTML file, without a network and without any other file."""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from ..scenario.scenario import Scenario
from ..web.bundle import bundled
from ..web.page import environment, filled, saved, style
from .contents import PackedDive, contents, document, packed

MAIN = "explore/js/page"
"""The module of the page: its DOM."""
DIVE_ENDING = ".json"
"""Ending of the file of a recorded dive."""
WORKER = "explore/js/served"
"""The module of its workers."""


def write(
    scenario: Scenario, file: str | Path, receivers: Sequence[str] = (),
    beacons: Collection[int] = (), dive: PackedDive | None = None,
) -> Path:
    """Write the page of a scenario; equal scenarios give equal bytes. It appears when complete.

    Parameters
    ----------
    receivers, beacons, dive
        See `sblcosim.explore.contents.contents`.

    Raises
    ------
    ConfigurationError
        The file does not end in ``.html`` or cannot be written, or as `contents`.
    BuildError
        See `sblcosim.explore.contents.contents`.
    """
    return saved(file, "explore", lambda: render(contents(scenario, receivers, beacons, dive=dive)))


def write_dive(
    scenario: Scenario, file: str | Path, receivers: Sequence[str], dive: PackedDive
) -> Path:
    """Write a recorded dive as a file that can be opened in a page. It appears when complete.

    Parameters
    ----------
    scenario, receivers, dive
        See `sblcosim.explore.contents.document`.

    Raises
    ------
    ConfigurationError
        The file does not end in ``.json`` or cannot be written, or as `document`.
    """
    def made() -> str:
        return f"{json.dumps(document(scenario, receivers, dive), indent=1)}\n"

    return saved(file, "explore", made, DIVE_ENDING)


def show(file: Path) -> None:
    """Open a page in the browser, if there is one."""
    import webbrowser

    webbrowser.open(file.resolve().as_uri())


def render(told: dict[str, Any]) -> str:
    """Text of a page, from its contents."""
    template = environment().from_string(_source("explore.html.jinja"))
    css = f"{style()}\n{_source('explore.css')}"
    rest = {name: it for name, it in told.items() if name != "modules"} | {"worker": worker()}
    text = json.dumps(rest, ensure_ascii=False, separators=(",", ":"))
    held = {"title": told["title"], "modules": told["modules"], "packed": packed(text.encode())}
    return filled(template, held, css, MAIN)


def worker() -> str:
    """Script of a worker of the page. From a file, Chromium starts none that is a module."""
    return bundled(WORKER)


def _source(name: str) -> str:
    return (resources.files("sblcosim.explore") / name).read_text("utf-8")


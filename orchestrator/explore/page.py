"""The page of a scenario as one HTML file, without a network and without any other file."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from ..scenario.scenario import Scenario
from ..web.bundle import module
from ..web.page import environment, filled, saved, style
from .contents import contents

MAIN = "explore/js/page"
"""The module of the page: its DOM."""
_SERVE = "\nserve(self);\n"
"""From a file, Chromium starts only workers that are not modules."""


def write(
    scenario: Scenario, file: str | Path, receivers: Sequence[str] = (),
    beacons: Collection[int] = (),
) -> Path:
    """Write the page of a scenario; equal scenarios give equal bytes. It appears when complete.

    Parameters
    ----------
    receivers, beacons
        See `sblcosim.explore.contents.contents`.

    Raises
    ------
    ConfigurationError
        The file does not end in ``.html`` or cannot be written, or as `contents`.
    BuildError
        See `sblcosim.explore.contents.contents`.
    """
    return saved(file, "explore", lambda: render(contents(scenario, receivers, beacons)))


def show(file: Path) -> None:
    """Open a page in the browser, if there is one."""
    import webbrowser

    webbrowser.open(file.resolve().as_uri())


def render(told: dict[str, Any]) -> str:
    """Text of a page, from its contents."""
    template = environment().from_string(_source("explore.html.jinja"))
    css = f"{style()}\n{_source('explore.css')}"
    return filled(template, {**told, "worker": worker()}, css, MAIN)


def worker() -> str:
    """Script of a worker of the page."""
    return module("wasm/engine").replace("\nexport ", "\n") + _SERVE


def _source(name: str) -> str:
    return (resources.files("sblcosim.explore") / name).read_text("utf-8")


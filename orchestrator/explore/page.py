"""The page of a scenario as one HTML file, without a network and without any other file."""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from sblcosim.fmus import files

from ..errors import ConfigurationError
from ..scenario.scenario import Scenario
from ..web.bundle import bundled, module
from ..web.page import environment, hash_of, style
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
    target = Path(file)
    if target.suffix.lower() != ".html":
        raise ConfigurationError(f"explore: must be a file .html, got {file}")
    text = render(contents(scenario, receivers, beacons))
    try:
        files.make_folder(target.parent)
        files.write_file(target, text.encode())
    except OSError as error:
        raise ConfigurationError(
            f"explore: must be a file that can be written, got {file} ({error.strerror})"
        ) from error
    return target


def show(file: Path) -> None:
    """Open a page in the browser, if there is one."""
    import webbrowser

    webbrowser.open(file.resolve().as_uri())


def render(told: dict[str, Any]) -> str:
    """Text of a page, from its contents."""
    told = {**told, "worker": worker()}
    # A script of data ends at the first tag that looks like its end.
    data = json.dumps(told, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
    css = f"{style()}\n{_source('explore.css')}"
    script = f"\n{bundled(MAIN)}\n"
    return environment().from_string(_source("explore.html.jinja")).render(
        content=told, data=data, css=css, script=script,
        hashes={"script": hash_of(script), "style": hash_of(css)},
    )


def worker() -> str:
    """Script of a worker of the page."""
    return module("wasm/engine").replace("\nexport ", "\n") + _SERVE


def _source(name: str) -> str:
    return (resources.files("sblcosim.explore") / name).read_text("utf-8")


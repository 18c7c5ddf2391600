"""The explorer of a page, driven in node; and settings at random."""

from __future__ import annotations

import base64
import json
import random
import re
import shutil
import subprocess
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sblcosim.errors import SblcosimError
from sblcosim.explore.declarations import declarations
from sblcosim.fmus.build import compiler
from sblcosim.prepare.scenario import of_scenario
from sblcosim.scenario.scenario import Scenario, load
from sblcosim.scenario.schema import toml
from sblcosim.scenario.tracks import FOLLOWERS

NODE = shutil.which("node")
SCRIPT = Path(__file__).parents[1] / "orchestrator" / "explore" / "js" / "explorer.js"
HOST = Path(__file__).with_name("acceptance") / "explore_host.mjs"
MODULES = "--experimental-default-type=module"
"""Files ending in .js are modules, as in browsers."""
NEEDS = [
    pytest.mark.skipif(compiler.zig() is None, reason="needs ziglang"),
    pytest.mark.skipif(NODE is None, reason="needs node"),
    pytest.mark.filterwarnings("ignore"),
]
"""Marks of tests in node."""
NAME = "realistic-dive"
CHOICES = (("coupled", "ekf"), ("ekf",), ("coupled",), ("multilateration", "coupled"))
"""The scenario of a page, and receivers to draw from."""
Job = Mapping[str, Any]


def answers(contents: Mapping[str, Any], jobs: Sequence[Job], folder: Path) -> list[dict[str, Any]]:
    """What the explorer answers to jobs; see ``explore_host.mjs``."""
    assert NODE is not None
    (folder / "contents.json").write_text(json.dumps(contents))
    (folder / "jobs.json").write_text(json.dumps(jobs))
    files = [folder / it for it in ("contents.json", "jobs.json", "answers.json")]
    subprocess.run([NODE, MODULES, HOST, SCRIPT, *files], check=True, timeout=1800)
    found: list[dict[str, Any]] = json.loads(files[-1].read_text())
    return found


def values(text: str, like: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Recorded values, in the shape of others."""
    return np.frombuffer(base64.b64decode(text), "<f8").reshape(like.shape)


def plain(message: str, name: str) -> list[str]:
    """Lines of a refusal, without where the key was given."""
    lines = (re.sub(r"^override (\w+)\.(\w+)", r"[\1] \2", it) for it in message.splitlines())
    return sorted({re.sub(rf"^{name}(\.toml)?: ", "", it) for it in lines})


UNUSUAL = ("acoustics.temperature_C", "acoustics.profile_temperature_C")
"""Keys that a page refuses, though the command line takes them."""
OF_BOATS = tuple(f"platform.{it}" for it in (*FOLLOWERS["platform"].point_keys, "departure_time_s"))
"""Keys of a boat's track, which a page refuses unless its scenario has one."""
LONG = ("sampling_time_s", "interval_s", "duration_s", "ekf_ratio")
KEYS = [it for it in declarations() if it["table"] != "place" and it["key"] != "type"]


def as_typed(given: Mapping[str, Any]) -> dict[str, str]:
    """Values as people type them."""
    return {path: toml(value) for path, value in given.items()}


def drawn(numbers: random.Random, count: int, keys: Sequence[Mapping[str, Any]] = KEYS
          ) -> dict[str, Any]:
    """Some keys with a value that their declaration accepts."""
    return {it["path"]: a_value(it, numbers) for it in numbers.sample([*keys], count)}


def settings(numbers: random.Random, count: int, without: tuple[str, ...] = ()) -> dict[str, Any]:
    """Some keys at random, for the number of beacons that the page has."""
    keys = [
        it for it in KEYS
        if it["path"] not in (*UNUSUAL, *OF_BOATS)
        and it["key"] not in (*without, "beacons", "beacon_m")
    ]
    return drawn(numbers, count, keys)


def loaded(name: str, given: Mapping[str, Any], receivers: tuple[str, ...]) -> Scenario | str:
    """A scenario with these keys, or why it is refused."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = load(name, given.items())
            of_scenario(found, receivers)
        except SblcosimError as error:
            return str(error)
    return found


def a_value(key: Mapping[str, Any], numbers: random.Random) -> Any:
    if key["kind"] == "choice":
        return numbers.choice(key["choices"])
    if key["kind"] == "switch":
        return numbers.random() < 0.5
    if key.get("names") and numbers.random() < 0.3:
        return numbers.choice(key["names"])
    if key["kind"] not in ("vector", "matrix"):
        return a_number(key, numbers, key["kind"] == "integer")
    low, high = key["rows"]
    rows = numbers.randint(low, min(high, low + 6))
    width = key["columns"]
    cells = [[a_number(key, numbers, key["whole"]) for _ in range(width)] for _ in range(rows)]
    return cells if width > 1 else [it for row in cells for it in row]


def a_number(key: Mapping[str, Any], numbers: random.Random, whole: bool) -> float:
    bounds = key["bounds"]
    low = bounds.get("least", bounds.get("above", -30.0))
    high = bounds.get("most", bounds.get("below", 30.0))
    if whole:
        return numbers.randint(int(low), int(min(high, low + 20)))
    if low <= 0 <= high and "above" not in bounds and numbers.random() < 0.3:
        return 0.0
    size = 10 ** numbers.uniform(-3, 1.5)
    value = size if low >= 0 else size * numbers.choice([1.0, -1.0])
    value = round(min(max(value, low), high), numbers.randint(2, 5))
    return value if low <= value <= high else low

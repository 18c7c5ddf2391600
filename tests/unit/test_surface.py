"""Names and units that users rely on do not disappear (`docs/reference/stability.md`).

After a change that adds names, or removes one on purpose, record them anew:
``SBLCOSIM_RECORD_SURFACE=1 pytest tests/unit/test_surface.py``.
"""

from __future__ import annotations

import inspect
import json
import os
import re
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path

import pytest
import sblcosim
from sblcosim.models import COMPONENTS

ROOT = Path(__file__).parents[2]
RECORDED = Path(__file__).with_suffix(".json")
BLOCK = re.compile(r"<!-- made: (.+?) -->\n(.*?)<!-- end -->", re.S)
FIELD = re.compile(r"- (`\w+`) \((.+?)\)(?::|$)")
MODULES = ("", ".study", ".analysis", ".require", ".limits", ".research")

Surface = Mapping[str, Mapping[str, str]]


def surface() -> Surface:
    """All names by where they are listed, each with its unit or type where it has one."""
    return {**_pages(), "ports": dict(_ports()), "arguments": dict(_arguments()),
            "scenarios": dict.fromkeys(sblcosim.scenarios(), ""),
            "studies": dict.fromkeys(sblcosim.studies(), "")}


def _pages() -> Surface:
    return {
        f"{path.name}: {kind}": dict(_listed(text))
        for path in sorted((ROOT / "docs" / "reference").glob("*.md"))
        if path.name != "start-values.md"
        for kind, text in BLOCK.findall(path.read_text())
    }


def _listed(text: str) -> Iterator[tuple[str, str]]:
    """Rows of tables with their units and choices, and fields with their types, by heading."""
    heading, header = "", []
    for line in text.splitlines():
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if line.startswith("#"):
            heading, header = line.lstrip("# ") + " ", []
        elif field := FIELD.match(line):
            yield heading + field[1], field[2]
        elif cells and not header:
            header = cells
        elif cells and cells[0].startswith("`"):
            row = dict(zip(header, cells, strict=True))
            name = re.sub(r"^(`--[\w-]+) .*`$", r"\1`", cells[0])  # options without their values
            yield heading + name, row.get("unit", "")
            for choice in re.findall(r'`("\w+")`', row.get("values", "")):
                yield f"{heading}{name} = {choice}", ""


def _ports() -> Iterator[tuple[str, str]]:
    for name, component in COMPONENTS.items():
        for one in component.variables:
            shape = "×".join(map(str, one.shape))
            yield f"{name}.{one.name}", f"{one.causality} {one.type} {one.unit or ''} {shape}"


def _arguments() -> Iterator[tuple[str, str]]:
    for suffix in MODULES:
        module = import_module(f"sblcosim{suffix}")
        for name in module.__all__:
            if inspect.isroutine(thing := getattr(module, name)):
                for argument in inspect.signature(thing).parameters.values():
                    yield f"sblcosim{suffix}.{name}({argument.name})", ""


def missing(then: Surface, now: Surface) -> list[str]:
    """What was promised and is not there, or not in that unit."""
    return [
        f"{where}: {name} [{unit}]"
        for where, names in then.items()
        for name, unit in names.items()
        if now.get(where, {}).get(name) != unit
    ]


def test_nothing_that_is_promised_is_missing() -> None:
    now = surface()
    if os.environ.get("SBLCOSIM_RECORD_SURFACE"):
        RECORDED.write_text(json.dumps(now, indent=1, ensure_ascii=False) + "\n")
    assert not missing(json.loads(RECORDED.read_text()), now)


@pytest.mark.parametrize(("where", "name", "unit"), [
    ("commands.md: commands", "run `--seed`", ""),
    ("commands.md: commands", "export ssp `--out`", ""),
    ("json.md: json", "run `scenario_name`", "string"),
    ("scenario.md: keys platform", "`platform.track_tolerance_m`", "m"),
    ("scenario.md: keys platform", '`platform.gps_grade` = "rtk_fixed"', ""),
    ("logs.md: columns sblcosim.logs.columns.RECEPTIONS", "`arrival_ns`", "ns"),
    ("tables.md: columns sblcosim.areas.tables.CELLS", "`north_m`", "m"),
    ("python.md: names sblcosim", "`run`", ""),
    ("ports", "coupled.position", "output Float64 m 3"),
    ("arguments", "sblcosim.run(overrides)", ""),
    ("scenarios", "usbl-boat", ""),
    ("studies", "paper-scenario-3", ""),
])
def test_a_name_that_goes_is_noticed(where: str, name: str, unit: str) -> None:
    now = surface()
    assert now[where][name] == unit
    without = {**now, where: {key: value for key, value in now[where].items() if key != name}}
    assert missing(now, without) == [f"{where}: {name} [{unit}]"]

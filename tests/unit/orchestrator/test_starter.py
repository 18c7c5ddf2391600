"""The commented scenario file to begin with."""

from __future__ import annotations

import re
import tomllib

import pytest
from sblcosim.scenario.scenario import load, shipped
from sblcosim.scenario.schema import Acoustics, Platform, Receiver, Target, Time
from sblcosim.scenario.starter import starter

TABLES = {
    "time": Time, "target": Target, "platform": Platform, "acoustics": Acoustics,
    "receiver": Receiver,
}  # fmt: skip


def test_a_starter_is_valid_as_it_is() -> None:
    scenario = load(tomllib.loads(starter("mine")))
    assert scenario.name == "mine"
    assert scenario.platform.beaufort == 2


def test_a_starter_names_every_key_of_every_table_with_a_comment_above() -> None:
    text = starter("mine")
    for name, table in TABLES.items():
        section = re.split(r"^\[\w+\]$", text.partition(f"[{name}]\n")[2], flags=re.M)[0]
        for key in table.model_fields:
            assert re.search(rf"^# .*\n(# )?{key} = ", section, flags=re.M), f"[{name}] {key}"


def test_a_key_that_is_commented_out_is_valid_when_it_is_put_in_use() -> None:
    lines = starter("mine").splitlines()
    for name in TABLES:
        start = lines.index(f"[{name}]")
        for number, line in enumerate(lines[start + 1 :], start + 1):
            if line.startswith("["):
                break
            key = line.removeprefix("# ").partition(" = ")[0]
            # A foreign FMU goes with other keys, which are then to be changed as well.
            alone = key not in ("fmu", "parameters")
            if alone and line.startswith("# ") and key in TABLES[name].model_fields:
                changed = [*lines[:number], line.removeprefix("# "), *lines[number + 1 :]]
                load(tomllib.loads("\n".join(changed)))


@pytest.mark.parametrize("name", shipped())
def test_a_starter_from_a_scenario_is_that_scenario_under_another_name(name: str) -> None:
    made = load(tomllib.loads(starter("mine", name)))
    assert made.model_dump(exclude={"name"}) == load(name).model_dump(exclude={"name"})
    assert made.name == "mine"

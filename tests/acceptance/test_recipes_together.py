"""Recipes of CONTRIBUTING.md that add keys and values, in one copy, and where these are known."""

from __future__ import annotations

import json
import re
import sys

import pytest

from .test_recipes import Copy, recipe, with_documents

SAID = """
import json, sys
import reference
from sblcosim.cli.common import completion
from sblcosim.errors import ConfigurationError
from sblcosim.scenario.file_schema import scenario_schema
from sblcosim.scenario.scenario import load
from sblcosim.scenario.starter import starter

def said(key, value, near):
    table, _, name = key.partition(".")
    try:
        load("harbour-square", {key: near})
        message = ""
    except ConfigurationError as error:
        message = str(error)
    return {
        "schema": scenario_schema()["properties"][table]["properties"][name]["enum"],
        "reference": "\\n".join(reference.entries(table)),
        "starter": starter("mine", None, {key: value}),
        "message": message,
        "completion": [word for word, _ in completion.keys(key + "=")],
    }

def own(key):
    table, _, name = key.partition(".")
    try:
        load("harbour-square", {key[:-3] + key[-2:]: 1.0})
        message = ""
    except ConfigurationError as error:
        message = str(error)
    return {
        "schema": name in scenario_schema()["properties"][table]["properties"],
        "reference": f"| `{key}` |" in "\\n".join(reference.entries(table)),
        "starter": f"# {name} = " in starter("mine"),
        "message": f"did you mean '{name}'" in message or f"did you mean '{key}'" in message,
        "completion": key + "=" in [word for word, _ in completion.keys(key)],
    }

values, keys = json.loads(sys.argv[1])
print(json.dumps([[said(*one) for one in values], [own(key) for key in keys]]))
"""
KNOWN = {
    "Add a receiver": ("receiver.type", "direct", "dirct"),
    "Add a trajectory": ("target.trajectory", "zigzag", "zigzg"),
    "Add a schedule": ("acoustics.schedule", "pairs", "pair"),
    "Add packet content": ("acoustics.packet_content", "own_and_pose", "own_andpose"),
    "Add a grade of a sensor": ("platform.gps_grade", "survey", "survy"),
    "Add a key that sets others": ("target.depth_grade", "needle", "nedle"),
}
"""Recipes that add a value of a key: the key, the value, and one that is nearly it."""
NEW_KEYS = ("acoustics.bubble_excess_m", "target.zigzag_angle_deg", "target.depth_grade")


@pytest.fixture(scope="module")
def all_of_them(tmp_path_factory: pytest.TempPathFactory) -> Copy:
    """A copy with all that adds a value of a key, and a system to begin with: one build of FMUs."""
    made = Copy(tmp_path_factory.mktemp("all"))
    for title in (*KNOWN, "Add a range error", "Add a starting system"):
        made.follow(recipe(title))
    return made


def test_a_value_of_a_key_is_known_wherever_keys_are(all_of_them: Copy) -> None:
    asked = json.dumps([[*KNOWN.values()], NEW_KEYS])
    answers, of_keys = json.loads(with_documents(all_of_them, SAID, asked))
    for key, facts in zip(NEW_KEYS, of_keys, strict=True):
        assert all(facts.values()), (key, facts)
    for (key, value, _), said in zip(KNOWN.values(), answers, strict=True):
        name = key.partition(".")[2]
        assert value in said["schema"]
        _, _, entry = said["reference"].partition(f"| `{key}` |")
        assert re.search(rf"\b{value}\b", entry.partition("\n")[0])
        assert re.search(rf"^{name} = .{value}.$", said["starter"], re.MULTILINE)
        assert re.search(rf"^#.*\b{value}\b", said["starter"], re.MULTILINE)
        assert f"; did you mean {value!r}?" in said["message"]
        assert f"{key}={value}" in said["completion"]


PINGS = """
import json
import numpy as np
import sblcosim
from sblcosim.limits.parameters import conditions
from sblcosim.limits.places import epochs_of
from sblcosim.limits.parameters import model_of

def of(**changes):
    keys = {"time.duration_s": 4.0, "acoustics.loss_probability": 0.0,
            "acoustics.slot_order": [2, 4, 1, 3],
            **{f"acoustics.{name}": value for name, value in changes.items()}}
    return sblcosim.load("harbour-square", keys)

scenario = of(schedule="pairs", packet_content="own_and_pose", packet_resolution_m=0.5)
result = sblcosim.run(scenario, "coupled")
counts = result.record.values["acoustics.reception_count"]
own, said = (result.record.values[f"acoustics.{name}_beacon_position"]
             for name in ("ping", "packet"))
print(json.dumps({
    "new": np.diff(counts, axis=0).astype(int).tolist(),
    "heard": epochs_of(scenario, model_of(scenario), 1.0).heard.tolist(),
    "slots": conditions(scenario).slots,
    "multiples": bool((np.abs(said * 2 - np.round(said * 2)) < 1e-9).all()),
    "own": bool((own == said).all()),
    "pose": bool(result.record.values["acoustics.ping_platform_position"][-1].any(axis=-1).all()),
    "source": scenario.assumptions(["pose_source", "beacon_offset", "clock_std"])["pose_source"],
    "bits": [sblcosim.load(of(packet_content=name, packet_bits=100)).acoustics.packet_resolution_m
             for name in ("own_and_pose", "pose")],
    "n": int(result.errors.loc["coupled"]["n"].min()),
}))
"""


@pytest.mark.slow
def test_a_schedule_and_a_content_of_packets(all_of_them: Copy) -> None:
    found = json.loads(with_documents(all_of_them, PINGS))
    pairs = [[0, 1, 0, 1], [1, 0, 1, 0]]  # of the order 2, 4, 1, 3
    new = [row for row in found["new"] if any(row)]
    assert len(new) > 10
    assert all(row == pairs[i % 2] for i, row in enumerate(new, new[0] == pairs[1]))
    assert all(row == pairs[i % 2] for i, row in enumerate(found["heard"]))
    assert found["slots"] == 2
    assert found["multiples"]
    assert found["own"]
    assert found["pose"]
    assert found["source"] == "reported_pose"
    assert found["bits"][0] > found["bits"][1]
    assert found["n"] > 5


@pytest.mark.slow
def test_a_schedule_and_a_content_run_as_they_are_said(all_of_them: Copy) -> None:
    for title in ("Add a schedule", "Add packet content"):
        (commands,) = [text for language, text in recipe(title) if language == "sh"]
        all_of_them.run(commands)
    page = all_of_them.run(
        f"'{sys.executable}' -c \"from sblcosim.models import COMPONENTS\n"
        "for v in COMPONENTS['acoustics']: print(v.legend)\""
    )
    assert "90 pairs" in page
    assert "one beacon pings in each slot, all, or two" in page


@pytest.mark.slow
def test_a_key_that_sets_others(all_of_them: Copy) -> None:
    (commands,) = [text for language, text in recipe("Add a key that sets others")
                   if language == "sh"]  # fmt: skip
    all_of_them.run(commands)
    text = (all_of_them.folder / "runs" / "gauge" / "scenario.toml").read_text("utf-8")
    assert "depth_std_m = 0.2" in text
    assert "depth_bias_std_m = 0.5" in text


def test_a_system_to_begin_with(all_of_them: Copy) -> None:
    (commands,) = [text for language, text in recipe("Add a starting system")
                   if language == "sh"]  # fmt: skip
    all_of_them.run(commands)
    assert (all_of_them.folder / "raft.toml").is_file()
    help_ = "COLUMNS=200 sblcosim new --help"
    assert "raft|water-linked" in all_of_them.run(help_)
    told = with_documents(all_of_them, "import reference\n"
                          "from sblcosim.cli.common import completion\n"
                          "print(*reference.likes(), *completion.likes('ra'))")  # fmt: skip
    assert "| `raft` | a raft in a harbour (`harbour-square`) |" in told
    assert "('raft', 'a raft in a harbour')" in told

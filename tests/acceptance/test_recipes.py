"""The recipes of CONTRIBUTING.md, done in a copy of the sources, and run."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

ROOT = Path(__file__).parents[2]
MOST_LINES_ELSEWHERE = 1
"""That an extension may need outside its own file."""
FOLDERS = {"orchestrator": "", "models": "models", "fmus": "fmus"}


def recipe(title: str) -> list[tuple[str, str]]:
    """The blocks of a section: their languages and texts."""
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    section = re.split(r"^## ", text.partition(f"\n## {title}\n")[2], flags=re.MULTILINE)[0]
    return re.findall(r"^```(\w+)\n(.*?)^```$", section, re.DOTALL | re.MULTILINE)


def changed(text: str, lines: list[str]) -> str:
    """A text with the change of a block: lines begin with a space, ``-`` or ``+``."""
    old = "".join(f"{line[1:]}\n" for line in lines if line[:1] in (" ", "-"))
    new = "".join(f"{line[1:]}\n" for line in lines if line[:1] in (" ", "+"))
    assert text.count(old) == 1, f"must be there once, is there {text.count(old)} times:\n{old}"
    return text.replace(old, new)


class Copy:
    """A copy of the sources, and a Python that uses it."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.package = folder, folder / "package" / "sblcosim"
        for name, inner in FOLDERS.items():
            shutil.copytree(
                ROOT / name, self.package / inner, dirs_exist_ok=True,
                ignore=shutil.ignore_patterns("__pycache__", "ready"),
            )  # fmt: skip

    def path(self, name: str) -> Path:
        folder, _, rest = name.partition("/")
        return self.package / FOLDERS[folder] / rest

    def follow(self, blocks: list[tuple[str, str]]) -> list[str]:
        """Do what the blocks say; the commands are left."""
        commands: list[str] = []
        for language, text in blocks:
            first, _, rest = text.partition("\n")
            if language == "python":
                self.path(first.removeprefix("# ")).write_text(rest, "utf-8")
            elif language == "diff":
                path = self.path(first.removeprefix("--- "))
                path.write_text(changed(path.read_text("utf-8"), rest.splitlines()), "utf-8")
            else:
                commands.append(text)
        return commands

    def run(self, commands: str) -> str:
        """Run commands of a shell, with ``sblcosim`` from the copy; what they print."""
        done = self._done(commands)
        assert "warning" not in done.stderr
        return done.stdout

    def warned(self, commands: str) -> str:
        """The same: what they warn of."""
        return self._done(commands).stderr

    def _done(self, commands: str) -> subprocess.CompletedProcess[str]:
        script = commands.replace("sblcosim ", f"'{sys.executable}' -m sblcosim ")
        done = subprocess.run(
            ["sh", "-euc", script], cwd=self.folder, capture_output=True, text=True, check=False,
            env=os.environ | {"PYTHONPATH": str(self.package.parent), "MPLBACKEND": "Agg"},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done


@pytest.fixture
def copy(tmp_path: Path) -> Copy:
    return Copy(tmp_path)


def errors(copy: Copy, run: str) -> pd.DataFrame:
    return pd.read_parquet(copy.folder / "runs" / run / "errors.parquet")


def done(copy: Copy, title: str) -> str:
    (commands,) = copy.follow(recipe(title))
    return copy.run(commands)


def titles() -> list[str]:
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    return re.findall(r"^## (Add .*)$", text, flags=re.MULTILINE)


@pytest.mark.parametrize("title", titles())
def test_an_extension_is_one_file_and_at_most_one_line_elsewhere(title: str) -> None:
    languages = [language for language, _ in recipe(title)]
    assert languages.count("python") <= 1
    changes = [line for language, text in recipe(title) if language == "diff"
               for line in text.splitlines()[1:] if line[:1] in ("-", "+")]  # fmt: skip
    added = [line for line in changes if line.startswith("+")]
    assert len(added) <= MOST_LINES_ELSEWHERE
    assert len(changes) - len(added) <= len(added)


def with_documents(copy: Copy, text: str, *arguments: str) -> str:
    """What a program prints that also imports the extensions of the documents."""
    (copy.folder / "asked.py").write_text(text, "utf-8")
    path = f'PYTHONPATH="$PYTHONPATH{os.pathsep}{ROOT / "docs" / "extensions"}"'
    given = " ".join(map(shlex.quote, arguments))
    return copy.run(f"{path} '{sys.executable}' asked.py {given}")


SHORT = "sblcosim run harbour-square --no-figures --set time.duration_s=20"


def test_a_receiver(copy: Copy) -> None:
    done(copy, "Add a receiver")
    table = errors(copy, "direct")
    assert {"direct", "raw"} == set(table["receiver"])
    assert (table["n"] > 0).all()
    assert "direct" in copy.run("sblcosim receivers")


def test_an_error_of_the_ranges(copy: Copy) -> None:
    copy.run(f"{SHORT} --out runs/before")
    done(copy, "Add an error of the ranges")
    copy.run(f"{SHORT} --out runs/without")
    pd.testing.assert_frame_equal(errors(copy, "before"), errors(copy, "without"))
    assert errors(copy, "bubbles")["rms_m"].mean() > errors(copy, "without")["rms_m"].mean()
    # The bound says that it knows nothing of it, and the budget switches it.
    said = copy.run(f"{SHORT} --set acoustics.bubble_excess_m=5 --out runs/said")
    assert "acoustics.bubble_excess_m" in said
    known = "from sblcosim.scenario.error_sources import SOURCES; print(SOURCES['bubbles'].words)"
    assert copy.run(f"'{sys.executable}' -c \"{known}\"") == "the bubbles\n"


def test_a_trajectory(copy: Copy) -> None:
    done(copy, "Add a trajectory")
    # At the default of 45 degrees the course is sqrt(2) times as long as its progress.
    record = pd.read_parquet(copy.folder / "runs" / "zigzag" / "record.parquet")
    north = record["target.position[1]"].to_numpy()
    east = record["target.position[2]"].to_numpy()
    steps = np.hypot(np.diff(north), np.diff(east))
    assert steps.sum() > 1.3 * np.hypot(north[-1] - north[0], east[-1] - east[0]) > 1.0
    # Its own parameter is a key, and what has no effect with it is known.
    own = "--set target.trajectory=zigzag --set target.zigzag_angle_deg=10"
    idle = copy.warned(f"{SHORT} {own} --set target.radius_m=3 --out runs/idle")
    assert "target.radius_m" in idle or "radius_m" in idle
    assert "zigzag_angle_deg" not in idle


def further(copy: Copy) -> list[str]:
    """The table of responses and figures in the documents."""
    text = "import declarations, json; print(json.dumps([*declarations.further()]))"
    rows: list[str] = json.loads(with_documents(copy, text))
    return rows


def test_a_response(copy: Copy) -> None:
    done(copy, "Add a response")
    (row,) = [one for one in further(copy) if "settled_s" in one]
    assert row == "* - `settled_s`\n  - a response\n  - time until the error stays below 1 m"
    table = pd.read_parquet(copy.folder / "studies" / "mine" / "runs.parquet")
    (column,) = [c for c in table if c.endswith(".settled_s")]
    assert 0.0 <= table[column][0] <= 20.0


def test_a_figure(copy: Copy) -> None:
    done(copy, "Add a figure")
    (row,) = [one for one in further(copy) if "depth" in one]
    assert row == "* - `depth`\n  - a figure of a run\n  - True depth of the target"
    names = {p.name for p in (copy.folder / "runs" / "figure").iterdir()}
    assert {"depth.svg", "depth.png", "errors.svg"} <= names


SHOW = """
import json, sys
import sblcosim
from declarations import columns

run = sblcosim.run("harbour-square", overrides={"time.duration_s": 20.0})
print(json.dumps({
    "frame": run.errors["median_m"].to_list(), "html": run._repr_html_(), "text": str(run),
    "reference": [line for line in columns("errors") if "median_m" in line],
}))
"""


def test_a_column_of_the_table_of_errors(copy: Copy) -> None:
    title = "Add a column to the table of errors"
    edits = [text for language, text in recipe(title) if language == "diff"]
    assert len(edits) == 1
    text = done(copy, title)
    assert re.search(r"^receiver +axis +mean +RMS +std +median$", text, re.MULTILINE)
    table = errors(copy, "median")
    assert table.columns.to_list()[-2:] == ["median_m", "n"]
    estimates = pd.read_parquet(copy.folder / "runs" / "median" / "estimates.parquet")
    of_raw = estimates.loc[estimates["receiver"] == "raw", "error_total_m"]
    total = table.set_index(["receiver", "frame", "axis"])["median_m"]["raw", "absolute", "total"]
    assert total == np.median(of_raw)

    short = SHORT.replace("harbour-square", "harbour-square --json")
    printed = json.loads(copy.run(f"{short} --out runs/json"))
    assert printed["errors"]["raw"]["absolute"]["total"]["median_m"] == total
    part = json.loads(copy.run("sblcosim schema run.json"))["$defs"]["Statistics"]
    assert part["properties"]["median_m"]["description"] == "Median; for total, of the length"
    assert "median_m" in part["required"]

    shown = json.loads(with_documents(copy, SHOW))
    assert shown["frame"] == table["median_m"].to_list()
    assert "<th>median_m</th>" in shown["html"]
    assert f" {total:.3f}" in shown["text"]
    (row,) = shown["reference"]
    assert row == "* - `median_m`\n  - m\n  - Median; for total, of the length"


def test_a_command(copy: Copy) -> None:
    assert done(copy, "Add a command") == "4 beacons\n"
    assert "how many beacons" in copy.run("sblcosim --help")
    pages = with_documents(copy, "import declarations; print(*declarations.command_pages())")
    assert "## beacons" in pages


def test_a_grade(copy: Copy) -> None:
    done(copy, "Add a grade of a sensor")
    text = (copy.folder / "runs" / "survey" / "scenario.toml").read_text("utf-8")
    assert "gps_horizontal_std_m = 0.0015" in text


SAID = """
import json, sys
import declarations
from sblcosim.cli import completion
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
        "reference": "\\n".join(declarations.entries(table)),
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
        "reference": f"{{scenario-key}} {key}\\n" in "\\n".join(declarations.entries(table)),
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
    "Add a content of packets": ("acoustics.packet_content", "own_and_pose", "own_andpose"),
    "Add a grade of a sensor": ("platform.gps_grade", "survey", "survy"),
    "Add a key that sets others": ("target.depth_grade", "needle", "nedle"),
}
"""Recipes that add a value of a key: the key, the value, and one that is nearly it."""
NEW_KEYS = ("acoustics.bubble_excess_m", "target.zigzag_angle_deg", "target.depth_grade")


@pytest.fixture(scope="module")
def all_of_them(tmp_path_factory: pytest.TempPathFactory) -> Copy:
    """A copy with all that adds a value of a key, and a system to begin with: one build of FMUs."""
    made = Copy(tmp_path_factory.mktemp("all"))
    for title in (*KNOWN, "Add an error of the ranges", "Add a system to begin with"):
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
        _, _, entry = said["reference"].partition(f":::{{scenario-key}} {key}\n")
        assert re.search(rf"\b{value}\b", entry.partition("\n:::\n")[0])
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


def test_a_schedule_and_a_content_run_as_they_are_said(all_of_them: Copy) -> None:
    for title in ("Add a schedule", "Add a content of packets"):
        (commands,) = [text for language, text in recipe(title) if language == "sh"]
        all_of_them.run(commands)
    page = all_of_them.run(
        f"'{sys.executable}' -c \"from sblcosim.models import COMPONENTS\n"
        "for v in COMPONENTS['acoustics']: print(v.legend)\""
    )
    assert "90 pairs" in page
    assert "one beacon pings in each slot, all, or two" in page


def test_a_key_that_sets_others(all_of_them: Copy) -> None:
    (commands,) = [text for language, text in recipe("Add a key that sets others")
                   if language == "sh"]  # fmt: skip
    all_of_them.run(commands)
    text = (all_of_them.folder / "runs" / "gauge" / "scenario.toml").read_text("utf-8")
    assert "depth_std_m = 0.2" in text
    assert "depth_bias_std_m = 0.5" in text


def test_a_system_to_begin_with(all_of_them: Copy) -> None:
    (commands,) = [text for language, text in recipe("Add a system to begin with")
                   if language == "sh"]  # fmt: skip
    all_of_them.run(commands)
    assert (all_of_them.folder / "raft.toml").is_file()
    help_ = "COLUMNS=200 sblcosim new --help"
    assert "raft|water-linked" in all_of_them.run(help_)
    told = with_documents(all_of_them, "import declarations\n"
                          "from sblcosim.cli import completion\n"
                          "print(*declarations.likes(), *completion.likes('ra'))")  # fmt: skip
    assert "* - `raft`\n  - a raft in a harbour (`harbour-square`)" in told
    assert "('raft', 'a raft in a harbour')" in told


def test_a_block_that_no_longer_fits_is_noticed() -> None:
    with pytest.raises(AssertionError, match="must be there once, is there 0 times"):
        changed("a\nb\n", ["-c", "+d"])
    assert changed("a\nb\n", [" a", "-b", "+d"]) == "a\nd\n"

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
    """What a program prints that also imports what makes the reference."""
    (copy.folder / "asked.py").write_text(text, "utf-8")
    path = f'PYTHONPATH="$PYTHONPATH{os.pathsep}{ROOT / "tools"}"'
    given = " ".join(map(shlex.quote, arguments))
    return copy.run(f"{path} '{sys.executable}' asked.py {given}")


SHORT = "sblcosim run harbour-square --no-figures --set time.duration_s=20"


def test_a_receiver(copy: Copy) -> None:
    done(copy, "Add a receiver")
    table = errors(copy, "direct")
    assert {"direct", "raw"} == set(table["receiver"])
    assert (table["n"] > 0).all()
    assert "direct" in copy.run("sblcosim receivers")


@pytest.mark.slow
def test_an_error_of_the_ranges(copy: Copy) -> None:
    copy.run(f"{SHORT} --out runs/before")
    done(copy, "Add a range error")
    copy.run(f"{SHORT} --out runs/without")
    pd.testing.assert_frame_equal(errors(copy, "before"), errors(copy, "without"))
    assert errors(copy, "bubbles")["rms_m"].mean() > errors(copy, "without")["rms_m"].mean()
    # The bound says that it knows nothing of it, and the budget switches it.
    said = copy.run(f"{SHORT} --set acoustics.bubble_excess_m=5 --out runs/said")
    assert "acoustics.bubble_excess_m" in said
    known = "from sblcosim.scenario.error_sources import SOURCES; print(SOURCES['bubbles'].words)"
    assert copy.run(f"'{sys.executable}' -c \"{known}\"") == "the bubbles\n"


@pytest.mark.slow
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
    text = "import reference, json; print(json.dumps([*reference.further()]))"
    rows: list[str] = json.loads(with_documents(copy, text))
    return rows


@pytest.mark.slow
def test_a_response(copy: Copy) -> None:
    done(copy, "Add a response")
    (row,) = [one for one in further(copy) if "settled_s" in one]
    assert row == "| `settled_s` | a response | time until the error stays below 1 m |"
    table = pd.read_parquet(copy.folder / "studies" / "mine" / "runs.parquet")
    (column,) = [c for c in table if c.endswith(".settled_s")]
    assert 0.0 <= table[column][0] <= 20.0


@pytest.mark.slow
def test_a_figure(copy: Copy) -> None:
    done(copy, "Add a figure")
    (row,) = [one for one in further(copy) if "depth" in one]
    assert row == "| `depth` | a figure of a run | True depth of the target |"
    names = {p.name for p in (copy.folder / "runs" / "figure").iterdir()}
    assert {"depth.svg", "depth.png", "errors.svg"} <= names


SHOW = """
import json, sys
import sblcosim
from reference import columns

run = sblcosim.run("harbour-square", overrides={"time.duration_s": 20.0})
print(json.dumps({
    "frame": run.errors["median_m"].to_list(), "html": run._repr_html_(),
    "text": run.text(verbose=True),
    "reference": [line for line in columns("sblcosim.judge.columns.ERRORS") if "median_m" in line],
}))
"""


@pytest.mark.slow
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
    assert part["properties"]["median_m"]["description"] == "Median; of the length for the total"
    assert "median_m" in part["required"]

    shown = json.loads(with_documents(copy, SHOW))
    assert shown["frame"] == table["median_m"].to_list()
    assert "<th>median_m</th>" in shown["html"]
    assert f" {total:.3f}" in shown["text"]
    (row,) = shown["reference"]
    assert row == "| `median_m` | m | Median; of the length for the total |"


@pytest.mark.slow
def test_a_command(copy: Copy) -> None:
    assert done(copy, "Add a command") == "4 beacons\n"
    assert "how many beacons" in copy.run("sblcosim --help")
    pages = with_documents(copy, "import reference; print(*reference.command_pages())")
    assert "## beacons" in pages


@pytest.mark.slow
def test_a_grade(copy: Copy) -> None:
    done(copy, "Add a grade of a sensor")
    text = (copy.folder / "runs" / "survey" / "scenario.toml").read_text("utf-8")
    assert "gps_horizontal_std_m = 0.0015" in text


def test_a_block_that_no_longer_fits_is_noticed() -> None:
    with pytest.raises(AssertionError, match="must be there once, is there 0 times"):
        changed("a\nb\n", ["-c", "+d"])
    assert changed("a\nb\n", [" a", "-b", "+d"]) == "a\nd\n"

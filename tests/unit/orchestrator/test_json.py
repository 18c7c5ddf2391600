"""What commands print with --json, against the schema that `sblcosim schema` prints."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import log_samples
import made_logs
import pytest
import sblcosim.cli
import typer.main
from quick import one_in
from sblcosim.cli.documents.by_command import COMMANDS, DOCUMENTS
from sblcosim.fmus.build.factory import build
from sblcosim.models import RECEIVERS
from sblcosim.scenario.scenario import shipped
from typer.testing import CliRunner, Result

SHORT = ("--set", "time.duration_s=5", "--no-figures")
STUDY = """
scenario = "paper-scenario-1"
receivers = ["ekf", "coupled"]
replicates = 2
[fixed]
"time.duration_s" = 5.0
[factors.gps]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]
[factors.range]
keys = ["acoustics.range_std_m"]
levels = [0.1, 0.2]
"""


def cli(*arguments: object) -> Result:
    return CliRunner().invoke(
        sblcosim.cli.app, [str(a) for a in arguments], catch_exceptions=False
    )


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run, a study and a sweep."""
    folder = tmp_path_factory.mktemp("json")
    (folder / "s.toml").write_text(STUDY)
    sweep = STUDY[: STUDY.index("[factors.range]")]
    (folder / "sweep.toml").write_text(f"{sweep}\n[design]\nkind = 'sweep'")
    (folder / "costs.toml").write_text("gps = [900, 40]\n")
    made_logs.in_folder(folder / "made-log")
    (folder / "dive.nmea").write_text(log_samples.nmea()["dive.nmea"])
    (folder / "q.toml").write_text(QUESTION)
    for name in ("s", "sweep"):
        assert cli("study", folder / f"{name}.toml", "--out", folder / name).exit_code == 0
    done = cli("run", "paper-scenario-1", *SHORT, "--receiver", "coupled", "--out", folder / "run")
    assert done.exit_code == 0
    heard = ("--set", "time.duration_s=60", "--no-figures", "--out", folder / "heard")
    assert cli("run", "harbour-lbl", *heard).exit_code == 0
    return folder


QUESTION = """
scenario = "paper-scenario-1"
response = "total_rms_m"
limit = 30.0
share = 0.5
most_runs = 400
settling_time_s = 2.0
[fixed.time]
duration_s = 8.0
[choices.arm]
keys = ["platform.arm_length_m"]
levels = [0.4, 3.0]
costs = [1, 2]
"""


def run_id(place: Path) -> str:
    return str(sblcosim.study.store.table(place / "s")["run_id"].iloc[0])


CASES: dict[str, Callable[[Path], tuple[Any, ...]]] = {
    "run": lambda at: (
        "run", "paper-scenario-1", *SHORT, "--receiver", "coupled", "--out", at / "r",
    ),
    "run without estimates": lambda at: (
        "run", "harbour-square", "--set", "acoustics.loss_probability=1", *SHORT, "--out", at / "n",
    ),
    "runs": lambda at: ("run", "harbour-square", *SHORT, "--runs", "2", "--out", at / "many"),
    "runs of nobody": lambda at: (
        "run", "harbour-square", "--set", "acoustics.loss_probability=1", *SHORT, "--runs", "2",
        "--out", at / "nobody",
    ),
    "compare": lambda at: (
        "compare", "harbour-square", "paper-scenario-1", "--receiver", "ekf", "--receiver",
        "coupled", *SHORT, "--runs", "2", "--practical", "0.1", "--out", at / "compared",
    ),
    "smooth": lambda at: ("smooth", at / "run", "--no-figures", "--out", at / "smoothed"),
    "identify": lambda at: ("identify", at / "heard", "--no-figures", "--out", at / "device"),
    "replay": lambda at: ("replay", at / "s", run_id(at), "--no-figures", "--out", at / "again"),
    "plan": lambda at: ("plan", "paper-scenario-1", "--receiver", "sequential"),
    "calibrate": lambda at: ("calibrate", "--out", at / "calibration"),
    "process": lambda at: (
        "process", at / "made-log", "--receiver", "long_baseline", "--no-figures", "--smooth",
        "--out", at / "processed",
    ),
    "log": lambda at: ("log", at / "dive.nmea", "--out", at / "log"),
    "distances": lambda at: (
        "map", "realistic-dive", "--distance", "40", "--depth", "5", "--cells", "3", "--runs", "2",
        "--duration", "10", "--settling", "5", "--limit", "3", "--no-figures", "--out",
        at / "distances",
    ),
    "map": lambda at: (
        "map", "realistic-dive", "--area", "40x40", "--depth", "5", "--cells", "3", "--runs", "2",
        "--duration", "10", "--settling", "5", "--limit", "3", "--no-figures", "--out", at / "map",
    ),
    "scenarios": lambda at: ("scenarios",),
    "receivers": lambda at: ("receivers",),
    "studies": lambda at: ("studies",),
    "study": lambda at: ("study", at / "s.toml", "--out", at / "s"),
    "study to be run": lambda at: ("study", at / "s.toml", "--out", at / "no", "--dry-run"),
    "analyse": lambda at: ("analyse", at / "s", "--practical", "0.5"),
    "analyse logarithms": lambda at: ("analyse", at / "s", "--transform", "log"),
    "analyse a sweep": lambda at: ("analyse", at / "sweep"),
    "advise": lambda at: (
        "advise", at / "s", "--costs", at / "costs.toml", "--limit", "1", "--response",
        "absolute_total_rms_m",
    ),
    "budget": lambda at: (
        "budget", "paper-scenario-1", *SHORT, "--runs", "30", "--out", at / "budget",
    ),
    "questions": lambda at: ("questions",),
    "require": lambda at: ("require", at / "q.toml", "--out", at / "q"),
    "require undecided": lambda at: (
        "require", at / "q.toml", "--out", at / "few", "--most-runs", "5",
    ),
    "check": lambda at: ("check", build("platform")),
    "conformance": lambda at: ("conformance", build("target"), "--check", "description"),
}  # fmt: skip


FAILING = {"run without estimates", "runs of nobody", "check", "advise", "require undecided"}
"""Cases that end with exit code 1."""


def names(node: Any) -> set[str]:
    """All keys with a meaning that a document may have."""
    return {key for key in node if not key.startswith("$")}


@pytest.mark.parametrize("case", CASES)
@one_in(2)
def test_what_is_printed_is_what_its_schema_says(case: str, place: Path) -> None:
    command = case.split()[0]
    schema = json.loads(cli("schema", f"{command}.json").stdout)
    jsonschema.Draft202012Validator.check_schema(schema)
    done = cli(*CASES[case](place), "--json")
    assert done.exit_code == (case in FAILING)
    content = json.loads(done.stdout, parse_constant=lambda word: pytest.fail(f"got {word}"))
    assert done.stdout.isascii()
    jsonschema.Draft202012Validator(schema).validate(content)
    assert names(content) == names(schema["properties"])
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.Draft202012Validator(schema).validate(content | {"more": 1})


def test_every_command_with_json_has_a_schema_and_a_case() -> None:
    root: Any = typer.main.get_command(sblcosim.cli.app)
    with_json = {
        name for name, command in root.commands.items()
        if any("--json" in parameter.opts for parameter in command.params)
    }
    assert {COMMANDS[it].split()[0] for it in DOCUMENTS} == with_json
    assert set(DOCUMENTS) == set(COMMANDS) == {case.split()[0] for case in CASES}


def test_lists_name_what_there_is() -> None:
    found = json.loads(cli("scenarios", "--json").stdout)["scenarios"]
    assert [entry["name"] for entry in found] == list(shipped())
    entries = json.loads(cli("receivers", "--json").stdout)["receivers"]
    assert [entry["name"] for entry in entries] == list(RECEIVERS)
    assert "gate" in next(e["keys"] for e in entries if e["name"] == "sequential")


def test_a_study_says_what_came_out_and_what_is_missing(place: Path) -> None:
    there = json.loads(cli(*CASES["study"](place), "--json").stdout)
    runs = sblcosim.study.store.table(place / "s")
    assert (there["runs"], there["finished"], there["failed"]) == (8, 8, 0)
    assert there["estimate"] is None
    column = runs["coupled.absolute_total_rms_m"]
    pooled = (column**2).mean() ** 0.5  # over runs
    assert there["receivers"]["coupled"]["rms_m"] == pytest.approx(pooled, rel=1e-12)
    own = there["receivers"]["coupled"]["covariances"]["own_relative"]
    assert own["points"] == 4 == own["in_band"] + own["optimistic"] + own["pessimistic"]
    assert set(there["receivers"]["ekf"]["covariances"]) == {"absolute"}
    still = json.loads(cli(*CASES["study to be run"](place), "--json").stdout)
    assert (still["runs"], still["finished"], still["receivers"]) == (8, 0, {})
    assert still["estimate"]["steps"] == 8 * 50
    assert still["estimate"]["seconds_from"] >= 0


def test_a_study_says_the_share_of_inconsistent_runs_if_asked(place: Path) -> None:
    runs = sblcosim.study.store.table(place / "s")
    lines = cli(*CASES["study"](place), "--verbose").stdout.splitlines()
    for name in ("ekf", "coupled"):
        share = float(runs[f"{name}.inconsistent"].astype(float).mean())
        said = next(i for i, line in enumerate(lines) if line.startswith(f"{name}: "))
        assert lines[said + 1] == f"  {100 * share:.0f} % of its runs inconsistent"
    assert "inconsistent" not in cli(*CASES["study"](place)).stdout


def test_an_analysis_names_effects_and_means(place: Path) -> None:
    effects = json.loads(cli(*CASES["analyse"](place), "--json").stdout)
    assert effects["effects"][0]["term"] == "gps"
    sizes = [abs(effect["effect"]) for effect in effects["effects"]]
    assert sizes == sorted(sizes, reverse=True)
    limit = 0.5
    for effect in effects["effects"]:
        low, high = effect["low"], effect["high"]
        apart, within = low >= limit or high <= -limit, -limit < low and high < limit
        verdict = "matters" if apart else "too small" if within else "undecided"
        assert effect["verdict"] == verdict
    assert effects["means"] == []
    means = json.loads(cli(*CASES["analyse a sweep"](place), "--json").stdout)
    assert [(mean["factor"], mean["value"]) for mean in means["means"]] == [
        ("gps", 0.1), ("gps", 3.5),
    ]  # fmt: skip
    assert means["effects"] == []


def test_advice_has_no_bound_where_there_are_too_few_runs(place: Path) -> None:
    advice = json.loads(cli(*CASES["advise"](place), "--json").stdout)
    assert advice["chosen"] is None
    assert {point["upper"] for point in advice["points"]} == {None}
    assert [set(point["levels"]) for point in advice["points"]] == [{"gps", "range"}] * 4
    assert advice["free"] == ["range"]
    assert advice["beside"]["percentile"] is None
    assert advice["beside"]["answer"] != advice["answer"]


def test_a_plan_names_its_components_and_connections() -> None:
    plan = json.loads(cli("plan", "paper-scenario-1", "--json").stdout)
    assert [c["name"] for c in plan["components"]] == [
        "target", "platform", "acoustics", "ekf", "raw",
    ]  # fmt: skip
    assert {"source": "acoustics.range", "target": "ekf.range"} in plan["connections"]
    values = {p["name"]: p["values"] for p in plan["parameters"]}
    assert values["target.speed"] == [0.5]
    assert plan["stop_s"] == pytest.approx(math.pi * 15 / 0.5, abs=0.1)


def test_schemas_are_listed_and_a_wrong_name_is_one_line() -> None:
    listed = [line.split()[0] for line in cli("schema").stdout.splitlines()]
    printed = [f"{command}.json" for command in DOCUMENTS]
    assert listed == ["scenario", "study", "question", *printed]
    wrong = cli("schema", "rum.json")
    assert (wrong.exit_code, wrong.stdout) == (2, "")
    assert wrong.stderr.startswith(
        "error: schema: must be scenario or study or question or run.json or "
    )
    assert wrong.stderr.endswith("got 'rum.json'; did you mean 'run.json'?\n")


def test_what_a_receiver_prints_is_no_json(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("chatty.py").write_text(
        "import sblcosim\n\nclass Chatty(sblcosim.Receiver):\n    def update(self, samples):\n"
        "        print('here')\n        here = self.fix(samples)\n"
        "        return None if here is None else sblcosim.Estimate(samples[-1].epoch, here)\n"
    )
    asked = "run realistic-dive --receiver chatty.py --set time.duration_s=20 --no-figures --json"
    command = [sys.executable, "-m", "sblcosim", *asked.split()]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "here" in done.stderr
    assert "Chatty" in json.loads(done.stdout)["errors"]

"""The conformance kit: it passes our FMUs and finds what is planted in others."""

from __future__ import annotations

import importlib.util
import json
import re
import shlex
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from quick import one_in
from sblcosim.cli import app
from sblcosim.errors import FmuError
from sblcosim.fmus.build import factory
from sblcosim.fmus.conformance import kit
from sblcosim.fmus.conformance.bench import REALS, STILL, stimulus
from sblcosim.fmus.conformance.checks import CHECKS
from sblcosim.fmus.conformance.kit import CheckResult, Report, examine
from sblcosim.fmus.conformance.subject import SubjectVariable
from sblcosim.fmus.host.instances import acquire
from sblcosim.fmus.read.ports import read
from sblcosim.models import COMPONENTS, RECEIVERS
from typer.testing import CliRunner

from .planted.planted import DEFECTS, build_planted
from .stranger.stranger import build_stranger

BOTH = pytest.mark.parametrize("fmi", [2, 3])
pytestmark = [
    pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler"),
    pytest.mark.usefixtures("only_hangs_take_time"),
]


def test_the_summary_counts_in_words_that_fit_the_number() -> None:
    def outcomes(*states: Any) -> Report:
        results = [CheckResult(str(n), "", state, "", "", "") for n, state in enumerate(states)]
        return Report(Path("x.fmu"), "2.0", tuple(results))

    one = outcomes("passed", "warning", "does not apply", "not run")
    assert one.summary == "x.fmu, FMI 2.0: 1 passed, 1 warning, 1 does not apply, 1 not run"
    two = outcomes(*("passed", "warning", "does not apply", "not run") * 2)
    assert two.summary == "x.fmu, FMI 2.0: 2 passed, 2 warnings, 2 do not apply, 2 not run"


def test_inputs_differ_from_step_to_step_by_element_and_by_instance() -> None:
    u = SubjectVariable("u", 1, "Float64", "input", "continuous", 2, (0.0, 50.0), None, None, "m",
                        False, False)  # fmt: skip
    subject: Any = SimpleNamespace(start=0.0, step=0.1, of=lambda _: [u])

    def values(step: int, number: int = 0) -> list[float]:
        [(_, given)] = stimulus(subject, REALS, step, number)
        return given

    rows = [values(step, number) for step in range(4) for number in range(2)]
    for start, column in zip((0.0, 50.0), zip(*rows, strict=True), strict=True):
        assert len(set(column)) == len(rows)
        assert all(abs(value - start) <= max(0.1 * start, 1.0) for value in column)
    assert all((b - 50) / 5 != a for a, b in rows)
    assert [*stimulus(subject, STILL, 1)] == []


def of(report: Report, *states: str) -> set[str]:
    return {result.name for result in report.results if result.state in states}


def failed(report: Report) -> set[str]:
    return of(report, "failed")


def found(report: Report) -> set[str]:
    return of(report, "failed", "warning")


def others(report: Report) -> set[str]:
    """The checks that did not apply or were not run."""
    return of(report, "does not apply", "not run")


OFTEN = {("platform", 2), ("ekf", 3)}
"""What every run of the tests examines."""


@pytest.mark.parametrize(
    ("name", "fmi"),
    [pytest.param(name, fmi, marks=[] if (name, fmi) in OFTEN else pytest.mark.slow)
     for name in COMPONENTS for fmi in (2, 3)],
)  # fmt: skip
def test_own_fmus_keep_every_promise(name: str, fmi: int) -> None:
    report = examine(factory.build(name, fmi))  # type: ignore[arg-type]
    assert found(report) == set(), str(report)
    expected = set() if name in RECEIVERS else {"plug contract"}
    if name != "range_model":
        expected |= {"derivatives"}
    assert others(report) == expected
    # Nothing is shown by runs in which nothing happens.
    assert " 0 of " not in report["life cycle"].reason


@BOTH
@one_in(2)
def test_the_fmu_without_a_defect_passes_everything(fmi: int, tmp_path: Path) -> None:
    report = examine(build_planted(fmi, tmp_path))
    assert {r.state for r in report.results} == {"passed"}, str(report)
    assert {r.name for r in report.results} >= {c.name for c in CHECKS}


FOUND: dict[str, tuple[str, str]] = {
    "STATE_NOT_RESTORED": ("save and restore", "after going back: position[1] must be"),
    "SHARED_GLOBAL": ("instances", "a second instance: position[1] must be 0 at 0 s"),
    "WRONG_DERIVATIVE": ("derivatives", "derivative of position[3] along depth"),
    "CRASH_ON_NULL": ("null pointers", "with NULL for the values"),
    "LEAK": ("leaks", "each of 10,000 instances leaves"),
    "RESET_FORGETS": ("reset", "a reset half-way: position[1]"),
    "STEP_SIZE_MATTERS": ("step sizes", "cut into 2: position[1]"),
    "POINTER_IN_STATE": ("new process", ""),
    "CRASH_OUT_OF_ORDER": ("illegal calls", "in a step before initialisation"),
    "CRASH_ON_REFERENCE": ("unknown references", "of 2147483647"),
    "HANG_ON_NAN": ("invalid values", "has not returned after 2 s from depth = nan"),
    "FUNCTION_MISSING": ("functions", "FMU"),
    "THREADS_CLASH": ("threads", "4 threads at once: position[1]"),
    "STATE_NOT_OVERWRITTEN": (
        "save and restore", "going back to an overwritten copy: position[1] must be",
    ),
    "DERIVATIVE_A_BIT_OFF": ("derivatives", "derivative of position[3] along depth"),
    "ONLY_ONCE": ("life cycle", "crashes (SIGABRT) in fmi"),
    "CRASH_ON_RESET": (
        "illegal calls",
        "crashes (SIGABRT) in a reset before initialisation, a reset during initialisation",
    ),
    "EXITS": ("life cycle", "ends the process (exit code 0x3) in fmi"),
    "ANY_REFERENCE": ("unknown references", "accepts fmi"),
    "ANY_OF_STRINGS": ("unknown references", "GetString of 2147483647, which is no String"),
    "WARNS_OF_REFERENCES": ("unknown references", "accepts fmi"),
    "HIDDEN_REFERENCE": ("unknown references", "of 8, which is no "),
    "ANY_TOKEN": (
        "illegal calls",
        "accepts instantiation with a wrong token, instantiation with an empty token",
    ),
    "ANY_EMPTY_TOKEN": ("illegal calls", "accepts instantiation with an empty token"),
    "OUTPUT_IS_SET": ("illegal calls", "accepts setting position[1] between steps"),
    "ABORTS_SAYING": (
        "life cycle", "(no licence for 'planted': server 27000@keys.example, error -15.5, 100%)",
    ),
    "SAYS_MORE": (
        "life cycle",
        "got Error: many: -1 of 2, 3.14|42 |0007, ff z 1.234568e+04 0.5 -9000000000 11 abc % 5 2.2 "
        "0x10",
    ),
    "SAYS_WRONG": ("life cycle", "\N{REPLACEMENT CHARACTER} 100% sure\\x1b "),
}  # fmt: skip
"""By defect: the check that finds it, and a part of the reason."""
ALSO: dict[str, set[str]] = {
    "STATE_NOT_RESTORED": {"serialise", "new process"},
    "SHARED_GLOBAL": {
        "reset", "save and restore", "serialise", "new process", "step sizes", "threads",
    },
    "FUNCTION_MISSING": {
        "save and restore", "serialise", "new process", "illegal calls", "null pointers", "leaks",
    },
}  # fmt: skip
"""Other checks that may find some of them."""

LAWFUL = {
    "CRASH_ON_NULL": (2, 3),
    "STEP_SIZE_MATTERS": (2, 3),
    "CRASH_OUT_OF_ORDER": (2, 3),
    "HANG_ON_NAN": (2, 3),
    "CRASH_ON_REFERENCE": (3,),
    "THREADS_CLASH": (3,),
    "ANY_REFERENCE": (3,),
    "ANY_OF_STRINGS": (3,),
    "WARNS_OF_REFERENCES": (3,),
    "HIDDEN_REFERENCE": (2, 3),
    "ANY_TOKEN": (2, 3),
    "ANY_EMPTY_TOKEN": (2, 3),
    "OUTPUT_IS_SET": (2, 3),
}
"""Defects that hurt and do not violate these versions of the standard."""

ASKED = {"STATE_NOT_RESTORED", "SHARED_GLOBAL", "WRONG_DERIVATIVE", "CRASH_ON_NULL", "LEAK"}
"""Defects that are planted in FMUs of both versions and run through all checks of the binary."""
ALL = {check.name for check in CHECKS}


def test_every_planted_defect_has_a_finding() -> None:
    assert set(DEFECTS) == FOUND.keys() | {
        "NONE", "STEP_DISCARDED", "NEVER_THE_SAME", "NO_FATAL_END", "CONSTANT_IS_SET",
    } | BLOCKED.keys()  # fmt: skip


@pytest.mark.parametrize(
    ("defect", "fmi"),
    [
        pytest.param(
            d, fmi,
            marks=[] if fmi == 2 + i % 2 or len(LAWFUL.get(d, ())) == 1 else pytest.mark.slow,
        )
        for i, d in enumerate(FOUND)
        for fmi in (2, 3)
        if d in ASKED or len(LAWFUL.get(d, ())) == 1 or fmi == 2 + i % 2
    ],
)
@one_in(2)
def test_planted_defect_is_found(defect: str, fmi: int, tmp_path: Path) -> None:
    check, reason = FOUND[defect]
    others = ALSO.get(defect, set())
    patience = 2.0 if defect == "HANG_ON_NAN" else kit.PATIENCE
    only = ALL if defect in ASKED else {check, *others}
    report = examine(build_planted(fmi, tmp_path, defect), only=only, patience=patience)
    assert reason in report[check].reason, str(report)
    assert check in found(report) <= {check} | others, str(report)
    lawful = fmi in LAWFUL.get(defect, ())
    assert report[check].state == ("warning" if lawful else "failed"), str(report)
    edition = {2: "FMI 2.0.5, ", 3: "FMI 3.0.2, "}[fmi]
    assert report[check].clause.startswith("" if lawful else edition)
    assert bool(report[check].clause) != lawful


BLOCKED: dict[str, tuple[str, str]] = {
    "NO_LICENCE": (
        "life cycle",
        "a licence is missing: fmi{}Instantiate must succeed, got Error: no licence for 'planted': "
        "server 27000@keys.example, error -15.5, 100%",
    ),
    "SILENT": ("life cycle", "got Error: no licence for 'planted'"),
    "NO_SEAT": ("instances", "got Error: all 1 licences are in use"),
    "NO_MODULE": (
        "life cycle",
        "a Python module is missing: fmi{}EnterInitializationMode must succeed, got Error: "
        "ModuleNotFoundError: No module named 'scipy'",
    ),
}
"""What an FMU lacks, and no defect: the check that cannot be made, and a part of the reason."""


@one_in(2)
@pytest.mark.parametrize(("lacks", "fmi"), [(d, fmi) for d in BLOCKED for fmi in (2, 3)])
def test_what_the_machine_lacks_is_no_verdict(lacks: str, fmi: int, tmp_path: Path) -> None:
    check, reason = BLOCKED[lacks]
    fmu = build_planted(fmi, tmp_path, lacks)
    report = examine(fmu, only=["functions", "life cycle", "instances"])
    assert of(report, "blocked") == {check}, str(report)
    assert found(report) == set()
    assert reason.format(fmi) in report[check].reason
    code, text = call(fmu, "--check", check, "--strict")
    assert code == 2
    last = text.splitlines()[-1]
    assert last == f"error: {fmu}: must find here what it needs, got: {report[check].reason}"
    code, text = call(fmu, "--check", check, "--json")
    assert code == 2
    states = {c["name"]: c["state"] for c in json.loads(text[: text.rindex("}") + 1])["checks"]}
    assert states[check] == "blocked"


def missing_library(folder: Path) -> tuple[str, ...]:
    """A library to link with, which is gone afterwards."""
    folder.mkdir()
    command = ["cc", "-shared", "-fPIC", "-xc", "-", "-o", folder / "libgone_7.so"]
    subprocess.run(command, input=b"int gone(void) { return 1; }", check=True)
    return f"-L{folder}", "-Wl,--no-as-needed", "-lgone_7"


@pytest.mark.skipif(sys.platform != "linux", reason="libraries that need others, of Linux")
@BOTH
@one_in(2)
def test_a_library_of_the_system_that_is_missing_is_no_verdict(fmi: int, tmp_path: Path) -> None:
    options = missing_library(tmp_path / "gone")
    report = examine(build_planted(fmi, tmp_path, options=options))
    reason = "the library does not load here: it needs libgone_7.so, which is not on this machine"
    assert of(report, "blocked") == {"functions", "life cycle"}, str(report)
    assert found(report) == set()
    assert report.blocked == reason
    library = tmp_path / "gone" / "libgone_7.so"
    inside = build_planted(fmi, tmp_path / "in", options=options, more={library.name: library})
    report = examine(inside, only=["functions"])
    assert failed(report) == {"functions", "life cycle"}  # it is there, and is not found
    assert "libgone_7.so: cannot open shared object file" in report["functions"].reason


def test_a_failed_check_counts_more_than_what_is_missing(tmp_path: Path) -> None:
    fmu = build_planted(2, tmp_path, "NO_LICENCE", lambda text: text.replace('"m"', '"mm"', 1))
    code, text = call(fmu, "--check", "description", "--check", "life cycle")
    assert code == 1, text
    assert "1 failed, 1 blocked" in text


def test_a_tool_that_the_fmu_needs_may_be_missing(tmp_path: Path) -> None:
    def edit(text: str) -> str:
        return text.replace("<CoSimulation ", '<CoSimulation needsExecutionTool="true" ')

    report = examine(build_planted(2, tmp_path, "SAYS_MORE", edit), only=["life cycle"])
    assert of(report, "blocked") == {"life cycle"}
    assert "it needs a tool, which may be missing: fmi2Enter" in str(report.blocked)


@BOTH
def test_a_constant_that_can_be_set_is_found(fmi: int, tmp_path: Path) -> None:
    def edit(text: str) -> str:
        common = 'name="c" valueReference="9" causality="output" variability="constant"'
        constant = {
            2: f'<ScalarVariable {common} initial="exact"><Real start="1"/></ScalarVariable>',
            3: f'<Float64 {common} initial="exact" start="1"/>',
        }[fmi]
        output = {2: '<Unknown index="8"/></Outputs>', 3: '<Output valueReference="9"/>'}[fmi]
        text = text.replace("</ModelVariables>", f"{constant}</ModelVariables>")
        if fmi == 2:
            return text.replace("</Outputs>", output)
        return text.replace("<ModelStructure>", f"<ModelStructure>{output}")

    report = examine(build_planted(fmi, tmp_path, edit=edit), only=["illegal calls"])
    assert found(report) == set(), str(report)
    lax = build_planted(fmi, tmp_path / "lax", "CONSTANT_IS_SET", edit)
    report = examine(lax, only=["illegal calls"])
    assert (failed if fmi == 2 else found)(report) == {"illegal calls"}, str(report)
    assert report["illegal calls"].reason == "accepts setting the constant c"
    assert report["illegal calls"].clause == ("FMI 2.0.5, 2.1.2" if fmi == 2 else "")


def test_run_and_the_kit_say_the_same_of_a_message(tmp_path: Path) -> None:
    for defect in ("NO_LICENCE", "SAYS_MORE", "SAYS_WRONG"):
        fmu = build_planted(2, tmp_path / defect, defect)
        reason = examine(fmu, only=["life cycle"])["life cycle"].reason
        said = reason.partition("got Error: ")[2]
        if defect == "SAYS_WRONG":
            said = said.partition(" #1 ")[0]
            assert said.endswith("100% sure\\x1b depth")
        with pytest.raises(FmuError) as caught:
            acquire(read(fmu), "planted").initialise(0, [])
        assert said in str(caught.value)


@BOTH
def test_wrong_unit_is_found(fmi: int, tmp_path: Path) -> None:
    def edit(text: str) -> str:
        return "\n".join(
            line.replace('unit="m"', 'unit="mm"') if 'name="position' in line else line
            for line in text.splitlines()
        )

    report = examine(build_planted(fmi, tmp_path, edit=edit), only=["plug contract", "functions"])
    assert found(report) == {"plug contract"}
    assert report.ok  # the standard knows nothing of our contract
    assert report["plug contract"].reason == "position must be in m, got mm"


def test_a_crash_tells_the_signal_and_does_not_hide_the_next_one(tmp_path: Path) -> None:
    fmu = build_planted(2, tmp_path, "CRASH_ON_NULL")
    reason = examine(fmu, only=["null pointers"])["null pointers"].reason
    assert reason.startswith("crashes (SIGSEGV) in fmi2GetReal with NULL for the references, ")
    assert "fmi2SetReal" in reason


def test_steps_that_are_discarded_are_no_finding(tmp_path: Path) -> None:
    report = examine(build_planted(3, tmp_path, "STEP_DISCARDED"), only=["step sizes"])
    assert report.ok
    assert others(report) == {"step sizes"}
    assert "got Discard" in report["step sizes"].reason


def test_an_fmu_that_never_does_the_same_is_not_judged_by_it(tmp_path: Path) -> None:
    names = ("reset", "save and restore", "step sizes", "instances")
    report = examine(build_planted(2, tmp_path, "NEVER_THE_SAME"), only=names)
    assert report.ok
    for name in names:
        assert report[name].state == "does not apply"
        assert "in another process" in report[name].reason


def test_without_a_life_cycle_nothing_else_is_run(tmp_path: Path) -> None:
    report = examine(build_planted(2, tmp_path, "EXITS"))
    after = [c.name for c in CHECKS if c.name not in ("functions", "life cycle")]
    assert [r.name for r in report.results if r.state == "not run"] == after
    assert not report.ok


def test_what_is_not_claimed_does_not_apply(tmp_path: Path) -> None:
    flags = ("variable", "GetAndSet", "canSerialize", "providesDirectional")

    def edit(text: str) -> str:
        for flag in flags:
            head, _, tail = text.partition(f" {flag}" if flag != "variable" else " canHandle")
            if flag == "GetAndSet":
                head, _, tail = text.partition(" canGetAndSet")
            text = head + tail.split('"', 2)[2]
        return text

    names = {"save and restore", "serialise", "new process", "step sizes", "derivatives"}
    report = examine(build_planted(3, tmp_path, edit=edit), only={*names, "illegal calls"})
    assert report.ok
    assert others(report) == names


@BOTH
@one_in(2)
def test_an_fmu_of_a_stranger_is_judged_by_what_it_does(fmi: int, tmp_path: Path) -> None:
    """The stranger of the other tests checks no pointer and counts its steps."""
    report = examine(build_stranger(fmi, tmp_path))
    assert report.ok, str(report)
    assert found(report) >= {"null pointers", "step sizes"}
    assert "steps must be" in report["step sizes"].reason
    for name in ("life cycle", "reset", "instances", "threads", "leaks"):
        assert report[name].state == "passed", str(report)


def test_an_fmu_of_pythonfmu_is_judged_by_what_it_does(tmp_path: Path) -> None:
    """Its library crashes on null pointers and keeps every instance for good."""
    source = Path(__file__).parents[2] / "examples" / "receiver_in_python.py"
    command = [sys.executable, "-m", "pythonfmu", "build", "-f", source]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    names = ["plug contract", "reset", "serialise", "instances", "threads", "null pointers"]
    report = examine(tmp_path / "LinearFix.fmu", only=names)
    assert report.ok, str(report)
    assert found(report) == {"null pointers"}, str(report)
    assert others(report) == {"serialise"}


def test_an_invalid_description_is_found_by_both_validators(tmp_path: Path) -> None:
    def edit(text: str) -> str:
        return text.replace('causality="output" variability="discrete"', 'causality="output"')

    report = examine(build_planted(2, tmp_path, edit=edit), only=["description", "fmutool"])
    assert failed(report) == {"description"}
    assert found(report) == {"description", "fmutool"}
    assert report["description"].clause == "FMI 2.0.5, 2.2"
    assert "update_count" in report["description"].reason
    assert "update_count" in report["fmutool"].reason


def test_without_fmutool_its_check_is_not_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    report = examine(build_planted(2, tmp_path), only=["fmutool"])
    assert report["fmutool"].state == "not run"
    assert "pip install fmu-manipulation-toolbox" in report["fmutool"].reason
    assert report.ok


@pytest.mark.parametrize(("module", "foreign"), [
    ("kit", {"casadi"}),
    ("child", {"casadi", "numpy", "fmpy", "sblcosim.models"}),
])  # fmt: skip
def test_the_kit_loads_little(module: str, foreign: set[str]) -> None:
    code = (
        f"import sys, sblcosim.fmus.conformance.{module}; "
        f"sys.exit(str({foreign} & sys.modules.keys() or ''))"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True)
    assert done.stderr.strip() == b""


@pytest.mark.parametrize(
    ("fmi", "only"),
    [(2, ["life cycle", "reset", "instances", "threads", "invalid values"]),
     pytest.param(2, None, marks=pytest.mark.slow), pytest.param(3, None, marks=pytest.mark.slow)],
)  # fmt: skip
def test_an_fmu_that_allows_one_instance_gets_one_a_process(
    fmi: int, only: list[str] | None, tmp_path: Path
) -> None:
    def edit(text: str) -> str:
        flag = 'canBeInstantiatedOnlyOncePerProcess="true"'
        return text.replace("<CoSimulation ", f"<CoSimulation {flag} ")

    report = examine(build_planted(fmi, tmp_path, "ONLY_ONCE", edit=edit), only=only)
    assert found(report) == set(), str(report)
    assert others(report) == {"instances", "threads", "leaks"} & {*(only or kit.NAMES)}
    assert "calls answered" in report["invalid values"].reason


def test_after_a_fatal_status_nothing_more_is_called(tmp_path: Path) -> None:
    report = examine(build_planted(3, tmp_path, "NO_FATAL_END"), only=["illegal calls"])
    assert found(report) == set(), str(report)


def test_a_description_that_cannot_be_read_is_a_failed_check(tmp_path: Path) -> None:
    fmu = build_planted(2, tmp_path, edit=lambda text: text.replace('"3"', '"-3"', 1))
    code, text = call(fmu, "--check", "leaks")
    assert code == 1
    assert "its value reference is not from 0 to 2^32 - 1: -3" in text
    assert "(FMI 2.0.5, 2.2 or FMI 3.0.2, 2.4)" in text
    report = examine(fmu)
    assert failed(report) == {"description"}
    assert others(report) == {*kit.NAMES} - {"description"}


def test_each_finding_names_the_command_that_repeats_it(tmp_path: Path) -> None:
    fmu = build_planted(2, tmp_path / "a place", "DERIVATIVE_A_BIT_OFF")
    _, text = call(fmu, "--check", "derivatives", "--timeout", "200")
    (command,) = re.findall("again: sblcosim conformance (.*)", text)
    code, again = call(*shlex.split(command))
    assert code == 1
    assert again == text
    for result in examine(fmu, only=["functions", "reset"]).results:
        assert result.command == f"sblcosim conformance '{fmu}' --check '{result.name}'".replace(
            f"'{result.name}'", shlex.quote(result.name)
        )


def test_results_are_printed_as_they_come(tmp_path: Path) -> None:
    fmu = build_planted(2, tmp_path, "HANG_ON_NAN")
    seen = []
    examine(fmu, only=["functions", "reset"], each=lambda result: seen.append(result.name))
    assert seen == ["functions", "life cycle", "reset"]
    command = [sys.executable, "-m", "sblcosim", "conformance", fmu, "--timeout", "600"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    with process:
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith("unknown references"):  # the next one hangs
                process.kill()
                break
        else:
            raise AssertionError("the command has ended")


def test_warnings_end_with_1_on_demand(tmp_path: Path) -> None:
    fmu = build_planted(2, tmp_path, "CRASH_ON_NULL")
    code, text = call(fmu, "--check", "null pointers")
    assert code == 0
    assert "planted2.fmu, FMI 2.0: 1 passed, 1 warning" in text
    assert call(fmu, "--check", "null pointers", "--strict")[0] == 1
    assert call(fmu, "--check", "functions", "--strict")[0] == 0


def call(*arguments: Any) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["conformance", *map(str, arguments)])
    return result.exit_code, result.output


def test_command_prints_a_table_and_ends_by_the_result(tmp_path: Path) -> None:
    code, text = call(build_planted(2, tmp_path / "intact"))
    assert code == 0
    assert "planted2.fmu, FMI 2.0: 18 passed" in text
    leaking = build_planted(2, tmp_path / "leak", "LEAK")
    code, text = call(leaking, "--check", "leaks", "--check", "functions")
    assert code == 1
    assert "planted2.fmu, FMI 2.0: 2 passed, 1 failed" in text


def test_command_prints_json(tmp_path: Path) -> None:
    code, text = call(
        build_planted(3, tmp_path, "WRONG_DERIVATIVE"), "--check", "derivatives", "--json"
    )
    assert code == 1
    report = json.loads(text)
    assert report["fmi"] == "3.0"
    assert report["ok"] is False
    (bad,) = (check for check in report["checks"] if check["state"] == "failed")
    assert bad["name"] == "derivatives"
    assert bad.keys() == {"name", "what", "state", "reason", "clause", "command"}
    assert bad["clause"] == "FMI 3.0.2, 2.2.12.1"


def rewritten(source: Path, target: Path, change: Any) -> Path:
    """A copy of an FMU with another name or content for some files."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            for other, content in change(name, old.read(name)):
                new.writestr(other, content)
    return target


def test_a_terminal_of_ours_that_names_nothing_breaks_the_plug_contract(tmp_path: Path) -> None:
    def renamed(name: str, content: bytes) -> Any:
        if name == "modelDescription.xml":
            content = content.replace(b'name="update_count"', b'name="other"')
        return [(name, content)]

    broken = rewritten(factory.build("ekf"), tmp_path / "ekf.fmu", renamed)
    report = examine(broken, only=["plug contract"])
    assert failed(report) == {"plug contract"}
    assert "terminal estimate" in str(report)


def test_what_cannot_be_checked_is_said_and_ends_with_2(tmp_path: Path) -> None:
    good = build_planted(2, tmp_path)
    (tmp_path / "text.fmu").write_text("not an archive")

    def exchange(name: str, content: bytes) -> Any:
        return [(name, content.replace(b"CoSimulation", b"ModelExchange"))]

    def scheduled(name: str, content: bytes) -> Any:
        return [(name, content.replace(b"CoSimulation", b"ScheduledExecution"))]

    def misnamed(name: str, content: bytes) -> Any:
        return [(name.replace("/planted.", "/libplanted."), content)]

    def elsewhere(name: str, content: bytes) -> Any:
        return [(name.replace("linux64", "win32").replace(".so", ".dll"), content)]

    for path, reason in {
        tmp_path / "none.fmu": "must be an FMU, got no file",
        tmp_path / "text.fmu": "is not an FMU (not a ZIP archive)",
        rewritten(good, tmp_path / "me.fmu", exchange): (
            "must be an FMU for Co-Simulation, got Model Exchange"
        ),
        rewritten(build_planted(3, tmp_path), tmp_path / "se.fmu", scheduled): (
            "must be an FMU for Co-Simulation, got Scheduled Execution"
        ),
        rewritten(good, tmp_path / "win.fmu", elsewhere): "must have a binary for ",
        rewritten(good, tmp_path / "misnamed.fmu", misnamed): "must have the binary binaries/",
    }.items():
        code, text = call(path, "--json")
        assert code == 2, text
        assert text.startswith(f"error: {path}: {reason}")
        assert text.count("\n") == 1
    code, text = call(good, "--check", "leak")
    assert code == 2
    assert "check: must be one of description, fmutool, plug contract" in text
    assert text.endswith("got 'leak'; did you mean 'leaks'?\n")

"""Whatever an FMU does to its process, the run says which it was, and the others' results stay."""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
import pytest
import sblcosim
from quick import few, one_in
from sblcosim.data.record import Record
from sblcosim.errors import ConfigurationError, ConfigurationWarning, FmuError
from sblcosim.fmus.build.factory import build
from sblcosim.fmus.conformance.receiver_contract import check_receiver
from sblcosim.fmus.files import scratch, sweep
from sblcosim.fmus.host.libraries import ours
from sblcosim.fmus.read.ports import read
from sblcosim.models.ports import BEACON_POSITIONS, ESTIMATE, REQUIRED_ESTIMATE, ports
from sblcosim.scenario.wiring import connect
from sblcosim.simulation import execution
from sblcosim.simulation.children import process as child_process
from sblcosim.simulation.children.memory import Memory
from sblcosim.simulation.children.watched import Watched
from sblcosim.simulation.plans.plan import Plan
from sblcosim.simulation.system import ComponentSpec
from sblcosim.study import runner
from seams import Seam

pytestmark = pytest.mark.usefixtures("only_hangs_take_time")

SCENARIO = "paper-scenario-1"
SHORT = {"time.duration_s": 2.0}
OTHERS = ("target", "platform", "acoustics", "ekf", "raw")


def _module() -> ModuleType:
    file = Path(__file__).parents[1] / "fmu" / "rogue" / "rogue.py"
    spec = importlib.util.spec_from_file_location("rogue", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


rogues = _module()
Rogue = Callable[..., Path]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path: Path = rogues.compile_rogue(tmp_path_factory.mktemp("library"))
    return path


@pytest.fixture
def rogue(library: Path, tmp_path: Path) -> Rogue:
    """Makes an FMU that does something in some phase."""
    return lambda what, phase, **rest: rogues.rogue(library, tmp_path, what, phase, **rest)


@pytest.fixture(scope="module")
def alone() -> sblcosim.Result:
    """The run without any rogue."""
    return sblcosim.run(SCENARIO, "ekf", SHORT)


def same(result: sblcosim.Result, alone: sblcosim.Result) -> None:
    """All columns of all others are the same to the last bit."""
    names = [name for name in alone.record.values if name.partition(".")[0] in OTHERS]
    assert {name.partition(".")[0] for name in names} == set(OTHERS)
    for name in names:
        assert result.record.values[name].tobytes() == alone.record.values[name].tobytes(), name
    assert result.errors.loc["ekf"].equals(alone.errors.loc["ekf"])


FUNCTIONS = {
    "load": "loading its library", "instantiate": "fmi2Instantiate",
    "setup": "fmi2SetupExperiment", "initialise": "fmi2EnterInitializationMode",
    "set": "fmi2SetReal at 0.1 s", "step": "fmi2DoStep at 0.1 s", "get": "fmi2GetReal at 0.1 s",
    "terminate": "fmi2Terminate", "free": "fmi2FreeInstance", "unload": "unloading its library",
}  # fmt: skip
AFTER = ("terminate", "free", "unload")
ALL = [
    (what, phase, master)
    for what in rogues.DEADLY
    for phase in rogues.PHASES
    for master in ("native", "python")
]
CUT = [
    *(("exit", phase, "native") for phase in rogues.PHASES),
    *(("segv", phase, "python") for phase in rogues.PHASES[1::4]),
    *((what, "step", "native") for what in rogues.DEADLY if what != "exit"),
    ("hang", "load", "native"), ("hang", "get", "python"), ("hang", "free", "native"),
]  # fmt: skip


def judge(
    what: str, phase: str, master: str, rogue: Rogue, alone: sblcosim.Result
) -> None:
    file = rogue(what, phase)
    result = sblcosim.run(SCENARIO, ["ekf", file], SHORT, master=master, step_timeout=0.7)
    how = rogues.DEADLY[what]
    expected = f"{file.stem}: FMU {file} {how} in {FUNCTIONS[phase]}"
    if what == "hang":
        expected = f"{file.stem}: FMU {file} {how} from {FUNCTIONS[phase]} for 0.7 s"
    assert result.failures == {file.stem: expected}
    assert (file.stem in result.receivers) == (phase in AFTER)
    if phase in AFTER:
        assert result.record.values[f"{file.stem}.update_count"].tolist() == list(range(21))
    assert expected in str(result)
    assert result.summary.loc[file.stem, "failure"] == expected
    same(result, alone)


@pytest.mark.parametrize(("what", "phase", "master"), CUT)
@one_in(2)
def test_a_death_names_fmu_call_and_time_and_spares_the_others(
    what: str, phase: str, master: str, rogue: Rogue, alone: sblcosim.Result
) -> None:
    judge(what, phase, master, rogue, alone)


@pytest.mark.slow
@pytest.mark.parametrize(("what", "phase", "master"), [case for case in ALL if case not in CUT])
def test_a_death_of_any_kind_anywhere(
    what: str, phase: str, master: str, rogue: Rogue, alone: sblcosim.Result
) -> None:
    judge(what, phase, master, rogue, alone)


@pytest.mark.parametrize(
    ("phase", "master"), [("instantiate", "native"), ("step", "python"), ("terminate", "python")]
)
def test_a_bad_status_spares_the_others(
    phase: str, master: str, rogue: Rogue, alone: sblcosim.Result
) -> None:
    file = rogue("error", phase)
    result = sblcosim.run(SCENARIO, ["ekf", file], SHORT, master=master)
    assert list(result.failures) == [file.stem]
    assert (file.stem in result.receivers) == (phase == "terminate")
    same(result, alone)


def test_what_the_fmu_said_before_its_end_is_told(rogue: Rogue) -> None:
    result = sblcosim.run(SCENARIO, ["ekf", rogue("complain", "step")], SHORT)
    (message,) = result.failures.values()
    assert message.endswith("ended the process (exit code 1) in fmi2DoStep at 0.1 s: no licence")


@pytest.mark.parametrize("share", [0.01, 0.6, 0.95])
def test_a_truncated_library_is_named(
    share: float, library: Path, rogue: Rogue, alone: sblcosim.Result
) -> None:
    content = library.read_bytes()
    file = rogue("exit", "none", content=content[: int(share * len(content))])
    result = sblcosim.run(SCENARIO, ["ekf", file], SHORT)
    if share < 0.9:  # what is at its end is not needed by every loader
        assert str(file) in result.failures[file.stem]
    same(result, alone)


@pytest.mark.parametrize("master", few(["native", "python"], quick=["native"]))
@pytest.mark.parametrize(
    ("what", "phase"),
    [
        ("rounding", "load"), ("rounding", "initialise"), ("rounding", "step"),
        ("subnormal", "instantiate"), ("subnormal", "set"), ("locale", "load"), ("locale", "get"),
        ("dates", "step"), ("dates", "get"),
    ],
)  # fmt: skip
@one_in(2)
def test_habits_of_an_fmu_change_no_other(
    what: str, phase: str, master: str, rogue: Rogue, alone: sblcosim.Result
) -> None:
    file = rogue(what, phase)
    with pytest.warns(ConfigurationWarning) as caught:
        result = sblcosim.run(SCENARIO, [file, "ekf"], SHORT, master=master)
    (message,) = {str(w.message) for w in caught if file.stem in str(w.message)}
    state = "the floating-point state of the processor"
    thing = "the locale" if what in ("locale", "dates") else state
    call = FUNCTIONS[phase].removesuffix(" at 0.1 s")
    assert message == (
        f"{file.stem}: FMU {file} must leave {thing} unchanged, got a change in {call}; "
        "it was undone"
    )
    assert not result.failures
    same(result, alone)


@pytest.mark.parametrize("phase", ["load", "step", "free"])
def test_a_slow_fmu_is_waited_for(phase: str, rogue: Rogue, alone: sblcosim.Result) -> None:
    result = sblcosim.run(SCENARIO, ["ekf", rogue("sleep", phase)], SHORT)
    assert not result.failures
    same(result, alone)


@pytest.mark.slow
def test_a_thread_that_crashes_is_found_among_several_fmus(rogue: Rogue) -> None:
    """It comes in a call of somebody else; each is tried on its own then."""
    long = {"time.duration_s": 10_000.0}  # on its own it has to last until the thread crashes
    alone = sblcosim.run(SCENARIO, "ekf", long)
    files = [rogue("later", "instantiate"), rogue("none", "none"), rogue("sleep", "get")]
    result = sblcosim.run(SCENARIO, ["ekf", *files], long)
    (label,), (message,) = result.failures.keys(), result.failures.values()
    assert label == files[0].stem
    assert "crashed (signal SIGSEGV)" in message
    assert {f.stem for f in files[1:]} <= set(result.receivers)
    same(result, alone)


def test_a_thread_that_crashes_only_beside_others_is_not_blamed_on_one(rogue: Rogue) -> None:
    error = FmuError("b: crashed")
    error.component, error.suspects = "b", ("a", "b")
    system = connect(sblcosim.load(SCENARIO, SHORT), {"a": rogue("none", "none"), "b": "ekf"})

    def execute(plan: Plan) -> Record:
        if {"a", "b"} <= {c.name for c in plan.components}:
            raise error
        return execution.execute(plan)

    outcome = execution.survive(system, ["a", "b"], execute)
    assert outcome.failures == {
        "b": "b: crashed; it may have been a thread of a, because none of them fails alone"
    }


def test_two_that_fail_are_both_named(rogue: Rogue, alone: sblcosim.Result) -> None:
    files = [rogue("exit", "step"), rogue("error", "get")]
    result = sblcosim.run(SCENARIO, ["ekf", *files], SHORT)
    assert result.failures.keys() == {f.stem for f in files}
    same(result, alone)


# ---- the command ----


def command(*words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "sblcosim", *map(str, words)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_the_command_writes_the_others_results_and_exits_with_1(
    rogue: Rogue, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    done = command(
        "run", SCENARIO, "--receiver", "ekf", "--receiver", rogue("exit", "step"), "--set",
        "time.duration_s=2", "--out", out, "--json", "--no-figures",
    )  # fmt: skip
    assert done.returncode == 1
    printed = json.loads(done.stdout)
    (message,) = printed["failures"].values()
    assert f"error: {message}\n" in done.stderr
    assert set(printed["errors"]) == {"ekf", "raw"}
    assert json.loads((out / "manifest.json").read_text())["failures"] == printed["failures"]
    summary = pd.read_parquet(out / "summary.parquet").set_index("receiver")
    assert summary.loc["exit_step", "failure"] == message
    assert np.isnan(summary.loc["exit_step", "availability"])


def test_without_any_receiver_left_nothing_is_written(rogue: Rogue, tmp_path: Path) -> None:
    out = tmp_path / "out"
    files = [rogue("exit", "step"), rogue("segv", "get")]
    words = [word for file in files for word in ("--receiver", file)]
    done = command("run", SCENARIO, *words, "--set", "time.duration_s=2", "--out", out)
    assert done.returncode == 2
    assert [line.partition(": FMU")[0] for line in done.stderr.splitlines()] == [
        "error: exit_step", "error: segv_get",
    ]  # fmt: skip
    assert not out.exists()


@pytest.mark.parametrize("phase", ["load", "step"])
@pytest.mark.slow
def test_a_flood_of_output_is_kept_from_ours(phase: str, rogue: Rogue, tmp_path: Path) -> None:
    file = rogue("flood", phase)
    done = command(
        "run", SCENARIO, "--receiver", file, "--set", "time.duration_s=2", "--out",
        tmp_path / "out", "--json", "--no-figures",
    )  # fmt: skip
    assert done.returncode == 0
    assert file.stem in json.loads(done.stdout)["errors"]
    assert "[more output of FMUs is not shown]" in done.stderr
    assert len(done.stderr) < 40_000


def test_nothing_stays_of_a_process_that_has_died(rogue: Rogue) -> None:
    place = scratch()
    for what, phase in (("segv", "step"), ("hang", "load"), ("exit", "unload"), ("none", "none")):
        system = connect(sblcosim.load(SCENARIO, SHORT), rogue(what, phase))
        plan = sblcosim.simulation.resolve.resolve(system)
        before = set(place.iterdir())
        if what != "none":
            with pytest.raises(FmuError) if phase != "unload" else warnings.catch_warnings():
                execution.execute(plan, step_timeout=0.7)
        else:
            execution.execute(plan)
        assert set(place.iterdir()) <= before


def unpacked(place: Path) -> bool:
    try:
        return any(place.rglob("binaries"))
    except FileNotFoundError:  # it is just being removed
        return True


@pytest.mark.skipif(sys.platform == "win32", reason="processes are told apart by their folders")
def test_a_killed_parent_leaves_neither_process_nor_files(rogue: Rogue, tmp_path: Path) -> None:
    """Even while a library is loaded, which ctypes does under the interpreter's lock."""
    place = tmp_path / "temporary"
    place.mkdir()
    program = (
        "import sys; from pathlib import Path\n"
        "from sblcosim.simulation import execution, isolation\n"
        "from sblcosim.simulation.resolve import resolve\n"
        "from sblcosim.simulation.system import ComponentSpec, System\n"
        "execution.execute(resolve(System({'s': ComponentSpec(Path(sys.argv[1]), 1)}, (), 9)))\n"
    )
    for phase in ("load", "step"):
        process = subprocess.Popen(
            [sys.executable, "-c", program, rogue("hang", phase)],
            env=os.environ | {"TMPDIR": str(place)},
        )
        deadline = time.monotonic() + 300
        while not unpacked(place):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        time.sleep(0.5)
        process.send_signal(signal.SIGKILL)
        process.wait()
        while unpacked(place):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        sweep(place)
        assert not list(place.iterdir())


# ---- Python components ----


def receiver(step: Callable[[int], None] = lambda now: None) -> type:
    """A receiver in Python, which cannot be imported."""

    class Local:
        variables = tuple(v for v in ports(ESTIMATE, "output") if v.name in REQUIRED_ESTIMATE)

        def initialise(self, start_ns: int, parameters: object) -> dict[str, object]:
            self.count = 0
            return {"epoch": 0.0, "position": (0.0, 0.0, 5.0), "update_count": 0}

        def do_step(self, time_ns: int, step_ns: int, inputs: object) -> dict[str, object]:
            step(time_ns)
            self.count += 1
            return {
                "epoch": time_ns / 1e9, "position": (0.0, 1.0, 5.0), "update_count": self.count
            }

    return Local


def test_a_python_receiver_goes_beside_an_fmu_of_others(
    rogue: Rogue, alone: sblcosim.Result
) -> None:
    receivers = {"mine": receiver(), "ekf": "ekf", "theirs": rogue("none", "none")}
    for master in ("native", "python"):
        result = sblcosim.run(SCENARIO, receivers, SHORT, master=master)
        assert not result.failures
        assert result.record.values["mine.update_count"].tolist() == list(range(21))
        same(result, alone)


@pytest.mark.parametrize("beside", [False, True])
def test_a_python_receiver_that_raises_spares_the_others(
    beside: bool, rogue: Rogue, alone: sblcosim.Result
) -> None:
    def fail(now: int) -> None:
        if now == 300_000_000:
            raise KeyError("range")

    receivers = {"mine": receiver(fail), "ekf": "ekf"}
    if beside:
        receivers["theirs"] = rogue("none", "none")
    for master in ("native", "python"):
        result = sblcosim.run(SCENARIO, receivers, SHORT, master=master)
        (message,) = result.failures.values()
        assert message.startswith("mine at 0.3 s: must not raise an exception, got KeyError: ")
        assert " (Local in test_rogues.py, line " in message
    same(result, alone)


def test_a_python_receiver_that_ends_the_process_is_named(
    rogue: Rogue, alone: sblcosim.Result
) -> None:
    def end(now: int) -> None:
        os._exit(0)

    receivers = {"ekf": "ekf", "theirs": rogue("none", "none"), "mine": receiver(end)}
    result = sblcosim.run(SCENARIO, receivers, SHORT, master="python")
    (message,) = result.failures.values()
    assert "mine: the Python component" in message
    assert message.endswith("ended the process (exit code 0) in do_step at 0 s")
    assert "theirs" in result.receivers
    same(result, alone)


def test_a_python_receiver_that_cannot_go_to_another_process_is_named(rogue: Rogue) -> None:
    lock = threading.Lock()

    def keep(now: int) -> None:
        with lock:
            pass

    receivers = {"mine": receiver(keep), "theirs": rogue("none", "none")}
    with pytest.raises(ConfigurationError, match="mine: must be something that another process"):
        sblcosim.run(SCENARIO, receivers, SHORT, master="python")
    assert not sblcosim.run(SCENARIO, receivers, SHORT).failures  # native leaves it here


def test_a_platform_in_python_without_a_position_is_named() -> None:
    class Platform:
        variables = BEACON_POSITIONS

        def initialise(self, start_ns: int, parameters: object) -> dict[str, object]:
            return {v.name: np.zeros(v.shape) for v in self.variables}

        def do_step(self, time_ns: int, step_ns: int, inputs: object) -> dict[str, object]:
            return {v.name: np.zeros(v.shape) for v in self.variables}

    with pytest.raises(ConfigurationError, match=r"^platform\.position: must be an output"):
        sblcosim.run(SCENARIO, "ekf", SHORT, components={"platform": Platform})


# ---- what is ours ----


def test_what_is_ours_is_known_without_running_anything(
    rogue: Rogue, tmp_path: Path
) -> None:
    copy = tmp_path / "copy.fmu"
    copy.write_bytes(build("ekf").read_bytes())
    assert ours(read(copy))
    assert not ours(read(rogue("exit", "load")))
    changed = tmp_path / "changed.fmu"
    changed.write_bytes(build("ekf").read_bytes() + b"\0")
    assert not ours(read(changed))


def test_the_check_sees_a_library_that_ends_the_process(rogue: Rogue) -> None:
    report = check_receiver(rogue("exit", "load"), load=True)
    assert not report.ok
    (finding,) = report.of("error")
    assert "ends the process (exit code 0x0)" in finding.message
    assert check_receiver(rogue("none", "none"), load=True).ok


def test_outputs_at_the_start_are_found_in_a_process_of_its_own(rogue: Rogue) -> None:
    spec = ComponentSpec(rogue("none", "none"), 100)
    assert execution.initial_outputs(spec, ("epoch",))["epoch"] == 0
    spec = ComponentSpec(rogue("exit", "instantiate"), 100)
    with pytest.raises(FmuError, match=r"^exit_instantiate: .* \(exit code 0\) in fmi2Instant"):
        execution.initial_outputs(spec, ("epoch",))
    spec = ComponentSpec(rogue("hang", "initialise"), 100)
    hangs = pytest.raises(FmuError, match=r"has not returned .* for 0\.7 s")
    with child_process.patience(0.7), hangs:
        execution.initial_outputs(spec, ("epoch",))


# ---- studies ----


def study(files: list[Path], replicates: int = 2) -> sblcosim.study.Study:
    return sblcosim.study.load(
        {
            "scenario": SCENARIO,
            "replicates": replicates,
            "receivers": ["ekf", *map(str, files)],
            "settling_time_s": 0.0,
            "fixed": {"time.duration_s": 8.0},
            "factors": {"noise": {"keys": ["acoustics.range_std_m"], "levels": [0.1, 0.5]}},
        }
    )


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    return runner.run(study([]), tmp_path_factory.mktemp("own"))


@pytest.mark.parametrize("executor", ["threads", "processes"])
@pytest.mark.slow
def test_a_study_keeps_the_healthy_receivers_columns(
    executor: str, rogue: Rogue, own: pd.DataFrame, tmp_path: Path
) -> None:
    files = [rogue("exit", "step"), rogue("none", "none")]
    table = runner.run(study(files), tmp_path / "out", executor=executor, workers=2)
    assert table["error"].str.startswith("exit_step: FMU").all()
    assert (table["exit_step.estimates"] == 0).all()
    assert (table["none_none.estimates"] > 70).all()
    mine = [name for name in own if name.startswith("ekf.")]
    assert table[mine].equals(own[mine])


def test_a_study_waits_as_long_for_an_fmu_as_it_is_told(
    rogue: Rogue, own: pd.DataFrame, tmp_path: Path
) -> None:
    table = runner.run(study([rogue("hang", "step")]), tmp_path / "out", step_timeout=1.0)
    assert table["error"].str.endswith("from fmi2DoStep at 0.1 s for 1 s").all()
    assert table[list(own)[:-2]].equals(own[list(own)[:-2]])


@pytest.mark.parametrize("phase", ["free", "unload"])
def test_a_study_waits_no_longer_at_its_end(phase: str, rogue: Rogue, tmp_path: Path) -> None:
    made = study([rogue("hang", phase)])
    with pytest.warns(ConfigurationWarning, match=rf"from {FUNCTIONS[phase]} for 1 s; its r"):
        table = runner.run(made, tmp_path / "out", workers=1, step_timeout=1.0)
    assert table["error"].isna().all()


def test_the_record_is_mapped_as_soon_as_the_loop_begins(
    rogue: Rogue, monkeypatch: pytest.MonkeyPatch, seam: Seam
) -> None:
    """On Windows it is gone with the process that has made it."""
    mapped: list[int] = []
    at_answers: list[int] = []
    original, tell = Memory.part, Watched.tell

    def part(self: Memory, start: int, size: int) -> object:
        mapped.append(start)
        return original(self, start, size)

    monkeypatch.setattr(Memory, "part", part)
    seam.instead(tell, lambda *given: at_answers.append(len(mapped)) or tell(*given))
    sblcosim.run(SCENARIO, rogue("none", "none"), SHORT)
    assert at_answers[0] == len(mapped) > 1


def test_a_study_keeps_its_processes(
    rogue: Rogue, own: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started = []
    original = child_process.Process.__init__

    def counted(self: child_process.Process) -> None:
        started.append(self)
        original(self)

    monkeypatch.setattr(child_process.Process, "__init__", counted)
    table = runner.run(study([rogue("none", "none")], 6), tmp_path / "out", workers=2)
    assert table["error"].isna().all()
    assert len(table) == 12
    assert len(started) <= 2
    assert not any(child.alive for child in started)


def test_a_failure_at_the_end_of_a_study_is_a_warning(rogue: Rogue, tmp_path: Path) -> None:
    with pytest.warns(ConfigurationWarning, match=r"exit_free: .* in fmi2FreeInstance; its resul"):
        table = runner.run(study([rogue("exit", "free")]), tmp_path / "out", workers=1)
    assert table["error"].isna().all()


@pytest.fixture(autouse=True)
def _no_process_stays() -> Iterator[None]:
    yield
    found = subprocess.run(
        ["ps", "-o", "args=", "--ppid", str(os.getpid())], capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert "sblcosim.simulation.child" not in found.stdout

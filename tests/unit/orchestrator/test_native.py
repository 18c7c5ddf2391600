from __future__ import annotations

import ctypes
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from python_components import Clock, Relay
from sblcosim.data.record import Record
from sblcosim.errors import BuildError, ConfigurationError, FmuError
from sblcosim.fmus.build import compiler as compilers
from sblcosim.fmus.build.factory import Unit, build, compile_shared
from sblcosim.fmus.host import instances as fmus
from sblcosim.fmus.host.watch import Progress
from sblcosim.fmus.read import ports
from sblcosim.simulation import execution, isolation
from sblcosim.simulation.children.messages import Begun
from sblcosim.simulation.children.process import PATIENCE, Process, patience
from sblcosim.simulation.children.state import LOOP
from sblcosim.simulation.children.watched import Watched
from sblcosim.simulation.masters import c_libraries, native, python
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import ComponentSpec, Connection, System
from stranger import build_stranger

MS = 1_000_000
T = 100 * MS
CRASH = {"SIGSEGV": 5, "SIGABRT": 6, "SIGFPE": 7, "SIGILL": 8, "SIGBUS": 9}
STACK, HANG, CRASH_IN_GET, SLOW = 10, 11, 12, 13
MANY = 200_000
"""Slow steps that take more than three minutes."""
OTHERS = ("Float32", "Int8", "UInt8", "Int16", "UInt16", "UInt32", "Int64", "UInt64")


MORE = {
    2: """
    <ScalarVariable name="z[1]" valueReference="700" causality="output"><Real unit="m"/>
    </ScalarVariable>
    <ScalarVariable name="z[2]" valueReference="701" causality="output"><Real unit="m"/>
    </ScalarVariable>
    <ScalarVariable name="odd" valueReference="2300" causality="output" variability="discrete">
      <Boolean/>
    </ScalarVariable>
  </ModelVariables>""",
    3: """
    <Float64 name="z" valueReference="700" causality="output" unit="m">
      <Dimension start="2"/>
    </Float64>
    <Boolean name="odd" valueReference="2300" causality="output"/>
  </ModelVariables>""",
}


@pytest.fixture(scope="session")
def wild(tmp_path_factory):
    """The stranger, by FMI version, with outputs z and odd and without bounds of fail_as."""
    return {
        fmi: build_stranger(
            fmi,
            tmp_path_factory.mktemp(f"wild{fmi}"),
            lambda text, more=more: text.replace("  </ModelVariables>", more).replace(
                'max="4"', 'max="99"'
            ),
        )
        for fmi, more in MORE.items()
    }.__getitem__


@pytest.fixture(scope="session")
def typed(tmp_path_factory):
    """The stranger with arrays of all other types of FMI 3."""

    def edit(text):
        for kind, number in zip(OTHERS, range(31, 39), strict=True):
            text = text.replace(
                "  </ModelVariables>",
                "".join(
                    f'<{kind} name="{name}_{kind}" valueReference="{number}{place}" '
                    f'causality="{causality}" variability="discrete"{start}>'
                    '<Dimension start="2"/>'
                    f"</{kind}>"
                    for name, place, causality, start in (
                        ("in", "00", "input", ' start="0 0"'),
                        ("out", "50", "output", ""),
                    )
                )
                + "  </ModelVariables>",
            )
        return text

    return build_stranger(3, tmp_path_factory.mktemp("typed"), edit)


def plan_of(components, *connections, stop_ns=10 * T, start_ns=0):
    specs = {
        name: spec if isinstance(spec, ComponentSpec) else ComponentSpec(spec, T)
        for name, spec in components.items()
    }
    return resolve(System(specs, tuple(Connection(*c) for c in connections), stop_ns, start_ns))


def ring(a, b, a_ns=T, b_ns=T, **rest):
    """Three strangers in a ring, with connections of every type from each to the next."""
    return plan_of(
        {
            "a": ComponentSpec(a, a_ns, {"gain": 0.7, "offset": (1.0, -2.0)}),
            "b": ComponentSpec(b, b_ns, {"gain": 0.9, "offset": (0.25, 3.0)}),
            "c": ComponentSpec(a, a_ns, {"offset": (0.5, 0.0)}),
        },
        ("a.z", "b.u"),
        ("b.z", "c.u"),
        ("c.z", "a.u"),
        ("a.steps", "b.n"),
        ("b.steps", "c.n"),
        ("a.odd", "b.on"),
        ("b.odd", "c.on"),
        ("c.was_on", "a.on"),
        **rest,
    )


def assert_equal(a, b):
    assert np.array_equal(a.time_ns, b.time_ns)
    assert a.values.keys() == b.values.keys()
    for name, values in a.values.items():
        assert values.dtype == b.values[name].dtype
        assert values.shape == b.values[name].shape
        assert values.tobytes() == b.values[name].tobytes(), name


def failing(fmu, how, at=0.35, steps=10, **options):
    return native.execute(with_bad(fmu, how, at, steps), **options)


def isolated(fmu, how, at=0.35, steps=10, **options):
    """In a process of its own, as it should be with FMUs of others."""
    return execution.execute(with_bad(fmu, how, at, steps), master="native", **options)


def with_bad(fmu, how, at, steps):
    return plan_of(
        {
            "other": fmu,
            "bad": ComponentSpec(fmu, T, {"fail_at": at, "fail_as": how}),
        },
        ("other.steps", "bad.n"),
        stop_ns=steps * T,
    )


@pytest.mark.parametrize("versions", [(2, 2), (3, 3), (2, 3), (3, 2)])
@pytest.mark.parametrize("intervals", [(T, T), (2 * T, 3 * T), (3 * T, T), (7, 5 * 7)])
def test_the_record_is_that_of_the_python_master(wild, versions, intervals):
    a, b = (wild(fmi) for fmi in versions)
    plan = ring(a, b, *intervals, stop_ns=60 * max(intervals), start_ns=11)
    assert_equal(native.execute(plan), python.execute(plan))


def test_the_python_masters_record_is_worth_comparing_with(wild):
    values = python.execute(ring(wild(2), wild(3), stop_ns=30 * T)).values
    assert values["c.steps"][-1] > values["b.steps"][-1] > values["a.steps"][-1] == 30
    assert {*values["a.was_on"][2:]} == {True, False}
    assert len(np.unique(values["b.y"])) > 60


def test_all_types_of_fmi_3_reach_their_inputs(typed):
    connections = [(f"{a}.out_{kind}", f"{b}.in_{kind}") for kind in OTHERS
                   for a, b in (("a", "b"), ("b", "a"))]  # fmt: skip
    plan = plan_of({"a": typed, "b": typed}, *connections, stop_ns=300 * T)
    record = native.execute(plan)
    assert_equal(record, python.execute(plan))
    for kind in OTHERS:
        values = record.values[f"a.out_{kind}"]
        bits = 8 * values.dtype.itemsize if kind != "Float32" else 64
        assert values[2].tolist() == [2, 2]
        assert int(values[-1, 0]) % 2**bits == 300 % 2**bits


def test_booleans_cross_the_versions_of_fmi(stranger):
    plan = plan_of(
        {"a": stranger(2), "b": stranger(3), "c": stranger(2)},
        ("a.was_on", "b.on"), ("b.was_on", "c.on"), ("c.was_on", "a.on"),
    )  # fmt: skip
    assert_equal(native.execute(plan), python.execute(plan))


@pytest.mark.parametrize("chosen", [("b.y",), ("b.was_on", "a.steps"), ("a.y", "a.now", "b.now")])
def test_chosen_columns_are_those_of_the_whole_record(wild, chosen):
    plan = ring(wild(2), wild(3), 2 * T, 3 * T, stop_ns=60 * T)
    whole = python.execute(plan)
    for record in (native.execute(plan, record=chosen), python.execute(plan, record=chosen)):
        assert set(record.values) == set(chosen)
        for name in chosen:
            assert np.array_equal(record.values[name], whole.values[name])


def test_nothing_need_be_recorded(wild):
    assert native.execute(ring(wild(2), wild(3)), record=()).values == {}


@pytest.mark.parametrize("execute", [python.execute, native.execute])
def test_an_unknown_column_is_refused_with_the_nearest_name(stranger, execute):
    with pytest.raises(ConfigurationError, match=r"^a\.step: must be an output .*'a\.steps'\?$"):
        execute(plan_of({"a": stranger(2)}), record=["a.step"])


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(("status", "label"), [(2, "Discard"), (3, "Error"), (4, "Fatal")])
def test_a_failed_step_gives_the_python_masters_error(stranger, fmi, status, label):
    plan = plan_of({"s": ComponentSpec(stranger(fmi), T, {"fail_at": 0.35, "fail_as": status})})
    messages = []
    for execute in (python.execute, native.execute):
        with pytest.raises(FmuError) as caught:
            execute(plan)
        messages.append(str(caught.value))
    assert (
        messages
        == [f"s: fmi{fmi}DoStep at 0.3 s must succeed, got {label}: cannot step over 0.35"] * 2
    )


def test_a_warning_does_not_stop_a_run(stranger):
    assert len(failing(stranger(2), 1)) == 11


def test_an_fmu_that_asks_to_terminate_stops_the_run(stranger):
    with pytest.raises(FmuError, match=r"^bad: fmi3DoStep at 0\.3 s must succeed, got Discard: "
                       r"the FMU ended the simulation or the step early$"):  # fmt: skip
        failing(stranger(3), 0)


def test_a_run_after_a_failed_one_is_as_if_nothing_had_happened(stranger):
    reference = failing(stranger(2), 2, at=-1.0)
    for status in (2, 3, 4):
        with pytest.raises(FmuError):
            failing(stranger(2), status)
        assert_equal(failing(stranger(2), 2, at=-1.0), reference)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", CRASH)
def test_a_crash_names_component_signal_call_and_time_and_spares_the_process(wild, fmi, name):
    with pytest.raises(FmuError) as caught:
        isolated(wild(fmi), CRASH[name])
    assert str(caught.value) == (
        f"bad: FMU {wild(fmi)} crashed (signal {name}) in fmi{fmi}DoStep at 0.3 s"
    )
    assert len(failing(wild(fmi), 1, at=-1.0)) == 11


def test_a_stack_that_is_used_up_is_a_crash(wild):
    with pytest.raises(FmuError, match=r"^bad: .*crashed \(signal SIG(SEGV|BUS)\) in fmi2DoStep"):
        isolated(wild(2), STACK)


def test_a_crash_outside_of_a_step_names_the_call(wild):
    with pytest.raises(FmuError, match=r"crashed \(signal SIGSEGV\) in fmi3GetFloat64 at 0\.4 s$"):
        isolated(wild(3), CRASH_IN_GET)


def idle(path, name):
    """The instance that the next run would use."""
    instance = fmus.acquire(ports.read(path), name)
    fmus.release(instance)
    return instance


@pytest.mark.usefixtures("only_hangs_take_time")
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_hang_is_given_up_and_names_component_call_and_time(wild, fmi):
    with pytest.raises(FmuError) as caught:
        isolated(wild(fmi), HANG, step_timeout=0.2)
    assert str(caught.value) == (
        f"bad: FMU {wild(fmi)} has not returned from fmi{fmi}DoStep at 0.3 s for 0.2 s"
    )
    assert len(failing(wild(fmi), 1, at=-1.0)) == 11


class Looks:
    """Answers of a child in its loop that come after many looks; no time passes between them."""

    def __init__(self, child, steps):
        self._child, self._steps, self._left = child, steps, 1000

    def get(self, timeout):
        self._left -= 1
        if self._left == 0:
            return "answer"
        self._child._state.progress.row += self._steps
        raise queue.Empty


def test_a_long_run_of_short_steps_is_no_hang():
    """Whereas the same time in one step is."""
    begun = Begun((("bad", "f"),), ())
    watched = Watched({"bad": "FMU bad"}, ("bad",), range(0, 2000 * MS, MS), begun)
    child = Process()
    try:
        child._state.where = LOOP
        child._answers = Looks(child, 1)
        assert child._next(watched, 0.6, None) == "answer"
        child._answers = Looks(child, 0)
        with pytest.raises(FmuError, match=r"has not returned from f at 0\.999 s for 0\.6 s$"):
            child._next(watched, 0.6, None)
    finally:
        child.kill()


@pytest.mark.parametrize("timeout", [0.0, -1.0, float("nan")])
def test_a_timeout_must_be_positive(stranger, timeout):
    with pytest.raises(ConfigurationError, match=r"^step timeout: must be positive, got"):
        isolated(stranger(2), 1, step_timeout=timeout)


def test_a_timeout_of_all_calls_must_be_positive_and_ends_with_its_block():
    usual = PATIENCE.get()
    with patience(2.5):
        assert PATIENCE.get() == 2.5
        for timeout in (0.0, -1.0, float("nan")):
            with pytest.raises(ConfigurationError, match=r"^step timeout: must be positive, got"):
                patience(timeout).__enter__()
            assert PATIENCE.get() == 2.5
        with patience(None):
            assert PATIENCE.get() == 2.5
    assert PATIENCE.get() == usual


def test_ctrl_c_ends_a_run_and_leaves_the_instances_usable(wild):
    reference = failing(wild(2), 1, at=-1.0)
    before = idle(wild(2), "bad")
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))

    def begun(share):  # not before the loop, however busy the machine
        if not timer.ident:
            timer.start()

    with pytest.raises(KeyboardInterrupt):
        failing(wild(2), SLOW, at=0.0, steps=MANY, progress=begun)
    assert idle(wild(2), "bad") is before  # the loop has seen it, and has ended
    assert_equal(failing(wild(2), 1, at=-1.0), reference)


def test_ctrl_c_does_not_wait_for_a_step_that_hangs(wild):
    timer = threading.Timer(2.0, os.kill, (os.getpid(), signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012
        timer.start()
        isolated(wild(2), HANG, step_timeout=3600.0)


@pytest.mark.parametrize("run", [failing, isolated])
def test_an_error_in_the_callers_progress_ends_the_run(wild, run):
    def fail(share):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run(wild(2), SLOW, at=0.0, steps=MANY, progress=fail)


@pytest.mark.parametrize("run", [failing, isolated])
def test_progress_grows_to_one_and_is_reported_rarely(wild, run):
    shares: list[float] = []
    began = time.monotonic()
    run(wild(2), SLOW, at=0.0, steps=500, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len(shares) < (time.monotonic() - began) * 10 + 2  # more time on a busy machine
    assert all(0 < share <= 1 for share in shares)


@pytest.mark.parametrize("run", [failing, isolated])
def test_progress_is_reported_during_a_run(wild, run):
    shares: list[float] = []

    def seen(share):
        shares.append(share)
        if len(shares) == 3:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run(wild(2), SLOW, at=0.0, steps=MANY, progress=seen)
    assert 0 < shares[0] < shares[1] < shares[2] < 1


def test_runs_in_several_threads_do_not_disturb_each_other(wild):
    plans = [ring(wild(2), wild(3), stop_ns=n * 1000 * T) for n in (1, 2, 3, 4)]
    references = [python.execute(plan) for plan in plans]
    results: list[object] = [None] * 8

    def work(i):
        try:
            results[i] = (
                native.execute(plans[i // 2]) if i % 2 else isolated(wild(2), CRASH["SIGSEGV"])
            )
        except FmuError as error:
            results[i] = error

    threads = [threading.Thread(target=work, args=(i,)) for i in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for i in range(0, 8, 2):
        assert "crashed" in str(results[i])
        assert_equal(results[i + 1], references[i // 2])


def test_a_python_component_is_refused_by_name(stranger):
    with pytest.raises(ConfigurationError) as caught:
        native.execute(plan_of({"s": stranger(2), "clock": Clock}))
    assert str(caught.value) == (
        "clock: must be an FMU for the native master, got the Python component Clock"
    )


EMPTY = Record(np.zeros(1, np.int64), {})


def noted(seam, *masters):
    """The names of the masters, in the order in which they are asked to run something."""
    used = []
    for name, module in masters:
        seam.instead(module.execute, lambda *_, n=name: used.append(n) or EMPTY)
    return used


def test_native_is_the_default_where_it_can(stranger, seam):
    used = noted(seam, ("python here", python))
    seam.instead(isolation.execute, lambda *given: used.append(given[3]) or EMPTY)
    execution.execute(plan_of({"s": stranger(2)}))
    assert used == ["native"]
    execution.execute(plan_of({"s": stranger(2), "clock": Clock}))
    assert used[1:] == ["native", "python here"]
    fed = {"s": stranger(2), "clock": Clock, "relay": Relay}
    execution.execute(plan_of(fed, ("clock.count", "relay.count")), master="python")
    execution.execute(plan_of({"s": stranger(2)}), master="python")
    seam.instead(native.available, lambda: False)
    execution.execute(plan_of({"s": stranger(2)}))
    assert used[3:] == ["python", "python", "python"]


def test_components_of_ours_stay_in_this_process(seam):
    used = noted(seam, ("isolated", isolation), ("python", python), ("native", native))
    ours = ComponentSpec(build("target"), T)
    execution.execute(plan_of({"target": ours}))
    execution.execute(plan_of({"target": ours, "clock": Clock}))
    fed = {"target": ours, "clock": Clock, "relay": Relay}
    execution.execute(plan_of(fed, ("clock.count", "relay.count")))
    execution.execute(plan_of({"target": ours}), master="python")
    assert used == ["native", "native", "python", "python", "python"]


def test_without_a_compiler_native_is_not_available(seam):
    def none():
        raise BuildError("none")

    seam.instead(compilers.find, none)
    assert not native.available()


def test_an_unknown_master_is_refused_with_the_nearest_name(stranger):
    with pytest.raises(ConfigurationError, match=r"^master: must be .*'nativ'; did you mean 'nat"):
        execution.execute(plan_of({"s": stranger(2)}), master="nativ")


SANITIZED = """
import sys
from pathlib import Path
from sblcosim.simulation.masters import c_libraries
from sblcosim.simulation.masters import native, python as master
from test_native import assert_equal, ring
two, three, driver = map(Path, sys.argv[1:])
c_libraries.load = lambda name: __import__("ctypes").CDLL(str(driver))
plan = ring(two, three, 20, 30, stop_ns=6000)
assert_equal(native.execute(plan), master.execute(plan))
native.execute(plan, record=("b.y", "a.was_on"))
print("clean")
"""


@pytest.mark.parametrize("name", ["gcc", "zig"])
def test_the_loop_compiles_with(name):
    compiler = compilers.zig() if name == "zig" else compilers.system(name)
    if compiler is None:
        pytest.skip(f"there is no {name}")
    source = c_libraries.FOLDER / "native.c"
    compile_shared({"native.c": source.read_bytes()}, [Unit("native.c")], compiler)


def test_the_loop_touches_no_memory_that_is_not_its_own(wild, tmp_path):
    """Under AddressSanitizer and UndefinedBehaviorSanitizer, with arrays owned by NumPy."""
    driver = tmp_path / "native.so"
    source = c_libraries.FOLDER / "native.c"
    command = [
        "gcc",
        "-std=c11",
        "-g",
        "-O1",
        "-fPIC",
        "-shared",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-fsanitize=address,undefined",
        "-fno-sanitize-recover=all",
        "-o",
        driver,
        source,
    ]
    asan = (
        subprocess.run(
            ["gcc", "-print-file-name=libasan.so"], capture_output=True, text=True, check=False
        )
        if sys.platform == "linux"
        else None
    )
    if asan is None or subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("there is no gcc with AddressSanitizer")
    here = Path(__file__).parent
    paths = [str(p) for p in (here, here.parents[1] / "fmu" / "stranger")]
    done = subprocess.run(
        [sys.executable, "-c", SANITIZED, wild(2), wild(3), driver],
        env=os.environ | {
            "LD_PRELOAD": asan.stdout.strip(),
            "ASAN_OPTIONS": "detect_leaks=0",
            "PYTHONMALLOC": "malloc",
            "PYTHONPATH": os.pathsep.join([*paths, os.environ.get("PYTHONPATH", "")]),
        },
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stdout == "clean\n", done.stderr


def test_the_structures_are_those_of_the_loop(tmp_path):
    """Sizes and places of all members, as the compiler sees them."""
    source = (c_libraries.FOLDER / "native.c").read_text()
    renamed = {"source": "from", "target": "to"}
    structures = {"call": native.NativeCall, "copy": native.NativeCopy,
                  "conversion": native.NativeConversion,
                  "component": native.NativeComponent, "progress": Progress,
                  "run": native.NativeRun}  # fmt: skip
    expected, places = [], []
    for name, structure in structures.items():
        expected.append(ctypes.sizeof(structure))
        places.append(f"sizeof(struct {name})")
        for field in structure._fields_:
            expected.append(getattr(structure, field[0]).offset)
            places.append(f"offsetof(struct {name}, {renamed.get(field[0], field[0])})")
    source += f"EXPORT size_t places[] = {{{', '.join(places)}}};\n"
    library = tmp_path / "places.so"
    library.write_bytes(
        compile_shared({"places.c": source.encode()}, [Unit("places.c")], compilers.find())
    )
    found = (ctypes.c_size_t * len(places)).in_dll(ctypes.CDLL(str(library)), "places")
    assert list(found) == expected

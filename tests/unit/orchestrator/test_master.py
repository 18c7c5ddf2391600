import time
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from python_components import Arrays, Clock, Relay
from sblcosim.errors import ConfigurationError, FmuError
from sblcosim.fmus.host import instances
from sblcosim.models.declaration import Variable, input_, output
from sblcosim.simulation.masters.python import execute, initial_outputs
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import ComponentSpec, Connection, System
from seams import Seam
from stranger import build_stranger

MS = 1_000_000
T = 100 * MS


def run(components, *connections, stop_ns=10 * T, start_ns=0, progress=None):
    specs = {
        name: spec if isinstance(spec, ComponentSpec) else ComponentSpec(spec, T)
        for name, spec in components.items()
    }
    wires = tuple(Connection(*c) for c in connections)
    return execute(resolve(System(specs, wires, stop_ns, start_ns)), progress)


def assert_equal(a, b):
    assert np.array_equal(a.time_ns, b.time_ns)
    assert a.values.keys() == b.values.keys()
    for name, values in a.values.items():
        assert values.dtype == b.values[name].dtype
        assert np.array_equal(values, b.values[name]), name


@pytest.mark.parametrize("order", [("clock", "a", "b"), ("b", "a", "clock")])
def test_each_component_of_a_chain_is_one_interval_behind_its_source(order):
    """A component shows at t + h what its source showed at t, whatever the order of the steps."""
    parts = {"clock": Clock, "a": Relay, "b": Relay}
    record = run(
        {name: parts[name] for name in order},
        ("clock.count", "a.count"),
        ("a.relayed", "b.count"),
        stop_ns=5 * T,
    )
    assert record.values["clock.count"].tolist() == [0, 1, 2, 3, 4, 5]
    assert record.values["a.relayed"].tolist() == [-1, 0, 1, 2, 3, 4]
    assert record.values["b.relayed"].tolist() == [-1, -1, 0, 1, 2, 3]


def test_components_in_a_loop_see_each_other_one_interval_late():
    record = run(
        {"a": ComponentSpec(Relay, T, {"first": 1}), "b": ComponentSpec(Relay, T, {"first": 2})},
        ("a.relayed", "b.count"),
        ("b.relayed", "a.count"),
        stop_ns=3 * T,
    )
    assert record.values["a.relayed"].tolist() == [1, 2, 1, 2]
    assert record.values["b.relayed"].tolist() == [2, 1, 2, 1]


def test_an_input_that_is_not_connected_keeps_its_start_value():
    assert run({"a": Relay}, stop_ns=T).values["a.relayed"].tolist() == [-1, -7]


def test_a_component_with_a_longer_interval_holds_its_inputs_and_shows_outputs_at_the_end():
    """The slow one is set at 0 and 4; what it made of that is visible at 4 and 8, not before."""
    record = run(
        {"clock": ComponentSpec(Clock, 1), "slow": ComponentSpec(Relay, 4)},
        ("clock.count", "slow.count"),
        stop_ns=9,
    )
    assert record.time_ns.tolist() == list(range(9))
    assert record.values["slow.relayed"].tolist() == [-1] * 4 + [0] * 4 + [4]


def test_a_fast_component_sees_what_a_slow_one_showed_last():
    record = run(
        {"clock": ComponentSpec(Clock, 3), "fast": ComponentSpec(Relay, 1)},
        ("clock.count", "fast.count"),
        stop_ns=6,
    )
    assert record.values["fast.relayed"].tolist() == [-1, 0, 0, 0, 1, 1, 1]


def test_intervals_without_a_common_divisor_meet_at_their_multiples_only():
    record = run(
        {"a": ComponentSpec(Clock, 2), "b": ComponentSpec(Clock, 3)}, start_ns=10, stop_ns=16
    )
    assert record.time_ns.tolist() == [10, 12, 13, 14, 16]
    assert record.values["a.count"].tolist() == [0, 1, 1, 2, 3]
    assert record.values["b.count"].tolist() == [0, 0, 1, 1, 2]


def test_time_is_divided_never_accumulated(fmu: Path):
    record = run({"s": fmu, "c": Clock}, stop_ns=1000 * T, start_ns=7)
    point = (record.time_ns[:-1]) / 1e9
    assert np.array_equal(record.values["s.now"][1:], point + 0.1)
    assert np.array_equal(record.values["c.now"], record.time_ns / 1e9)


class Pair(Clock):
    """Two numbers with a unit, as the stranger takes them."""

    variables = (*Clock.variables, output("flat", "", "m", shape=(2,)))

    def initialise(self, start_ns, parameters):
        return {**super().initialise(start_ns, parameters), "flat": (0.0, 0.0)}

    def do_step(self, time_ns, step_ns, inputs):
        outputs = super().do_step(time_ns, step_ns, inputs)
        return {**outputs, "flat": (self.count * 0.5, -1.0 * self.count)}


def with_stranger(fmu, steps=6, **parameters):
    return run(
        {"pair": Pair, "s": ComponentSpec(fmu, T, parameters)},
        ("pair.flat", "s.u"),
        ("pair.count", "s.n"),
        ("pair.odd", "s.on"),
        stop_ns=steps * T,
    )


def test_all_types_reach_a_foreign_fmu_and_come_back(fmu: Path):
    record = with_stranger(fmu, gain=2.0, offset=(10.0, 20.0))
    u = np.array([[0.5 * k, -1.0 * k] for k in range(6)])
    y = record.values["s.y"]
    assert y.shape == (7, 2, 2)
    assert np.array_equal(y[0], np.zeros((2, 2)))
    assert np.array_equal(y[1:, :, 0], 2 * u + [10.0, 20.0])
    assert np.allclose(y[1:, :, 1], np.cumsum(0.1 * u, axis=0), rtol=1e-15)
    assert record.values["s.steps"].tolist() == [0, 0, 1, 3, 6, 10, 15]
    assert record.values["s.was_on"].tolist() == [False, False, True, False, True, False, True]
    assert record.values["s.was_on"].dtype == bool
    assert record.values["s.steps"].dtype == np.int32


def test_fmi_2_and_fmi_3_give_the_same_record_also_mixed(stranger):
    record = with_stranger(stranger(2), gain=0.3)
    assert_equal(record, with_stranger(stranger(3), gain=0.3))
    mixed = run(
        {"a": ComponentSpec(stranger(2), T), "b": ComponentSpec(stranger(3), T)},
        ("a.steps", "b.n"),
        ("b.was_on", "a.on"),
        ("b.steps", "a.n"),
    )
    swapped = run(
        {"a": ComponentSpec(stranger(3), T), "b": ComponentSpec(stranger(2), T)},
        ("a.steps", "b.n"),
        ("b.was_on", "a.on"),
        ("b.steps", "a.n"),
    )
    assert_equal(mixed, swapped)


def test_a_second_run_with_the_same_instance_gives_the_same_record(fmu: Path):
    first = with_stranger(fmu, gain=3.0)
    with_stranger(fmu, gain=5.0, offset=(1.0, 1.0))
    assert_equal(first, with_stranger(fmu, gain=3.0))


def test_a_parameter_that_is_not_set_again_has_its_start_value_again(fmu: Path):
    with_stranger(fmu, offset=(5.0, 5.0))
    assert with_stranger(fmu).values["s.y"][1, 0, 0] == 0.0


@pytest.mark.parametrize(("status", "label"), [(2, "Discard"), (3, "Error"), (4, "Fatal")])
def test_a_failed_step_names_component_time_call_and_what_the_fmu_said(fmu, status, label):
    with pytest.raises(FmuError) as caught:
        with_stranger(fmu, fail_at=0.35, fail_as=status)
    version = "23"["3.fmu" in fmu.name]
    assert str(caught.value) == (
        f"s: fmi{version}DoStep at 0.3 s must succeed, got {label}: cannot step over 0.35"
    )


def test_a_warning_does_not_stop_a_run(fmu):
    assert len(with_stranger(fmu, fail_at=0.35, fail_as=1)) == 7


def test_a_run_after_a_failed_one_is_as_if_nothing_had_happened(fmu: Path):
    reference = with_stranger(fmu)
    for status in (2, 3, 4):
        with pytest.raises(FmuError):
            with_stranger(fmu, fail_at=0.35, fail_as=status)
        assert_equal(with_stranger(fmu), reference)


def test_an_fmu_that_asks_to_terminate_stops_the_run_with_an_error(stranger):
    with pytest.raises(FmuError, match=r"at 0\.3 s .*FMU ended the simulation or the step early"):
        with_stranger(stranger(3), fail_at=0.35, fail_as=0)


def test_a_parameter_that_the_fmu_itself_refuses_shows_its_message(fmu: Path):
    with pytest.raises(FmuError, match=r"^s: fmi\dEnterInitializationMode must succeed, got Error: "
                       r"gain must not be negative, got -1$"):  # fmt: skip
        with_stranger(fmu, gain=-1.0)


class Interrupted(Clock):
    def do_step(self, time_ns, step_ns, inputs):
        if time_ns == 3 * T:
            raise KeyboardInterrupt
        return super().do_step(time_ns, step_ns, inputs)


def test_ctrl_c_passes_through_and_leaves_the_instances_usable(fmu: Path):
    reference = with_stranger(fmu)
    with pytest.raises(KeyboardInterrupt):
        run({"c": Interrupted, "s": fmu}, ("c.count", "s.n"))
    assert_equal(with_stranger(fmu), reference)


def test_progress_grows_to_one_and_is_reported_rarely(monkeypatch):
    now = iter(np.arange(0.0, 1e6, 0.03))  # every look at the clock is 30 ms later
    monkeypatch.setattr(time, "monotonic", lambda: next(now))
    shares: list[float] = []
    run({"c": Clock}, stop_ns=100 * T, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert 10 < len(shares) < 100 * 0.03 / 0.1 + 2


def test_progress_is_the_share_of_the_steps_that_are_done(monkeypatch):
    now = iter(np.arange(0.0, 1e6, 0.25))  # so much later that each step is reported
    monkeypatch.setattr(time, "monotonic", lambda: next(now))
    shares: list[float] = []
    run({"c": Clock}, stop_ns=8 * T, progress=shares.append)
    assert shares == [*(np.arange(1, 9) / 8), 1.0]


def test_a_warning_of_any_call_does_not_stop_a_run(fmu: Path, seam: Seam):
    reference, original = with_stranger(fmu), instances.acquire
    warned, used = [], []

    def warning(call):
        def called(*arguments):
            warned.append(status := max(call(*arguments), instances.WARNING))
            return status
        return called

    def acquired(*given):
        made = original(*given)
        for name in ("getter", "setter", "stepper"):
            own = getattr(made, name)
            setattr(made, name, lambda *it, own=own: warning(own(*it)))
            used.append((made, name))
        return made

    seam.instead(instances.acquire, acquired)
    assert_equal(with_stranger(fmu), reference)
    assert len(warned) > 3 * len(reference.time_ns)
    for made, name in used:  # another run may take it
        delattr(made, name)


class Careless(Clock):
    """Returns what `answer` says, after its first output."""

    answer: ClassVar[dict[str, object]] = {}

    def do_step(self, time_ns, step_ns, inputs):
        return {"count": 1, "now": 0.0, "odd": True} | self.answer


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ({"more": 1}, "c at 0.1 s: must return exactly its outputs, got too few or too many: more"),
        ({"count": 1.5}, "c at 0.1 s: count must be int32, got float64"),
        ({"now": (1.0, 2.0)}, "c at 0.1 s: now must have the shape (), got (2,)"),
    ],
)
def test_a_python_component_must_keep_to_its_declaration(answer, message):
    kind = type("Kind", (Careless,), {"answer": answer})
    with pytest.raises(ConfigurationError) as caught:
        run({"c": kind})
    assert str(caught.value) == message


def test_a_python_component_gets_arrays_in_their_shapes():
    record = run(
        {"a": ComponentSpec(Arrays, T, {"scale": tuple(range(6))}), "b": Arrays},
        ("a.doubled", "b.matrix"),
        stop_ns=2 * T,
    )
    scale = np.arange(6.0).reshape(2, 3)
    assert np.array_equal(record.values["a.doubled"][0], scale)
    assert np.array_equal(record.values["b.doubled"][1], 2 * scale)


class Several(Clock):
    """Puts out its inputs of one type, one after the other."""

    variables = (
        input_("time", "", "s"), input_("matrix", "", "m", shape=(2, 3)),
        input_("flat", "", "m", shape=(2,)), output("seen", "", shape=(9,)),
    )  # fmt: skip

    def initialise(self, start_ns, parameters):
        return {"seen": np.zeros(9)}

    def do_step(self, time_ns, step_ns, inputs):
        assert [v.shape for v in inputs.values()] == [(), (2, 3), (2,)]
        return {"seen": np.concatenate([v.ravel() for v in inputs.values()])}


def test_inputs_of_one_type_reach_a_python_component_each_by_itself():
    scale = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    record = run(
        {"several": Several, "pair": Pair, "a": ComponentSpec(Arrays, T, {"scale": scale})},
        ("pair.flat", "several.flat"),
        ("a.doubled", "several.matrix"),
        ("pair.now", "several.time"),
        stop_ns=2 * T,
    )
    assert record.values["several.seen"].tolist() == [
        [0.0] * 9, [0.0, *scale, 0.0, 0.0], [0.1, *[0.0] * 6, 0.5, -1.0]
    ]  # fmt: skip


def test_a_component_on_a_record_of_the_others_is_what_it_is_beside_them():
    """What is played back stays in its places, whatever is next to them and not due."""
    others = {"clock": ComponentSpec(Clock, 4), "a": ComponentSpec(Relay, 2)}
    system = System(
        {**others, "late": ComponentSpec(Relay, 3, {"first": 5}), "b": ComponentSpec(Relay, 1)},
        (Connection("clock.count", "late.count"), Connection("a.relayed", "b.count")), 24,
    )  # fmt: skip
    whole = execute(resolve(system))
    played = execute(resolve(System(others, (), 24)))
    own = ["late.relayed", "b.relayed"]
    again = execute(resolve(system), record=own, played=played)
    assert_equal(again, replace(whole, values={name: whole.values[name] for name in own}))
    assert len(set(again.values["late.relayed"].tolist())) == 6


class Greedy(Relay):
    variables = (*Relay.variables[:1], Variable("count", "", "input", type="Int32", start=0),
                 output("relayed", "", type="Int32"))  # fmt: skip

    def do_step(self, time_ns, step_ns, inputs):
        inputs["count"][...] = 3
        return {"relayed": 0}


def test_a_python_component_cannot_change_its_inputs():
    with pytest.raises(ConfigurationError, match=r"^g at 0 s: .* ValueError: .* read-only \(Gr"):
        run({"g": Greedy})


@pytest.mark.parametrize(
    ("raised", "message"),
    [
        (KeyError("x"), "c at 0.3 s: must not raise an exception, got KeyError: 'x'"),
        (SystemExit(0), "c at 0.3 s: must not raise an exception, got SystemExit: 0"),
        (ValueError("two\nlines"), "c at 0.3 s: must not raise an exception, got ValueError: "
                                   "two lines"),
    ],
)  # fmt: skip
def test_an_exception_in_a_python_component_names_it_and_the_time(raised, message):
    class Raising(Clock):
        def do_step(self, time_ns, step_ns, inputs):
            if time_ns == 3 * T:
                raise raised
            return super().do_step(time_ns, step_ns, inputs)

    with pytest.raises(ConfigurationError) as caught:
        run({"other": Clock, "c": Raising})
    line = Raising.do_step.__code__.co_firstlineno + 2
    assert str(caught.value) == f"{message} (Raising in test_master.py, line {line})"
    assert caught.value.component == "c"
    assert caught.value.__cause__ is raised


def test_an_exception_before_the_start_of_a_python_component_names_it():
    class Unready(Clock):
        def initialise(self, start_ns, parameters):
            raise ZeroDivisionError

    with pytest.raises(ConfigurationError) as caught:
        run({"c": Unready})
    assert str(caught.value) == (
        "c before the start: must not raise an exception, got ZeroDivisionError: ZeroDivisionError "
        f"(Unready in test_master.py, line {Unready.initialise.__code__.co_firstlineno + 1})"
    )


def test_a_python_component_must_return_a_mapping():
    class Nothing(Clock):
        def do_step(self, time_ns, step_ns, inputs):
            return None

    with pytest.raises(ConfigurationError, match=r"^c at 0\.1 s: must return .*, got None$"):
        run({"c": Nothing})


def test_initial_outputs_are_those_at_the_start(fmu: Path):
    outputs = initial_outputs(ComponentSpec(fmu, T), ("y", "now"), start_ns=5 * T)
    assert outputs.keys() == {"y", "now"}
    assert outputs["now"] == 0.5
    assert outputs["y"].shape == (2, 2)
    assert initial_outputs(ComponentSpec(Relay, T, {"first": 9}), ("relayed",))["relayed"] == 9


def test_an_unknown_initial_output_is_refused_with_the_nearest_name(fmu: Path):
    with pytest.raises(ConfigurationError, match=r"must have an output 'step', .*mean 'steps'\?$"):
        initial_outputs(ComponentSpec(fmu, T), ("step",))


def test_many_runs_need_one_instance(fmu: Path, monkeypatch):
    made = []
    original = instances.Instance.__init__

    def counted(self, *arguments):
        made.append(arguments)
        original(self, *arguments)

    monkeypatch.setattr(instances.Instance, "__init__", counted)
    for _ in range(20):
        run({"many": fmu}, stop_ns=T)
    assert len(made) <= 1


def test_two_components_of_one_fmu_do_not_share_their_state(fmu: Path):
    record = run(
        {"x": ComponentSpec(fmu, T, {"offset": (1.0, 0.0)}), "z": fmu, "c": Clock},
        ("c.count", "x.n"),
    )
    assert record.values["x.y"][1, 0, 0] == 1.0
    assert record.values["z.y"][1, 0, 0] == 0.0
    assert record.values["z.steps"][-1] == 10
    assert record.values["x.steps"][-1] == 45


def test_an_fmu_that_can_be_instantiated_once_only_is_refused_twice(tmp_path):
    once = '<CoSimulation canBeInstantiatedOnlyOncePerProcess="true"'
    path = build_stranger(2, tmp_path, lambda text: text.replace("<CoSimulation", once))
    with pytest.raises(
        ConfigurationError, match=r"^b: stranger2.fmu can be instantiated only once"
    ):
        run({"a": path, "b": path})
    run({"a": path}, stop_ns=T)
    run({"b": path}, stop_ns=T)

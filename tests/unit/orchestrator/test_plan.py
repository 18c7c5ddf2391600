import os
from importlib import resources
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from python_components import Arrays, Clock, Relay, Sampler, Source, Updater
from sblcosim.errors import ConfigurationError, ConfigurationWarning
from sblcosim.fmus.host.nanoseconds import MAX_SECONDS
from sblcosim.simulation.plans.checks import check_size
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import ComponentSpec, Connection, System

MS = 1_000_000
T = 100 * MS


def system(components, *connections, stop_ns=1000 * MS, start_ns=0):
    specs = {
        name: spec if isinstance(spec, ComponentSpec) else ComponentSpec(spec, T)
        for name, spec in components.items()
    }
    return System(specs, tuple(Connection(*c) for c in connections), stop_ns, start_ns)


def refusal(*arguments, **keywords):
    """The message, in one line, with which a system is refused."""
    with pytest.raises(ConfigurationError) as caught:
        resolve(system(*arguments, **keywords))
    message = str(caught.value)
    assert "\n" not in message
    return message


CLOCKED = {"clock": Clock, "relay": Relay, "arrays": Arrays, "other": Arrays}


@pytest.mark.parametrize(
    ("connection", "message"),
    [
        (("clok.count", "relay.count"), "'clok' must be a component of the system; did you mean "
                                        "'clock'?"),
        (("clock.count", "rely.count"), "'rely' must be a component of the system; did you mean "
                                        "'relay'?"),
        (("clock.cont", "relay.count"), "'cont' must be an output of clock, got an unknown name; "
                                        "did you mean 'count'?"),
        (("clock.count", "relay.cuont"), "'cuont' must be an input of relay, got an unknown name; "
                                         "did you mean 'count'?"),
        (("relay.count", "relay.count"), "relay.count must be an output, got an input"),
        (("clock.count", "relay.relayed"), "relay.relayed must be an input, got an output"),
        (("clock.count", "relay.first"), "relay.first must be an input, got a parameter"),
        (("clock.now", "relay.count"), "both ends must have the same type, got Float64 and Int32"),
        (("arrays.flat", "other.matrix"), "both ends must have the same shape, got 6 and 2×3"),
        (("arrays.speed", "other.matrix"), "both ends must have the same unit, got m/s and m"),
    ],
)  # fmt: skip
def test_a_wrong_connection_is_refused_by_name(connection, message):
    expected = f"connection {connection[0]} -> {connection[1]}: {message}"
    assert refusal(CLOCKED, connection) == expected


def test_a_missing_unit_is_a_warning():
    with pytest.warns(ConfigurationWarning, match=r"same unit, got none and m$") as caught:
        resolve(system(CLOCKED, ("arrays.plain", "other.matrix")))
    assert caught[0].filename == __file__  # it points at the caller


def test_an_input_connected_twice_is_refused():
    message = refusal(
        {"clock": Clock, "second": Clock, "relay": Relay},
        ("clock.count", "relay.count"),
        ("second.count", "relay.count"),
    )
    assert message.endswith("an input must have one source, got clock.count as well")


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"scael": 1.0}, "a.scael: must be a parameter of a, got an unknown name; did you mean "
                         "'scale'?"),
        ({"matrix": 1.0}, "a.matrix: must be a parameter, got an input"),
        ({"scale": (1.0, 2.0)}, "a.scale: must be 6 numbers, got 2"),
        ({"scale": 1.0}, "a.scale: must be 6 numbers, got 1"),
        ({"mode": (1,)}, "a.mode: must be one number, got 1"),
        ({"scale": (0, 0, 0, 0, 11.0, 0)}, "a.scale[2,2]: must be at most 10 m, got 11.0 m"),
        ({"scale": (-1e-9, 0, 0, 0, 0, 0)}, "a.scale[1,1]: must be at least 0 m, got -1e-09 m"),
        ({"scale": (0, 0, float("nan"), 0, 0, 0)}, "a.scale[1,3]: must be finite, got nan"),
        ({"scale": (0, "x", 0, 0, 0, 0)}, "a.scale[1,2]: must be a number, got 'x'"),
        ({"scale": (0, True, 0, 0, 0, 0)}, "a.scale[1,2]: must be a number, got True"),
        ({"mode": 1.5}, "a.mode: must be a whole number, got 1.5"),
        ({"mode": 4}, "a.mode: must be at most 3, got 4"),
        ({"on": 1}, "a.on: must be true or false, got 1"),
    ],
)  # fmt: skip
def test_a_wrong_parameter_is_refused_by_name(parameters, message):
    assert refusal({"a": ComponentSpec(Arrays, T, parameters)}) == message


@pytest.mark.parametrize(
    ("key", "got"),
    [("scael", "an unknown name"), ("scale", "Float64 of 6"), ("mode", "Int32 of 1")],
)
def test_a_text_for_what_takes_none_is_refused_by_name(key, got):
    message = refusal({"a": ComponentSpec(Arrays, T, texts={key: "file.csv"})})
    assert message == f"a.{key}: must be a single text of an FMU, got {got}"


def test_an_int32_parameter_without_bounds_must_fit_its_type():
    message = refusal({"r": ComponentSpec(Relay, T, {"first": 2**31})})
    assert message == "r.first: must be at most 2147483647, got 2147483648"


@pytest.mark.parametrize(
    "scale", [range(6), [[0, 1, 2], [3, 4, 5]], np.arange(6.0).reshape(2, 3), (*np.arange(6.0),)]
)
def test_array_parameters_may_be_flat_or_nested(scale):
    value = tuple(scale) if isinstance(scale, range) else scale
    plan = resolve(system({"a": ComponentSpec(Arrays, T, {"scale": value})}))
    assert plan.components[0].settings[0].values == (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)


@pytest.mark.parametrize("interval", [0, -1, 0.1, True])
def test_an_interval_that_is_no_positive_whole_number_is_refused(interval):
    assert refusal({"clock": ComponentSpec(Clock, interval)}) == (
        f"clock: the communication interval must be a positive whole number of ns, got {interval!r}"
    )


def test_a_stop_that_is_not_after_the_start_is_refused():
    assert refusal({"c": Clock}, stop_ns=5, start_ns=5).startswith("system: the stop must be after")


def test_a_run_shorter_than_a_common_multiple_is_refused():
    message = refusal({"a": ComponentSpec(Clock, 4), "b": ComponentSpec(Clock, 6)}, stop_ns=11)
    assert "least common multiple of all communication intervals, 0.000000012 s" in message


def test_a_run_ends_at_the_last_common_multiple_counted_from_the_start():
    plan = resolve(
        system({"a": ComponentSpec(Clock, 4), "b": ComponentSpec(Clock, 6)}, start_ns=1, stop_ns=29)
    )
    assert plan.stop_ns == 25
    assert plan.instants.tolist() == [1, 5, 7, 9, 13, 17, 19, 21, 25]


def test_a_name_with_a_dot_is_refused():
    assert refusal({"a.b": Clock}) == "component 'a.b': the name must not contain a dot"


def test_a_system_without_components_is_refused():
    assert refusal({}) == "system: must have at least one component, got none"


@pytest.mark.parametrize("interval", [30 * MS, 200 * MS])
def test_a_tick_inside_the_interval_of_a_component_with_inputs_is_refused(interval):
    message = refusal({"s": ComponentSpec(Sampler, interval)})
    assert message.startswith("s: the communication interval must divide sampling_time, 0.1 s, got")


@pytest.mark.parametrize("interval", [30 * MS, 200 * MS])
def test_a_component_without_inputs_may_step_over_its_ticks(interval):
    resolve(system({"s": ComponentSpec(Source, interval)}))


def test_the_start_value_of_the_tick_interval_counts_unless_it_is_set():
    resolve(system({"s": ComponentSpec(Sampler, 30 * MS, {"sampling_time": 0.06})}))


@pytest.mark.parametrize("value", [1 / 3, 0.0, -0.1, 1 + 1.5e-12])
def test_a_tick_interval_that_is_no_whole_number_of_ns_is_refused(value):
    message = refusal({"s": ComponentSpec(Sampler, T, {"sampling_time": value})})
    assert message.startswith("s.sampling_time: must be a positive whole number of ns, got")


def test_a_tick_interval_may_be_wrong_by_rounding():
    plan = resolve(system({"s": ComponentSpec(Sampler, T, {"sampling_time": 1 + 0.5e-12})}))
    assert plan.components[0].tick_ns == 10 * T


def test_a_source_that_is_stale_at_a_tick_is_refused():
    message = refusal(
        {"source": ComponentSpec(Source, 2 * T), "sampler": Sampler},
        ("source.position", "sampler.position"),
    )
    assert message == (
        "source: the communication interval must divide sampler.sampling_time, 0.1 s, as sampler "
        "uses its position, got 0.2 s"
    )


@pytest.mark.parametrize(("update_interval", "accepted"), [(0.4, True), (0.1, True), (0.25, False)])
def test_updates_are_a_whole_multiple_of_the_pings(update_interval, accepted):
    parts = {
        "acoustics": ComponentSpec(Sampler, 50 * MS),
        "ekf": ComponentSpec(Updater, 50 * MS, {"update_interval": update_interval}),
    }
    connection = ("acoustics.range_epoch", "ekf.range_epoch")
    if accepted:
        resolve(system(parts, connection))
    else:
        assert refusal(parts, connection) == (
            "ekf.update_interval: must be a whole multiple of acoustics.sampling_time, 0.1 s, got "
            "0.25 s"
        )


def test_neither_a_path_nor_a_factory_is_refused():
    assert refusal({"a": ComponentSpec("a.fmu", T)}) == (
        "a: must be the path of an FMU or make a Python component, got 'a.fmu'"
    )


def test_a_plan_prints_references_settings_and_connections(fmu: Path):
    plan = resolve(
        system(
            {"clock": Clock, "s": ComponentSpec(fmu, 2 * T, {"offset": (1.5, -2.0)})},
            ("clock.count", "s.n"),
            ("clock.odd", "s.on"),
        )
    )
    lines = [line.split() for line in plan.text(verbose=True).splitlines()]
    assert str(plan) == plan.text() == plan.text(verbose=True).split("\n\ncomponent  sha")[0]
    version = plan.components[1].source.fmi
    assert lines[0] == ["Run", "from", "0", "s", "to", "1", "s:", "11", "communication", "instants"]
    assert ["s", fmu.name, str(version), "0.2", "s", "clock"] in lines
    assert ["s", plan.components[1].source.sha256[:12]] in lines
    offset = "200-201" if version == 2 else "200"
    assert ["s.offset", "Float64", offset, "1.5", "-2", "m"] in lines
    assert ["s.n", "Int32", "1200", "clock.count"] in lines
    assert ["s.on", "Boolean", "2100", "clock.odd"] in lines
    assert ["s.y[2×2]", "Float64", "500-503" if version == 2 else "500", "1-4"] in lines


def test_all_outputs_of_one_type_are_read_by_one_call(fmu: Path):
    (component,) = resolve(system({"s": ComponentSpec(fmu, T)})).components
    assert [(r.type, r.stop - r.start) for r in component.reads] == [
        ("Float64", 5),
        ("Int32", 1),
        ("Boolean", 1),
    ]


@pytest.mark.parametrize("intervals", [(4,), (4, 6), (4, 8, 2), (6, 10, 15), (4, 6, 9, 12)])
def test_instants_are_counted_without_being_listed(intervals):
    parts = {f"c{i}": ComponentSpec(Clock, n) for i, n in enumerate(intervals)}
    plan = resolve(system(parts, start_ns=3, stop_ns=1000))
    assert plan.count == len(plan.instants)


def test_a_record_that_the_memory_cannot_hold_is_refused():
    plan = resolve(system({"clock": ComponentSpec(Clock, 1)}, stop_ns=4_000_000 * MS))
    with pytest.raises(ConfigurationError) as caught:
        check_size(plan, memory=8_000_000_000)
    assert str(caught.value).startswith(
        "record: must take at most 2 GB (25 % of the memory), got 84000 GB for "
        "4000000000001 communication instants"
    )
    small = resolve(system({"clock": Clock}))
    assert small.row_size == 8 + 4 + 8 + 1
    check_size(small, memory=4 * small.row_size * small.count)
    with pytest.raises(ConfigurationError):
        check_size(small, memory=4 * small.row_size * small.count - 1)


@pytest.mark.parametrize("failure", [AttributeError, ValueError, OSError])
def test_a_machine_that_does_not_tell_its_memory_is_taken_to_have_8_gib(failure, monkeypatch):
    def refuse(name):
        raise failure

    small = resolve(system({"clock": Clock}))
    most = 2 * 1024**3 // small.row_size  # a quarter of it
    monkeypatch.setattr(os, "sysconf", refuse, raising=False)
    check_size(SimpleNamespace(count=most, row_size=small.row_size))
    with pytest.raises(ConfigurationError):
        check_size(SimpleNamespace(count=most + 1, row_size=small.row_size))


def test_the_memory_is_that_of_the_machine(monkeypatch):
    told = {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 1000}
    monkeypatch.setattr(os, "sysconf", told.__getitem__, raising=False)
    check_size(SimpleNamespace(count=1000, row_size=1024))
    with pytest.raises(ConfigurationError):
        check_size(SimpleNamespace(count=1001, row_size=1024))


def test_a_run_beyond_the_times_of_the_engine_is_refused():
    assert refusal({"clock": Clock}, stop_ns=4 * 10**18) == (
        "system: the stop must be before 4e+09 s, got 4e+09 s"
    )


def test_the_limit_of_times_is_that_of_the_engine():
    header = (resources.files("sblcosim.fmus") / "c" / "engine.h").read_text()
    assert f"#define MAX_SECONDS {MAX_SECONDS:g}".replace("e+0", "e") in header

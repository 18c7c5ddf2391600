"""The time contract: what comes out does not depend on how the time was cut into steps."""

from __future__ import annotations

import numpy as np
import pytest
from quick import one_in
from sblcosim.models import COMPONENTS, RECEIVERS

from .host import (
    DISCARD,
    ERROR,
    NOISY,
    TICKS,
    Array,
    T,
    Values,
    assert_same_bits,
    chain,
    grid,
    host,
    refused,
)

BOTH = pytest.mark.parametrize("fmi", [2, 3])
FED = ("acoustics", *RECEIVERS)
"""Components with ticks and inputs."""

PATHS: dict[str, Values] = {
    **{f"target {i}": {"trajectory": i, "departure_time": 0.33, "seed": 5, "speed": 1.3,
                       "path_length": 8.0, "radius": 2.0, "side": 2.0, "leg_length": 0.7,
                       "waypoint_count": 3, "waypoint": np.arange(192) % 7, "depth_end": 8.0}
       for i in range(1, 9)},
    "platform": NOISY["platform"],
}


@pytest.mark.parametrize("case", PATHS)
def test_any_steps_give_the_same_outputs_where_they_meet(case: str) -> None:
    """Components without inputs take steps of any size, over ticks and between them."""
    name = case.split()[0]
    instance = host(name)
    expected = instance.start(PATHS[case]).run(grid(200, T / 2))
    assert np.ptp(expected, axis=0).max() > 0
    one_step = instance.start(PATHS[case]).run([0.0, 100 * T])
    assert_same_bits(one_step[-1], expected[-1])

    rng = np.random.default_rng(3)
    for _ in range(4):
        between = rng.uniform(0.0, 100 * T, 150).round(7)
        times = np.unique(np.concatenate([[0.0], between, np.array(grid(20, 5 * T))]))
        record = instance.start(PATHS[case]).run(times.tolist())
        common = np.isin(times[1:], grid(20, 5 * T)[1:])
        assert common.sum() == 20
        assert_same_bits(record[common], expected[9::10])


@one_in(2)
@BOTH
@pytest.mark.parametrize("parts", [2, 5])
@pytest.mark.parametrize("name", ["target", "platform", *FED])
def test_parts_of_the_interval_give_the_same_outputs(name: str, parts: int, fmi: int) -> None:
    instance, inputs = host(name, fmi), chain()[name]
    expected = instance.start(NOISY[name]).run(grid(TICKS), inputs)
    fine = None if inputs is None else np.repeat(inputs, parts, axis=0)
    record = instance.start(NOISY[name]).run(grid(TICKS * parts, T / parts), fine)
    assert_same_bits(record[parts - 1 :: parts], expected)


@pytest.mark.parametrize("name", RECEIVERS)
def test_receiver_stepped_at_t_equals_one_stepped_at_its_update_interval(name: str) -> None:
    ratio, inputs = 4, chain()[name]
    assert inputs is not None
    parameters = {**NOISY[name], "update_interval": ratio * T}
    instance = host(name)
    every = instance.start(parameters).run(grid(TICKS), inputs)
    rare = instance.start(parameters).run(grid(TICKS // ratio, ratio * T), inputs[::ratio])
    assert instance.column(rare, "update_count")[-1] > 15
    assert_same_bits(every[ratio - 1 :: ratio], rare)


@BOTH
@pytest.mark.parametrize("name", FED)
def test_tick_strictly_inside_a_step_is_refused(name: str, fmi: int) -> None:
    instance = host(name, fmi).start(NOISY[name])
    instance.run(grid(3), chain()[name])
    before = instance.save()
    instance.messages.clear()
    assert refused(instance.step, 3 * T, 2 * T) == DISCARD
    assert "tick inside, at 0.4" in instance.messages[-1]
    assert instance.save() == before
    instance.step(3 * T, T)
    assert instance.save() != before


def short_steps(rng: np.random.Generator, ticks: int) -> tuple[list[float], list[int]]:
    """Communication points with many steps too short to hold a nanosecond.

    Returns
    -------
    times
        From 0 to the last tick: some clusters anywhere, and one about each tick, all of it within
        half a nanosecond.
    of_tick
        How many ticks are before or at each of `times`.
    """
    times, of_tick = [0.0], [0]
    for k in range(1, ticks + 1):
        between = rng.uniform((k - 1) * T + 1e-6, k * T - 1e-6, rng.integers(0, 3))
        clusters = [t + np.cumsum(10.0 ** rng.uniform(-13, -8, 5)) for t in between]
        about = k * T + rng.uniform(-0.4e-9, 0.4e-9, rng.integers(1, 4))
        for points, n in ((np.concatenate([[], *clusters]), k - 1), (about, k)):
            found = np.unique(points).tolist()
            times += found
            of_tick += [n] * len(found)
    return times, of_tick


@BOTH
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("name", ["target", "platform", *FED])
def test_steps_of_any_length_give_the_regular_record(name: str, seed: int, fmi: int) -> None:
    ticks = 30
    instance, inputs = host(name, fmi), chain()[name]
    expected = instance.start(NOISY[name]).run(grid(ticks), inputs)
    times, of_tick = short_steps(np.random.default_rng(seed), ticks)
    assert (np.diff(times) > 0).all()
    assert (np.diff(times) < 1e-10).sum() > 5
    record = instance.start(NOISY[name]).run(
        times, None if inputs is None else inputs[of_tick[:-1]]
    )
    at_tick = [i for i, n in enumerate(of_tick[1:]) if abs(times[i + 1] - n * T) < 0.5e-9]
    assert_same_bits(record[at_tick], expected[[of_tick[i + 1] - 1 for i in at_tick]])


@BOTH
@pytest.mark.parametrize("rest", [4e-10, 1e-12, 1e-17])
@pytest.mark.parametrize("name", COMPONENTS)
def test_run_may_end_with_a_remainder_of_no_length(name: str, rest: float, fmi: int) -> None:
    instance, inputs = host(name, fmi), chain()[name]
    instance.start(NOISY[name])
    record = instance.run(grid(20), inputs)
    instance.step(20 * T, rest)
    assert_same_bits(instance.outputs(), record[-1])
    assert refused(instance.step, 20 * T, 0.0) == ERROR
    assert "the step must be positive, got 0 s" in instance.messages[-1]


def accumulated(steps: int, size: float) -> list[float]:
    """Communication points as many masters compute them, t += h."""
    times = [0.0]
    for _ in range(steps):
        times.append(times[-1] + size)
    return times


def test_accumulated_time_brings_no_tick_early() -> None:
    """100,000 steps of 0.1 s are 19 ns too much; a tick at the end of a step stays outside."""
    times = accumulated(100_000, T)
    assert 1e-9 < times[-1] - 1e4 < 1e-6
    target = host("target").start()
    for i, t in enumerate(times[:-1]):
        target.step(t, T)
        if i % 10 == 0:
            assert target.get("depth_epoch") == i / 10


def test_accumulated_time_has_no_tick_inside_a_step() -> None:
    """100,000 steps of 0.02 s fall short by more than a nanosecond.

    After 869 s the first tick would slip inside a step, which a component with inputs refuses.
    """
    ticks = 20_000
    times = accumulated(5 * ticks, T / 5)
    assert -1e-6 < times[-1] - 2000.0 < -1e-9
    acoustics = host("acoustics").start({"loss_probability": 0.0})
    for t in times[:-1]:
        acoustics.step(t, T / 5)
    assert acoustics.get("reception_count").sum() == ticks - 1


@BOTH
def test_steps_of_no_length_do_not_creep_backwards(fmi: int) -> None:
    """Each may begin a nanosecond before the end of the last one that got on, and no earlier."""
    instance = host("target", fmi).start()
    end, nothing = T - 1e-8, 1e-12  # so near to the tick that the step ends there
    instance.step(0.0, end)
    for _ in range(3):
        instance.step(end - 1e-9, nothing)
    assert refused(instance.step, end - 2e-9, nothing) == ERROR
    instance.step(end, T)


@BOTH
@pytest.mark.parametrize("name", [n for n, c in COMPONENTS.items() if c.interval])
def test_interval_of_broken_nanoseconds_is_refused(name: str, fmi: int) -> None:
    instance = host(name, fmi)
    interval = str(instance.component.interval)
    instance.messages.clear()
    assert refused(instance.start, {interval: 1.0 / 3.0}) == ERROR
    assert f"{instance.name}: {interval} must be a whole number of nanoseconds" in (
        instance.messages[-1]
    )
    assert "0.333333333" in instance.messages[-1]
    instance.start({interval: 0.3})


@BOTH
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_times_end_below_the_largest(fmi: int, sign: float) -> None:
    instance = host("target", fmi)
    assert refused(instance.start, {}, sign * 4e9) == ERROR
    assert "must be finite and below 4e+09 s" in instance.messages[-1]
    instance.start({}, sign * np.nextafter(4e9, 0))


@BOTH
@pytest.mark.parametrize(("point", "size"), [(np.inf, T), (0.0, np.nan), (4e9, T)])
def test_a_step_without_a_time_is_an_error(fmi: int, point: float, size: float) -> None:
    instance = host("target", fmi).start()
    assert refused(instance.step, point, size) == ERROR
    assert "doStep: the communication point and its step must be finite" in instance.messages[-1]


@BOTH
def test_a_refused_value_is_told_with_its_bounds_if_it_has_any(fmi: int) -> None:
    instance = host("target", fmi).start()
    for values, told in (
        ({"center": [np.nan, 0.0]}, "center[1] must be finite, got nan"),
        ({"speed": -1.0}, "speed (0 to "),
    ):
        assert refused(instance.start, values) == ERROR
        assert told in instance.messages[-1]


def shifted(name: str, inputs: Array | None, start: float) -> Array | None:
    """The inputs of a run that begins later: epochs move, the rest stays."""
    if inputs is None:
        return None
    declared = COMPONENTS[name].of("input")
    epochs = np.concatenate([np.full(v.size, v.name.endswith("epoch")) for v in declared])
    return np.where(epochs, inputs + start, inputs)


@BOTH
@pytest.mark.parametrize("name", ["target", "platform", *FED])
def test_later_start_gives_the_same_sequence(name: str, fmi: int) -> None:
    """Ticks and noise are counted from the start.

    A time rounds differently after 64 s, so what is computed from it agrees only nearly; fixes
    agree to the step that ends their iteration, 1e-7 m. The platform's waves are a function of the
    time itself; 64 s are whole periods of theirs.
    """
    start, instance = 64.0, host(name, fmi)
    tolerance = 1e-6 if name in RECEIVERS else 1e-9
    expected = instance.start(NOISY[name]).run(grid(TICKS), chain()[name])
    record = instance.start(NOISY[name], start).run(
        grid(TICKS, start=start), shifted(name, chain()[name], start)
    )
    for v in instance.component.of("output"):
        late, early = instance.column(record, v.name), instance.column(expected, v.name)
        if v.name.endswith("epoch"):
            late = late - start
        np.testing.assert_allclose(late, early, rtol=tolerance, atol=tolerance, err_msg=v.name)
        if v.type != "Float64":
            np.testing.assert_array_equal(late, early)


@pytest.mark.parametrize("name", COMPONENTS)
def test_fmi_2_and_fmi_3_agree_to_the_bit(name: str) -> None:
    records = [host(name, fmi).start(NOISY[name]).run(grid(TICKS), chain()[name]) for fmi in (2, 3)]
    assert np.ptp(records[0], axis=0).max() > 0
    assert_same_bits(*records)


def test_nothing_happens_at_the_start() -> None:
    """The first tick is one interval after the start, and its result is there a step later."""
    target = host("target").start(NOISY["target"])
    assert target.get("depth") == 0
    record = target.run(grid(3))
    np.testing.assert_array_equal(target.column(record, "depth_epoch"), [0.0, 0.1, 0.2])
    assert target.column(record, "depth")[0] == 0
    acoustics = host("acoustics").start({"seed": 1})
    record = acoustics.run(grid(3), chain()["acoustics"])
    np.testing.assert_array_equal(
        acoustics.column(record, "reception_count"), [[0, 0, 0, 0], [1, 0, 0, 0], [1, 1, 0, 0]]
    )
    np.testing.assert_array_equal(acoustics.column(record, "range_epoch")[-1], [0.1, 0.2, 0, 0])

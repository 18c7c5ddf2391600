"""The sums of a recorded run are those that the lanes master makes while it goes on."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
from quick import one_in
from sblcosim.data.record import Record
from sblcosim.errors import FmuError
from sblcosim.judge import metrics
from sblcosim.judge.definitions import FRAMES
from sblcosim.results.responses import Run
from sblcosim.results.sums import SUMS, responses, sums_of
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.execution import MASTERS, execute
from sblcosim.simulation.masters import lanes, lanes_driver, lanes_layout
from sblcosim.simulation.plans.plan import Plan, Setting
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import System
from scipy.stats import chi2
from seams import Seam
from synthetic_record import make_record, silent, summary, track

RECEIVERS = ("ekf", "sequential", "multilateration")
WITH_OWN = (*RECEIVERS, "coupled")
SECOND = 1_000_000_000
SEEDED = ("target", "platform", "acoustics")


def hold_metrics_to(sums: Any, record: Record, receiver: str) -> None:
    """The tables of a run say what the sums of a study say."""
    row = responses(sums[None], int(record.time_ns[-1] - record.time_ns[0])).iloc[0]
    errors = metrics.error_table({receiver: track(record, receiver)})
    judged = summary(record, [receiver]).loc[receiver]
    for frame in FRAMES:
        there = frame != "own_relative" or f"{receiver}.relative_position" in record.values
        assert ((receiver, frame, "x") in errors.index) == there
        for axis in ("x", "y", "z", "total"):
            for what in ("mean", "rms"):
                said = errors.loc[(receiver, frame, axis), f"{what}_m"] if there else np.nan
                assert row[f"{frame}_{axis}_{what}_m"] == pytest.approx(
                    said, rel=1e-9, abs=1e-12, nan_ok=True
                )
    for name in (
        "estimates", "nees_position", "nis", "availability", "own_relative_nees_position",
        "beyond_claim", "beyond_claim_longest_s",
    ):
        assert row[name] == pytest.approx(judged[name], rel=1e-12, nan_ok=True)
    assert not row["broken"]
    assert row["lost"] == judged["lost"]
    for name in ("inconsistent", "misleading"):
        assert row[name] is judged[name] or row[name] == judged[name]


@pytest.mark.parametrize(
    ("scenario", "overrides"),
    [
        ("paper-scenario-1", {"time.duration_s": 20.0}),
        ("paper-scenario-3", {"time.duration_s": 20.0, "acoustics.loss_probability": 0.25}),
        ("realistic-dive", {"time.duration_s": 60.0}),
        ("realistic-dive", {"time.duration_s": 60.0, "time.ekf_ratio": 5}),
    ],
    ids=["plain", "losses", "realistic", "ratio"],
)
def test_a_record_gives_the_sums_of_the_lanes_to_the_last_bit(
    scenario: str, overrides: dict[str, Any]
) -> None:
    plan = resolve(connect(sblcosim.load(scenario, overrides), WITH_OWN))
    settling = 5_000_000_000
    outcome = lanes.execute(plan, {}, settling_ns=settling, lanes=1)
    record = execute(plan, master="native")
    for receiver in WITH_OWN:
        hold_metrics_to(sums_of(Run(record, receiver)), record, receiver)
        np.testing.assert_array_equal(
            sums_of(Run(record, receiver, settling)), outcome.sums[receiver][0], err_msg=receiver
        )
    assert outcome.sums["ekf"][0][SUMS.index("nees_estimates")] > 0
    own = dict(zip(SUMS, outcome.sums["coupled"][0], strict=True))
    assert own["own_relative_estimates"] == own["estimates"] > 0
    assert own["own_relative_nees_estimates"] > 0
    for receiver in RECEIVERS:
        without = dict(zip(SUMS, outcome.sums[receiver][0], strict=True))
        assert not any(v for name, v in without.items() if name.startswith("own_relative"))


def changed(system: System, name: str, interval_ns: int, **parameters: Any) -> System:
    spec = system.components[name]
    spec = replace(spec, interval_ns=interval_ns, parameters={**spec.parameters, **parameters})
    return replace(system, components={**system.components, name: spec})


def base(**overrides: Any) -> System:
    changes = {"time.sampling_time_s": 0.3, "time.duration_s": 30.0, **overrides}
    return connect(sblcosim.load("harbour-random", changes), RECEIVERS)


def depth_between(system: System) -> System:
    """Depth at 0.2, 0.4, 0.6 … s, the target and all else at 0.3, 0.6 … s."""
    return changed(system, "target", 300_000_000, sampling_time=0.2)


def coarse_target(system: System) -> System:
    """As `depth_between`; the receivers and the platform at 0.1 s."""
    system = changed(depth_between(system), "platform", 100_000_000)
    for name in RECEIVERS:
        system = changed(system, name, 100_000_000)
    return system


def fine_truth(system: System) -> System:
    return changed(changed(system, "target", 100_000_000), "platform", 100_000_000)


def started(start_ns: int) -> Callable[[System], System]:
    return lambda s: replace(s, start_ns=start_ns, stop_ns=s.stop_ns + start_ns)


@pytest.mark.parametrize(
    ("overrides", "change", "off_grid"),
    [
        ({}, fine_truth, False),
        ({}, depth_between, True),
        ({}, coarse_target, True),
        ({"time.ekf_ratio": 4}, depth_between, True),
        ({"acoustics.loss_probability": 0.95}, depth_between, True),
        ({}, lambda s: started(7_300_000_001)(depth_between(s)), True),
        ({}, started(1_700_000_000 * SECOND), False),
        ({"time.sampling_time_s": 0.1, "time.ekf_ratio": 100, "time.duration_s": 100.0},
         lambda s: s, False),
        ({"time.sampling_time_s": 0.566666666, "time.duration_s": 40.0},
         started(333_333_333), False),
    ],
    ids=["finer", "between", "coarse", "lag", "loss", "start", "unix", "ratio", "thirds"],
)
def test_lanes_metrics_and_sums_agree_wherever_epochs_are(
    overrides: dict[str, Any], change: Callable[[System], System], off_grid: bool
) -> None:
    plan = resolve(change(base(**overrides)))
    settling = 3 * SECOND
    outcome = lanes.execute(plan, {}, settling_ns=settling)
    record = execute(plan, master="native")
    for receiver in RECEIVERS:
        sums = outcome.sums[receiver][0]
        assert sums[SUMS.index("unjudged")] == sums[SUMS.index("broken")] == 0
        np.testing.assert_array_equal(sums_of(Run(record, receiver, settling)), sums, receiver)
        hold_metrics_to(sums_of(Run(record, receiver)), record, receiver)
    epochs = record.estimates("ekf").epoch_ns
    assert len(epochs) > 5
    assert (~np.isin(epochs, record.time_ns[record.own("target")])).any() == off_grid


@pytest.mark.parametrize("master", MASTERS)
def test_every_master_says_which_instants_are_the_target_s_own(master: str) -> None:
    plan = resolve(coarse_target(base(**{"time.duration_s": 3.0})))
    own = execute(plan, master=master).own("target")
    assert len(own) == 31
    assert np.flatnonzero(own).tolist() == list(range(0, 31, 3))


STEP = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64
)  # fmt: skip


def tampered(
    seam: Seam, change: Callable[[dict[str, Any], int], None],
    receiver: str = "ekf",
) -> list[Any]:
    """Lets `change` alter what a receiver shows in each lane, by variable, after each step."""
    original = lanes_driver.engine_of
    kept: list[Any] = []
    true: dict[str, Any] = {}

    def engine(component: Any, number: int) -> Any:
        found = original(component, number)
        if component.name != receiver:
            return found
        ours = lanes_driver.Engine.from_buffer_copy(found.contents)
        step = STEP(found.contents.step)
        width = ours.lanes
        places = {
            p.name: (min(p.references) - 1, p.size)
            for p in component.ports.values() if p.causality == "output"
        }  # fmt: skip

        def altered(block: int, start: int, now: int, end: int) -> None:
            shown = {
                name: np.ctypeslib.as_array(
                    (ctypes.c_double * (size * width)).from_address(block + 8 * width * place)
                ).reshape(size, width)
                for name, (place, size) in places.items()
            }
            if now > start:  # some outputs are states
                for name, values in true.items():
                    shown[name][:] = values
            step(block, start, now, end)
            true.update({name: values.copy() for name, values in shown.items()})
            change(shown, end)

        callback = STEP(altered)
        ours.step = ctypes.cast(callback, ctypes.c_void_p)
        kept.extend((ours, callback, step))
        return ctypes.pointer(ours)

    seam.instead(lanes_layout.engine_of, engine)
    return kept


def judged_by_both(
    plan: Plan, runs: int, number: int, receiver: str = "ekf", **lags: Any
) -> tuple[Any, list[Any], list[Record]]:
    """Sums of the lanes, of the records, and the records of the same runs."""
    seeds = {f"{name}.seed": np.arange(1, runs + 1) for name in SEEDED}
    columns = [c.name for c in plan.columns]
    outcome = lanes.execute(
        plan, seeds | lags, record=columns, lanes=number, threads=1, settling_ns=2 * SECOND
    )
    records = [outcome.record(run) for run in range(runs)]
    return outcome.sums[receiver], [sums_of(Run(r, receiver, 2 * SECOND)) for r in records], records


def possible(number: int, plan: Plan) -> bool:
    try:
        lanes.execute(plan, {}, lanes=number)
    except FmuError:
        return False
    return True


@one_in(2)
@pytest.mark.parametrize("number", [1, 2, 4, 8])
@pytest.mark.parametrize("start_ns", [0, -12_345_678_901, 1_700_000_000 * SECOND])
@pytest.mark.parametrize("change", [lambda s: s, coarse_target], ids=["plain", "coarse"])
def test_any_epoch_and_covariance_is_judged_alike_to_the_last_bit(
    seam: Seam, change: Any, start_ns: int, number: int
) -> None:
    plan = resolve(started(start_ns)(change(base())))
    if not possible(number, plan):
        pytest.skip(f"this processor does not do {number} lanes")
    rng = np.random.default_rng(number)
    start, stop = plan.start_ns / 1e9, plan.stop_ns / 1e9
    known = np.array([0.0, 0.02, 0.15, 0.3, 0.3 - 1e-9, 1e-9, 1 / 3])

    def alter(shown: dict[str, Any], end: int) -> None:
        lag = rng.choice(known, shown["epoch"].shape[1])
        epoch = np.maximum(shown["epoch"][0] - lag, start)
        shown["epoch"][0] = np.where(rng.random(len(lag)) < 0.1, np.nextafter(epoch, 0), epoch)
        odd = rng.random(len(lag)) < 0.1
        bad = [np.nan, np.inf, -1e300, start - 1.0, stop + 1.0]
        shown["epoch"][0][odd] = rng.choice(bad, odd.sum())
        factor = rng.choice([1.0, 1.0, 0.0, -1.0, 1e-300], len(lag))
        shown["covariance"][rng.choice([0, 14, 28])] *= factor
        shown["covariance"][rng.choice([2, 4, 16])] *= rng.choice([1.0, 50.0], len(lag))
        shown["position"][1] += rng.choice([0.0, 0.0, 0.0, np.nan, 1e200], len(lag))

    keep = tampered(seam, alter)
    sums, expected, records = judged_by_both(plan, 5, number)
    assert keep
    for run, record in enumerate(records):
        assert sums[run][SUMS.index("unjudged")] == 0
        np.testing.assert_array_equal(sums[run], expected[run])
        epochs = record.estimates("ekf").epoch_ns
        assert (~np.isin(epochs, record.time_ns)).sum() > 20
    assert sums[:, SUMS.index("broken")].min() > 0
    used = sums[:, SUMS.index("estimates")]
    assert (sums[:, SUMS.index("nees_estimates")] < used).all()
    assert (sums[:, SUMS.index("nees_estimates")] > 0).all()


@pytest.mark.parametrize("number", [1, 2, 4, 8])
@pytest.mark.parametrize("start_ns", [0, 1_700_000_000 * SECOND])
@pytest.mark.parametrize("change", [lambda s: s, coarse_target], ids=["plain", "coarse"])
def test_the_times_beyond_the_claim_are_those_of_the_record_whatever_is_shown(
    seam: Seam, change: Any, start_ns: int, number: int
) -> None:
    plan = resolve(started(start_ns)(change(base())))
    if not possible(number, plan):
        pytest.skip(f"this processor does not do {number} lanes")
    rng = np.random.default_rng(number)
    far, last = np.zeros(number), np.zeros(number)

    def alter(shown: dict[str, Any], end: int) -> None:
        far[:] = np.where(rng.random(number) < 0.1, rng.choice([0.0, 0.9, 50.0], number), far)
        shown["position"][0] += far
        shown["valid"][0] *= rng.random(number) > 0.05
        last[:] = np.where(rng.random(number) < 0.3, last, shown["update_count"][0])
        shown["update_count"][0] = last  # no new estimate for some time
        shown["covariance"][0] *= rng.choice([1.0, 1.0, 1.0, 1.0, 1e-6, 0.0], number)

    keep = tampered(seam, alter)
    sums, expected, records = judged_by_both(plan, 5, number)
    assert keep
    np.testing.assert_array_equal(sums, expected)
    s = dict(zip(SUMS, sums.T, strict=True))
    assert not s["broken"].any()
    assert (s["beyond_ns"] > s["beyond_longest_ns"]).all()
    assert (s["beyond_longest_ns"] > np.diff(plan.instants).max()).all()
    assert not all(r.values["ekf.valid"][20:].all() for r in records)


@pytest.mark.parametrize("shift", [-25.0, 5.0], ids=["forgotten", "ahead"])
def test_what_the_lanes_cannot_know_is_not_called_broken(
    seam: Seam, shift: float
) -> None:
    plan = resolve(base())

    def alter(shown: dict[str, Any], end: int) -> None:
        epoch = shown["epoch"][0] + shift
        shown["epoch"][0] = np.where((epoch > 0) & (epoch < 30), epoch, shown["epoch"][0])

    keep = tampered(seam, alter)
    sums, expected, _ = judged_by_both(plan, 3, 1)
    assert keep
    names = dict(zip(SUMS, sums.T, strict=True))
    assert (names["unjudged"] > 5).all()
    assert not names["broken"].any()
    for run in range(3):
        whole = dict(zip(SUMS, expected[run], strict=True))
        assert whole["broken"] == whole["unjudged"] == 0
        assert whole["estimates"] > names["estimates"][run]


def test_what_must_be_remembered_follows_from_the_plan() -> None:
    plan = resolve(base(**{"time.sampling_time_s": 0.1, "time.ekf_ratio": 100}))
    assert lanes.remembered(plan) == 203
    short = resolve(base(**{"time.duration_s": 3.0}))
    assert lanes.remembered(short) == 5
    assert lanes.remembered(replace(short, stop_ns=600_000_000)) == 3  # all there are


@pytest.mark.parametrize("number", [1, 2, 4, 8])
@pytest.mark.parametrize("change", [lambda s: s, depth_between], ids=["plain", "between"])
def test_own_relative_errors_are_judged_alike_whatever_the_receiver_claims(
    seam: Seam, change: Any, number: int
) -> None:
    changes = {"time.sampling_time_s": 0.3, "time.duration_s": 30.0}
    plan = resolve(change(connect(sblcosim.load("harbour-random", changes), ["coupled"])))
    if not possible(number, plan):
        pytest.skip(f"this processor does not do {number} lanes")
    rng = np.random.default_rng(number)

    def alter(shown: dict[str, Any], end: int) -> None:
        lanes = shown["epoch"].shape[1]
        shown["epoch"][0] = np.maximum(shown["epoch"][0] - rng.choice([0.0, 0.02], lanes), 0)
        odd = [0.0, 0.0, 0.0, 0.0, np.nan, 1e200]
        shown["relative_position"][1] += rng.choice(odd, lanes)
        factor = rng.choice([1.0, 1.0, 0.0, -1.0, 1e-300], lanes)
        shown["relative_covariance"][rng.choice([0, 4, 8])] *= factor
        shown["relative_covariance"][rng.choice([1, 2, 5])] *= rng.choice([1.0, 50.0], lanes)

    keep = tampered(seam, alter, "coupled")
    sums, expected, _ = judged_by_both(plan, 5, number, "coupled")
    assert keep
    np.testing.assert_array_equal(sums, expected)
    s = dict(zip(SUMS, sums.T, strict=True))
    assert (s["broken"] > 0).all()
    assert not s["unjudged"].any()
    assert (s["own_relative_estimates"] == s["estimates"]).all()
    assert (s["own_relative_nees_estimates"] > 0).all()
    assert (s["own_relative_nees_estimates"] < s["estimates"]).all()


def lagging(plan: Plan, receiver: str, start: float | None, setting: float | None) -> Plan:
    """The plan as if the receiver had a parameter ``lag`` [s], in place of one without effect."""

    def taught(component: Any) -> Any:
        if component.name != receiver:
            return component
        old = component.ports["depth_std"]
        port = replace(old, name="lag", start=None if start is None else (start,),
                       min=(0.0,), max=(1e9,))
        others = tuple(s for s in component.settings if s.port.name != old.name)
        given = () if setting is None else (Setting(port, (setting,)),)
        ports = {name: p for name, p in component.ports.items() if name != old.name}
        return replace(component, ports=ports | {"lag": port}, settings=(*others, *given))

    return replace(plan, components=tuple(map(taught, plan.components)))


@pytest.mark.parametrize(
    ("start", "setting", "runs", "seconds"),
    [
        (None, None, None, 0.0), (7.0, None, None, 7.0), (7.0, 2.0, None, 2.0),
        (7.0, 2.0, [1.0, 4.5, 3.0], 4.5), (7.0, 2.0, 0.0, 0.0), (1e8, None, None, 30.0),
    ],
)  # fmt: skip
def test_the_lag_of_a_receiver_is_remembered_the_largest_of_all_runs(
    start: float | None, setting: float | None, runs: Any, seconds: float
) -> None:
    plan = resolve(base())
    plain = lanes.remembered(plan)
    given = {} if runs is None else {"sequential.lag": runs}
    found = lanes.remembered(lagging(plan, "sequential", start, setting), given)
    assert found == min(plain + int(10 * seconds) // 3, len(plan.instants))
    # a parameter of that name that is no receiver's means something else
    assert lanes.remembered(lagging(plan, "target", start, setting), {}) == plain


@pytest.mark.parametrize("number", [1, 8])
@pytest.mark.parametrize("change", [lambda s: s, coarse_target], ids=["plain", "coarse"])
def test_estimates_of_any_lag_are_judged_as_from_the_record(
    seam: Seam, change: Any, number: int
) -> None:
    plan = lagging(resolve(change(base())), "ekf", 0.0, None)
    if not possible(number, plan):
        pytest.skip(f"this processor does not do {number} lanes")
    longest = np.array([3.0, 12.0, 20.0])

    def alter(shown: dict[str, Any], end: int) -> None:
        lag = rng.choice([0.0, 0.3, 4.8, 5.1, 7.77, 19.8, 20.0], shown["epoch"].shape[1])
        shown["epoch"][0] = np.maximum(shown["epoch"][0] - lag, 0.0)

    rng = np.random.default_rng(number)
    keep = tampered(seam, alter)
    sums, expected, records = judged_by_both(plan, 3, number, **{"ekf.lag": longest})
    assert keep
    np.testing.assert_array_equal(sums, expected)
    assert not sums[:, [SUMS.index("unjudged"), SUMS.index("broken")]].any()
    behind = [e.available_ns - e.epoch_ns for e in (r.estimates("ekf") for r in records)]
    assert max(b.max() for b in behind) >= 20 * SECOND


class Elsewhere:
    """A receiver whose estimates belong to 20 ms before the instants, and which knows no better."""

    variables = tuple(
        v for v in sblcosim.models.COMPONENTS["ekf"].of("output")
        if v.name in ("epoch", "position", "update_count")
    )  # fmt: skip

    def initialise(self, start_ns: int, parameters: Any) -> dict[str, Any]:
        return {"epoch": start_ns / 1e9, "position": np.zeros(3), "update_count": 0}

    def do_step(self, time_ns: int, step_ns: int, inputs: Any) -> dict[str, Any]:
        self.count = getattr(self, "count", 0) + 1
        epoch = (time_ns + step_ns) / 1e9 - 0.02
        return {"epoch": epoch, "position": np.ones(3), "update_count": self.count}


def test_a_receiver_in_python_with_epochs_between_the_instants_is_judged() -> None:
    scenario = sblcosim.load("harbour-square", {"time.duration_s": 10.0})
    record = execute(resolve(connect(scenario, {"mine": Elsewhere})), master="python")
    sums = sums_of(Run(record, "mine"))
    assert sums[SUMS.index("broken")] == 0
    assert sums[SUMS.index("estimates")] == len(record) - 1
    hold_metrics_to(sums, record, "mine")


@pytest.mark.parametrize("start_s", [0, 7, 1_700_000_000])
@pytest.mark.parametrize("step_s", [0.0, 0.02])
def test_sums_and_metrics_of_a_record_agree(start_s: int, step_s: float) -> None:
    rng = np.random.default_rng(3)
    record = make_record({"ekf": rng.normal(size=(95, 3))}, platform_error=(0.5, 0.2, 0.0))
    epoch = record.values["ekf.epoch"] + step_s + start_s
    record = Record(record.time_ns + start_s * SECOND, {**record.values, "ekf.epoch": epoch})
    hold_metrics_to(sums_of(Run(record, "ekf")), record, "ekf")


def test_nis_without_degrees_counts_as_in_the_metrics() -> None:
    record = make_record()
    values = {k: v for k, v in record.values.items() if k != "ekf.nis_degrees"}
    values["ekf.nis"] = np.where(np.arange(101) % 7, np.arange(101.0), np.nan)
    record = replace(record, values=values)
    hold_metrics_to(sums_of(Run(record, "ekf")), record, "ekf")


def test_only_what_is_not_finite_or_not_of_the_run_is_broken() -> None:
    plan = resolve(
        connect(sblcosim.load("paper-scenario-1", {"time.duration_s": 20.0}), ["ekf"])
    )
    record = execute(plan, master="native")
    good = responses(sums_of(Run(record, "ekf"))[None], plan.stop_ns)
    assert not good.broken[0]
    values = dict(record.values)
    values["ekf.position"] = values["ekf.position"].copy()
    values["ekf.position"][50, 0] = np.nan
    values["ekf.epoch"] = values["ekf.epoch"].copy()
    values["ekf.epoch"][100] += 0.01
    values["ekf.epoch"][150] -= 7.0
    values["ekf.epoch"][160] -= 100.0
    sums = sums_of(Run(replace(record, values=values), "ekf"))
    assert sums[SUMS.index("broken")] == 2
    assert responses(sums[None], plan.stop_ns).estimates[0] == good.estimates[0] - 2


def test_the_inconsistent_runs_are_those_of_the_metrics() -> None:
    for gps in (0.1, 3.5):
        plan = resolve(
            connect(sblcosim.load(
                "paper-scenario-1",
                {"time.duration_s": 20.0, "platform.gps_horizontal_std_m": gps,
                 "receiver.measurement_noise": "variance"},
            ), ["ekf"])
        )
        record = execute(plan, master="native")
        table = summary(record, ["ekf"])
        ours = responses(sums_of(Run(record, "ekf"))[None], plan.stop_ns)
        assert bool(ours.inconsistent[0]) == bool(table.loc["ekf", "inconsistent"])
        assert bool(ours.lost[0]) == bool(table.loc["ekf", "lost"])


def sums(rows: Sequence[dict[str, float]]) -> Any:
    return np.array([[row.get(name, 0.0) for name in SUMS] for row in rows])


def test_inconsistent_is_judged_by_the_95_percent_band_and_unknown_without_a_covariance() -> None:
    bound = float(chi2.ppf(0.975, 300))
    rows = [{"estimates": 100, "nees": bound * f, "nees_estimates": 100} for f in (0.999, 1.001)]
    flags = responses(sums(rows), SECOND)["inconsistent"]
    assert flags.dtype == bool
    assert flags.tolist() == [False, True]
    flags = responses(sums([*rows, {"estimates": 100}]), SECOND)["inconsistent"]
    assert flags.isna().tolist() == [False, False, True]
    assert flags.dtype == pd.BooleanDtype()


def test_a_receiver_without_covariance_is_neither_consistent_nor_inconsistent() -> None:
    run = Run(make_record(optional_ports=False), "ekf")
    row = responses(sums_of(run)[None], 10 * SECOND).iloc[0]
    assert row["inconsistent"] is pd.NA
    assert np.isnan(row["nees_position"])


def test_lost_is_said_of_who_falls_silent_or_is_farther_off_than_the_platform() -> None:
    """From the platform, not from the origin; whenever the run starts."""
    near = np.tile([[0.1, 0, 0]], (99, 1))
    far = near.copy()
    far[76:, 0] = 20.0
    for start_ns in (0, 500 * SECOND):
        for errors, off, lost in (
            (near, 0.0, False), (near[:70], 0.0, True), (far, 0.0, True), (far, 100.0, True),
        ):
            record = make_record({"ekf": errors})
            values = {
                name: v + off * np.array([1.0, 0, 0])
                if name in ("target.position", "ekf.position", "platform.position")
                else v
                for name, v in record.values.items()
            }
            values["ekf.epoch"] = values["ekf.epoch"] + start_ns / 1e9
            moved = Record(record.time_ns + start_ns, values)
            row = responses(sums_of(Run(moved, "ekf"))[None], 10 * SECOND).iloc[0]
            assert bool(row["lost"]) is lost


def test_who_never_gives_an_estimate_is_lost() -> None:
    row = responses(sums_of(Run(silent("ekf"), "ekf"))[None], 10 * SECOND).iloc[0]
    assert row["lost"]
    assert row["estimates"] == 0


@pytest.mark.parametrize("start_ns", [0, 3 * SECOND, 1_000_000 * SECOND])
def test_the_driver_counts_the_late_from_the_last_quarter_and_their_distance_to_the_platform(
    start_ns: int,
) -> None:
    scenario = sblcosim.load("paper-scenario-1", {"time.duration_s": 40.0})
    system = connect(scenario, ["ekf"])
    plan = resolve(replace(system, start_ns=start_ns, stop_ns=start_ns + system.stop_ns))
    found = dict(zip(SUMS, lanes.execute(plan, {}).sums["ekf"][0], strict=True))
    record = execute(plan, master="native")
    estimates = record.estimates("ekf")
    late = estimates.epoch_ns >= start_ns + 30 * SECOND
    assert found["late_estimates"] == late.sum() > 0
    rows = np.searchsorted(record.time_ns, estimates.epoch_ns[late])
    away = record.values["target.position"][rows] - record.values["platform.position"][rows]
    assert found["late_distance_square"] == pytest.approx((away**2).sum())
    error = estimates.position[late] - record.values["target.position"][rows]
    assert found["late_error_square"] == pytest.approx((error**2).sum())

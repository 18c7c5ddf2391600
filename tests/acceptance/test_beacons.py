"""Any arrangement of three to eight beacons, everywhere where the paper has four on a cross."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
from quick import few
from sblcosim import limits
from sblcosim.errors import BuildError, ConfigurationError, ConfigurationWarning
from sblcosim.export.container import export_fmu
from sblcosim.export.ssp import export_ssp
from sblcosim.fmus.build.factory import build
from sblcosim.fmus.conformance.kit import examine
from sblcosim.fmus.conformance.receiver_contract import check_receiver
from sblcosim.models import COMPONENTS, RECEIVERS, declared
from sblcosim.scenario.arrangement import degenerate
from sblcosim.scenario.scenario import load
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters import lanes, native, python
from sblcosim.simulation.resolve import resolve
from typer.testing import CliRunner

HULL = ((4.0, 1.2, 1.0), (4.0, -1.2, 1.0), (0.0, 1.8, 1.3), (0.0, -1.8, 1.3), (-4.0, 1.0, 0.9),
        (-4.0, -1.0, 0.9), (2.0, 1.6, 1.1), (-2.0, -1.6, 1.1))
SHORT = {"time.duration_s": 40.0}
SIMPLE = ("ekf", "sequential")
pytestmark = pytest.mark.filterwarnings("ignore:.*has no effect, as arrangement")


def hull(beacons: int, **changes: Any) -> Any:
    given = {"platform.beacon_m": HULL[:beacons], "platform.mounting_std_m": 0.02}
    return load("realistic-dive", {**SHORT, **given, **changes})


def assert_same(found: Any, wanted: Any, run: int | None = None) -> None:
    for name, values in wanted.values.items():
        got = found.values[name] if run is None else found.values[name][run]
        assert np.asarray(got).tobytes() == values.tobytes(), name


@pytest.mark.parametrize(
    ("beacons", "fmi", "receivers", "schedule"),
    [
        (6, 2, ("sequential",), "round_robin"),
        pytest.param(3, 2, SIMPLE, "simultaneous", marks=pytest.mark.slow),
        *(pytest.param(n, fmi, tuple(RECEIVERS), schedule, marks=pytest.mark.slow)
          for n in (3, 4, 5, 6, 8) for fmi in (2, 3)
          for schedule in ("round_robin", "simultaneous")),
    ],
)
def test_all_masters_give_the_same_bits(
    beacons: int, fmi: Any, receivers: tuple[str, ...], schedule: str
) -> None:
    lag = {"receiver.lag_s": 4.0} if "fixed_lag" in receivers else {}
    scenario = hull(beacons, **{"acoustics.schedule": schedule}, **lag)
    plan = resolve(connect(scenario, receivers, fmi=fmi))
    wanted = python.execute(plan)
    assert wanted.values["acoustics.range"].shape[1:] == (beacons,)
    for receiver in receivers:
        assert len(wanted.estimates(receiver)) > 5, receiver
    assert_same(native.execute(plan), wanted)
    seeds = {f"{name}.seed": np.array([7, 1, 3]) for name in ("target", "platform", "acoustics")}
    beside = lanes.execute(plan, seeds, record=[c.name for c in plan.columns])
    assert_same(beside, wanted, run=1)


def test_the_papers_cross_given_as_points_is_the_cross() -> None:
    points = [[3.0, 0, 0.5], [0, 3.0, 0.5], [-3.0, 0, 0.5], [0, -3.0, 0.5]]
    cross = python.execute(resolve(connect(load("realistic-dive", SHORT), SIMPLE)))
    given = load("realistic-dive", {**SHORT, "platform.beacon_m": points})
    assert_same(python.execute(resolve(connect(given, SIMPLE))), cross)
    doubled = {"platform.arm_length_m": 1.5, "platform.beacon_scale": 2.0}
    scaled = load("realistic-dive", {**SHORT, **doubled})
    assert_same(python.execute(resolve(connect(scaled, SIMPLE))), cross)


def test_a_cross_has_as_many_arms_as_beacons() -> None:
    scenario = load({"platform": {"beacons": 6, "arm_length_m": 2.0}})
    record = sblcosim.run(scenario, "multilateration", {"time.duration_s": 5.0}).record
    beacons = record.values["platform.beacon_position"][0]
    angle = np.arange(6) * np.pi / 3
    np.testing.assert_allclose(beacons[:, :2], 2 * np.column_stack([np.cos(angle), np.sin(angle)]),
                               atol=1e-14)
    assert scenario.assumptions()["beacon_offset_m"] == pytest.approx(beacons.ravel())


@pytest.mark.parametrize(
    "name",
    few(["platform", "acoustics", "sequential", "coupled", "long_baseline", "ekf",
         "multilateration", "fixed_lag"], quick=["sequential"]),
)
def test_fmus_for_six_keep_all_promises(name: str) -> None:
    """The kit has the time contract, and saving and restoring, among its checks."""
    fmu = build(name, 2, beacons=6)
    assert fmu.name == f"{name}6.fmu"
    report = examine(fmu)
    assert report.ok, str(report)
    if name in RECEIVERS:
        assert check_receiver(fmu, load=True).ok


@pytest.mark.parametrize("beacons", [3, 6])
def test_the_number_is_in_name_and_description(beacons: int) -> None:
    for name, component in COMPONENTS.items():
        sized = declared(name, beacons=beacons)
        if component.constants.get("beacons"):
            assert sized.name == f"{component.name}{beacons}"
            assert f"{beacons} beacons" in sized.description
        else:
            assert sized is component


@pytest.mark.slow
def test_packages_come_back(tmp_path: Path) -> None:
    scenario = hull(6)
    path = export_ssp(scenario, tmp_path / "six.ssp", "sequential")
    wanted = sblcosim.run(scenario, "sequential")
    found = sblcosim.run(path)
    for name, values in found.record.values.items():
        assert values.tobytes() == wanted.record.values[name].tobytes(), name
    baked = export_ssp(scenario, tmp_path / "baked.ssp", "sequential", bake=True)
    assert sblcosim.run(baked).record.values["sequential.position"].tobytes() == (
        wanted.record.values["sequential.position"].tobytes()
    )


def test_a_container_has_every_beacon(tmp_path: Path) -> None:
    path = export_fmu(hull(6), tmp_path / "six.fmu", "sequential")
    text = str(sorted(v for v in _variables(path)))
    assert "range[6]" in text
    assert "range[7]" not in text


def _variables(path: Path) -> list[str]:
    from fmpy import read_model_description

    return [v.name for v in read_model_description(str(path)).modelVariables]


# Accuracy of the raw fix --------------------------------------------------------------------------


FEW = pytest.mark.parametrize(
    ("number", "sizes"),
    [(20, (6,)), pytest.param(100, (3, 4, 5, 6, 7, 8), marks=pytest.mark.slow)],
)
"""How many arrangements, and of how many beacons; each number of beacons has to be built."""


def arrangements(count: int, sizes: tuple[int, ...], seed: int) -> list[np.ndarray]:
    """Beacons at random, some of them nearly in a line; degenerate ones are left out."""
    rng = np.random.default_rng(seed)
    found: list[np.ndarray] = []
    while len(found) < count:
        beacons = rng.normal(size=(rng.choice(sizes), 3)) * [4, rng.uniform(0.2, 4), 0.5]
        if degenerate(tuple(beacons.ravel().tolist())) is None:
            found.append(beacons)
    return found


def at_rest(beacons: np.ndarray, position: np.ndarray, range_std: float, **more: Any) -> Any:
    return load({
        "time": {"sampling_time_s": 0.1, "duration_s": 0.3, **more},
        "target": {"trajectory": "waypoints", "speed_m_s": 1e-9, "departure_time_s": 1e6,
                   "waypoint_m": [position.tolist(), (position + 1).tolist()], "depth_std_m": 0.0},
        "platform": {"beacon_m": beacons.tolist()},
        "acoustics": {"range_std_m": range_std, "schedule": "simultaneous"},
        "receiver": {"type": "multilateration"},
    })


@FEW
def test_the_raw_fix_is_exact_without_noise(number: int, sizes: tuple[int, ...]) -> None:
    rng = np.random.default_rng(2)
    for beacons in arrangements(number, sizes, seed=5):
        position = rng.uniform([-30, -30, 3], [30, 30, 15])
        plan = resolve(connect(at_rest(beacons, position, 0.0)))
        found = python.execute(plan).values["multilateration.position"][-1]
        mirrored = np.linalg.norm(found[:2] - position[:2]) > 1e-6
        if mirrored:  # exact all the same: every range is met
            ranges = [np.linalg.norm(x - beacons, axis=1) for x in (found, position)]
            np.testing.assert_allclose(ranges[0], ranges[1], atol=1e-6)
        else:
            np.testing.assert_allclose(found, position, atol=1e-6)


@FEW
def test_dilution_of_precision_is_the_spread_of_the_raw_fix(
    number: int, sizes: tuple[int, ...]
) -> None:
    """Diver at rest, 4,000 independent rounds each; 5 % is more than three standard errors."""
    rng = np.random.default_rng(8)
    compared = 0
    for beacons in arrangements(number, sizes, seed=11):
        position = rng.uniform([-12, -12, 3], [12, 12, 15])
        expected = float(limits.hdop(position, beacons).horizontal)
        if expected > 10:
            continue
        std = 1e-3 / expected  # so that the fix is linear in the noise
        plan = resolve(connect(at_rest(beacons, position, std, duration_s=400.2)))
        found = lanes.execute(plan, {"acoustics.seed": np.array([compared + 1])},
                              record=["multilateration.position"])
        fixes = found.values["multilateration.position"][0][3:, :2]  # the first comes later
        assert len(fixes) == 4000
        spread = np.sqrt(fixes.var(axis=0).sum()) / std
        assert spread == pytest.approx(expected, rel=0.05), beacons
        compared += 1
    assert compared > number / 2


# Schedules ---------------------------------------------------------------------------------------


def test_simultaneous_ranges_come_in_one_slot_with_noise_of_their_own() -> None:
    scenario = load({
        "time": {"duration_s": 400.0}, "platform": {"beacons": 6},
        "target": {"speed_m_s": 1e-9},
        "acoustics": {"schedule": "simultaneous", "range_std_m": 0.1, "loss_probability": 0.2,
                      "outlier_probability": 0.0},
        "receiver": {"type": "multilateration"},
    })
    record = python.execute(resolve(connect(scenario)))
    count = record.values["acoustics.reception_count"]
    np.testing.assert_allclose(count[-1] / (len(record) - 1), 0.8, atol=0.03)
    new = np.diff(count, axis=0) > 0
    epoch = record.values["acoustics.range_epoch"][1:]
    np.testing.assert_allclose(epoch[new], np.broadcast_to(
        record.time_ns[:-1, None] / 1e9, epoch.shape)[new], atol=1e-12)
    noise = (record.values["acoustics.range"] - record.values["acoustics.true_range"])[1:]
    whole = new.all(axis=1)
    assert whole.sum() > 500
    correlation = np.corrcoef(noise[whole].T)
    np.testing.assert_allclose(correlation, np.eye(6), atol=4 / np.sqrt(whole.sum()))
    np.testing.assert_allclose(noise[whole].std(axis=0), 0.1, rtol=0.1)


def test_beacons_ping_in_the_order_that_is_given() -> None:
    order = (3, 1, 6, 2, 4, 5)
    given = {"platform": {"beacons": 6}, "acoustics": {"slot_order": order, "range_std_m": 0.1},
             "time": {"duration_s": 1.1}}
    record = python.execute(resolve(connect(load(given), "multilateration")))
    count = record.values["acoustics.reception_count"]
    heard = [int(i) + 1 for row in np.diff(count, axis=0) for i in np.flatnonzero(row)]
    assert tuple(heard) == (*order, *order)[: len(heard)]
    assert len(heard) > 6


# What is refused ---------------------------------------------------------------------------------

WRONG = [
    ({"platform.beacon_m": HULL[:2]}, "override platform.beacon_m: must be an array of 3 to 8 rows "
     "of 3 numbers, got"),
    ({"platform.beacon_m": (*HULL, (9.0, 9.0, 9.0))}, "3 to 8 rows"),
    ({"platform.beacon_m": (*HULL[:4], HULL[1])}, "must have each beacon at a different position, "
     "got beacons 2 and 5 at"),
    ({"platform.beacon_m": HULL[:6], "platform.beacons": 5}, "must be the number of rows of "
     "beacon_m (6), got 5"),
    ({"platform.beacons": 9}, "must be at most 8, got 9"),
    ({"platform.beacons": 6, "acoustics.slot_order": (1, 2, 3, 4)}, "acoustics.slot_order: must "
     "have 6 numbers, one per beacon, got 4"),
    ({"acoustics.slot_order": (1, 2, 2, 4)}, "must have each number from 1 to 4 once, got"),
    ({"platform.beacons": 6, "platform.mounting_error_m": [[0, 0, 0.1]] * 5}, "must have 6 rows"),
    ({"platform.beacon_m": ((1.0, 2.0, 3.0), (4.0, 5.0), (1.0, 1.0, 1.0))}, "3 to 8 rows of 3"),
    ({"acoustics.schedule": "simultanous"}, "did you mean 'simultaneous'?"),
]


@pytest.mark.parametrize(("given", "words"), WRONG, ids=[w[1][:30] for w in WRONG])
def test_what_cannot_be_is_said_in_a_line(given: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load("realistic-dive", given)
    assert words in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("beacons", "words"),
    [
        ([[i, 0.01 * i**2, 0.5] for i in range(4)], "nearly on one line, 2° from forward"),
        ([[0, i, 0.5 * i] for i in range(4)], "are on one line, 90° from forward"),
        ([[1, 1, i] for i in range(4)], "one vertical line"),
    ],
)
def test_degenerate_arrangements_are_said_to_be_such(beacons: Any, words: str) -> None:
    scenario = load({"platform": {"beacon_m": beacons}})
    with pytest.warns(ConfigurationWarning, match=re.escape(words)) as caught:
        connect(scenario, "multilateration")
    assert "[platform] beacon_m" in str(caught[0].message)


def test_a_receiver_for_another_number_is_refused(tmp_path: Path) -> None:
    six = build("ekf", 2, beacons=6)
    words = "must be made for the 4 beacons of the scenario, got range of 6"
    with pytest.raises(ConfigurationError, match=words):
        connect(load("realistic-dive"), six)
    assert connect(hull(6), six).components["ekf6"].fmu == six


def test_the_command_builds_for_a_number(tmp_path: Path) -> None:
    from sblcosim.cli import app

    done = CliRunner().invoke(
        app, ["build", "target", "multilateration", "--beacons", "6", "--fmi", "3", "--out",
              str(tmp_path)]
    )
    assert done.exit_code == 0, done.output
    assert sorted(p.name for p in tmp_path.rglob("*.fmu")) == ["multilateration6.fmu", "target.fmu"]
    wrong = CliRunner().invoke(app, ["build", "--beacons", "9"])
    assert "beacons: must be from 3 to 8, got 9" in wrong.stderr
    with pytest.raises(BuildError, match="beacons: must be from 3 to 8, got 2"):
        build("ekf", 2, beacons=2)


class Counts(sblcosim.Receiver):
    """Takes the diver to be where the newest packet came from; knows of which beacons."""

    outputs = ("nis_degrees",)

    def start(self) -> None:
        self.heard: set[int] = set()

    def update(self, samples: Any) -> Any:
        ranges = [s for s in samples if isinstance(s, sblcosim.Range)]
        self.heard |= {r.beacon for r in ranges}
        assert self.beacons == 6
        if not ranges:
            return None
        place = ranges[-1].beacon_position
        return sblcosim.Estimate(ranges[-1].epoch, place, nis_degrees=len(self.heard))


def test_a_receiver_class_follows_the_number() -> None:
    record = sblcosim.run(hull(6), Counts).record
    assert record.values["Counts.nis_degrees"][-1] == 6

"""What makes processing quick changes nothing: receivers in C, few ticks, lines in parts."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
from made_logs import made
from sblcosim import process
from sblcosim.data.turns import turned
from sblcosim.errors import FmuError
from sblcosim.logs.log import Log
from sblcosim.models import RECEIVERS
from sblcosim.processing import windows
from sblcosim.processing.playing import played
from sblcosim.processing.quality import described
from sblcosim.processing.replaying import replayed
from sblcosim.simulation.masters import replay
from sblcosim.simulation.masters.python import execute
from scipy import stats
from scipy.spatial.transform import Rotation
from seams import Seam

GAP_NS = 200 * 10**9
IN_PYTHON = """\
import sblcosim

class Fix(sblcosim.Receiver):
    def update(self, samples):
        fix = self.fix(samples)
        return None if fix is None else sblcosim.Estimate(samples[-1].epoch, fix)
"""


def refused(*_: Any, **__: Any) -> Any:
    raise AssertionError("this master must not be used")


def with_gap(begin_s: int, end_s: int, seconds: int) -> Log:
    """A log without any range or depth in a part of it."""
    log = made(seconds=seconds, turning=0.005)
    heard, deep = log.receptions, log.depth_ns
    some = [(t < begin_s * 10**9) | (t > end_s * 10**9) for t in (heard.arrival_ns, deep)]
    return replace(
        log, receptions=heard.chosen(some[0]), depth_ns=deep[some[1]], depth=log.depth[some[1]]
    )


def same(one: Any, other: Any, labels: Any) -> None:
    """Estimates with the same bits."""
    for label in labels:
        first, second = one.made[label].columns(), other.made[label].columns()
        assert len(first["epoch_ns"]) > 10
        for name, values in first.items():
            assert np.array_equal(values, second[name], equal_nan=True), (label, name)


@pytest.mark.parametrize(("log", "interval_s"), [
    (with_gap(60, 130, 200), 0.5), (with_gap(100, 250, 300), 7.0),
    (made(seconds=100, plane=True, seed=3), 0.5),
    (replace(made(seconds=100), meta=made(meta={"start_ns": 10**9, "stop_ns": 10**11}).meta), 1.0),
], ids=["gap", "long interval", "plane", "begins with a range"])  # fmt: skip
def test_every_master_gives_the_same_bits(log: Log, interval_s: float, seam: Seam) -> None:
    seam.instead(execute, refused)
    swift = process(log, [*RECEIVERS], interval_s=interval_s)
    seam.undo()
    seam.instead(replayed, lambda *_: None)
    seam.instead(replay.replay, refused)
    slow = process(log, [*RECEIVERS], interval_s=interval_s)
    same(swift, slow, slow.made)
    assert swift.receivers.equals(slow.receivers)


def test_a_gap_of_hours_has_no_ticks() -> None:
    log = with_gap(300, 6 * 3600 + 300, 6 * 3600 + 600)
    given = played(log, 10**8, 4)
    assert given.time_ns[-1] == (6 * 3600 + 600) * 10**9 - 10**9 + 10**8
    assert len(given.time_ns) < 2 * (len(log.receptions) + len(log.depth)) < 3000
    assert (np.diff(given.time_ns) > GAP_NS).sum() == 1


def test_of_a_gap_only_the_lag_of_a_receiver_has_ticks(seam: Seam) -> None:
    real, counts = replay.replay, []

    def counted(path: Path, ticks: Any, *given: Any, **options: Any) -> Any:
        counts.append(len(ticks))
        return real(path, ticks, *given, **options)

    seam.instead(real, counted)
    process(with_gap(60, 560, 620), ["fixed_lag"], interval_s=0.5)
    assert 120 / 0.5 < counts[0] < 180 / 0.5  # of 620 s


def test_beside_a_receiver_in_python_ours_give_the_same(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(IN_PYTHON)
    log = made(seconds=100)
    alone = process(log, ["coupled", "sequential"])
    beside = process(log, ["coupled", f"{tmp_path / 'mine.py'}:Fix", "sequential"])
    same(alone, beside, ("coupled", "sequential"))
    assert len(beside.made) == 4


@pytest.mark.parametrize("spoilt", ["value", "error"])
def test_what_a_receiver_says_of_its_failure_is_that_of_any_run(spoilt: str, seam: Seam) -> None:
    log = made(seconds=100)
    whole = process(log, ["sequential"])
    real = replay.replay

    def broken(*given: Any, **options: Any) -> Any:
        if spoilt == "error":
            raise FmuError("this is not to be seen")
        outputs = real(*given, **options)
        outputs["position"][0, -1, 0] = np.nan
        return outputs

    seam.instead(real, broken)
    again = process(log, ["sequential"])
    assert not again.failures
    same(whole, again, ["sequential"])


def test_lines_are_the_same_in_parts_of_any_size(seam: Seam) -> None:
    log = made(seconds=600)
    given = log.samples(), log.receptions.beacon_position, None
    whole = windows.lines(*given)
    seam.tuned(few_lines=7)
    parts = windows.lines(*given)
    assert whole.scatter == parts.scatter
    assert np.array_equal(whole.residual, parts.residual, equal_nan=True)
    assert 0.05 < whole.scatter < 0.2


@pytest.mark.parametrize("digits", [0, 6])
def test_a_slope_is_that_of_theil_and_sen(digits: int) -> None:
    random = np.random.default_rng(digits)
    length = np.round(random.uniform(1, 50, 101), digits)
    off = 0.02 * length + random.standard_normal(101)
    slope = described(off, length)["slope"]
    assert slope == pytest.approx(stats.theilslopes(off, length)[0], rel=1e-12)
    alike = np.where(np.arange(1000) % 2, 5.0, 6.0)  # every second one is looked at
    assert np.isnan(described(random.standard_normal(1000), alike)["slope"])


def test_processing_by_a_receiver_of_ours_imports_nothing_that_takes_long(tmp_path: Path) -> None:
    run = sblcosim.run("realistic-dive", "coupled", {"time.duration_s": 20.0})
    run.save(tmp_path / "run", figures=False, log=True)
    log = tmp_path / "log"  # as a device writes it: nothing about settings and start
    log.mkdir()
    for name in ("receptions.csv", "depth.csv"):
        (log / name).write_bytes((tmp_path / "run" / "log" / name).read_bytes())
    code = (
        "import sys, sblcosim\n"
        f"done = sblcosim.process({str(log)!r}, 'coupled')\n"
        f"done.save({str(tmp_path / 'out')!r}, figures=False)\n"
        "assert len(done.made['coupled']) > 10 and done.scenario.platform.gps_grade == 'sbas'\n"
        "print({'scipy', 'matplotlib', 'casadi', 'statsmodels', 'xarray'} & {*sys.modules})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


@pytest.mark.parametrize("inverse", [False, True])
def test_vectors_turn_as_with_scipy_to_the_bit(inverse: bool) -> None:
    random = np.random.default_rng(1)
    attitude, vectors = random.normal(size=(2, 500, 3))
    turns = Rotation.from_euler("ZYX", attitude[:, ::-1])
    expected = turns.apply(vectors, inverse=inverse)
    assert np.array_equal(turned(attitude, vectors, inverse), expected)

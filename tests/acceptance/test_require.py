"""An answer is the same bytes wherever its runs are done, and after any number of kills."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
from distributed import LocalCluster
from sblcosim import require
from sblcosim.study import store
from seams import Seam, program

QUESTION = """
name = "mine"
scenario = "paper-scenario-3"
response = "total_p95_m"
limit = 6.0
share = 0.9
most_runs = 2000
settling_time_s = 3.0
seed = 5
[fixed.time]
duration_s = 10.0
[choices.gps]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 2.0]
costs = [9, 1]
[choices.arm]
keys = ["platform.arm_length_m"]
levels = [0.4, 3.0]
costs = [1, 5]
[conditions.tick]
keys = ["time.sampling_time_s"]
levels = [0.1, 0.5]
combine = "all"
[conditions.loss]
keys = ["acoustics.loss_probability"]
levels = [0.0, 0.25]
"""
PROGRAM = program(batch=8, limiting_runs=20)


@pytest.fixture(autouse=True)
def _quick(seam: Seam) -> None:
    seam.tuned(limiting_runs=20)


def written(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted((folder / "answer").iterdir())}


@pytest.fixture(scope="module")
def question(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("question") / "mine.toml"
    path.write_text(QUESTION, "utf-8")
    return path


@pytest.fixture(scope="module")
def reference(question: Path) -> dict[str, bytes]:
    with Seam() as seam:
        seam.tuned(limiting_runs=20)
        found = require.decide(question, question.parent / "reference", workers=1)
    assert 0 < found.spent <= 2000
    assert len(set(found.designs["runs"])) > 1  # runs went where they decide
    return written(question.parent / "reference")


@pytest.mark.parametrize(("executor", "workers"), [
    ("threads", 4), pytest.param("processes", 2, marks=pytest.mark.slow),
])  # fmt: skip
def test_threads_and_processes_give_the_same_answer(
    tmp_path: Path, question: Path, reference: dict[str, bytes], executor: str, workers: int
) -> None:
    require.decide(question, tmp_path, executor=executor, workers=workers)
    assert written(tmp_path) == reference


@pytest.mark.slow
def test_a_dask_cluster_gives_the_same_answer(
    tmp_path: Path, question: Path, reference: dict[str, bytes], seam: Seam
) -> None:
    seam.tuned(worker_patience=300)
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as made:
        require.decide(question, tmp_path, scheduler=made.scheduler_address)
    assert written(tmp_path) == reference


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL")
@pytest.mark.slow
@pytest.mark.parametrize("kills", [1, 4])
def test_after_kills_the_same_command_goes_on(
    tmp_path: Path, question: Path, reference: dict[str, bytes], kills: int
) -> None:
    command = [sys.executable, "-c", PROGRAM, "require", str(question), "--out", str(tmp_path)]
    parts = tmp_path / "runs" / "parts"
    for _ in range(kills):
        before = _parquet(parts)
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        while process.poll() is None and len(_parquet(parts)) < len(before) + 5:
            time.sleep(0.005)
        process.kill()
        process.wait()
        assert process.returncode == -signal.SIGKILL
        assert not (tmp_path / "answer").exists()
    before = _parquet(parts)
    subprocess.run(command, check=False, capture_output=True, timeout=300)
    assert written(tmp_path) == reference
    assert len(before) >= 5 * kills
    assert before <= _parquet(parts)
    rows = sum(len(pd.read_parquet(path)) for path in parts.glob("*.parquet"))
    assert rows == len(store.table(tmp_path / "runs"))  # none was done twice


def _parquet(folder: Path) -> set[str]:
    return {path.name for path in folder.glob("*.parquet") if not path.name.startswith(".")}


def test_a_larger_budget_goes_on_from_the_runs_that_are_there(
    tmp_path: Path, question: Path, reference: dict[str, bytes]
) -> None:
    few = require.decide(question, tmp_path, most_runs=800)
    assert few.spent <= 800
    runs = set(store.finished(tmp_path / "runs").run_id.tolist())
    require.decide(question, tmp_path)
    assert runs <= set(store.finished(tmp_path / "runs").run_id.tolist())
    assert written(tmp_path) == reference

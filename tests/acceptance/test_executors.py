"""A campaign gives the same table wherever its runs are simulated."""

from __future__ import annotations

import importlib.metadata
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import distributed
import pandas as pd
import pytest
import tasks
from distributed import LocalCluster
from quick import few
from sblcosim.errors import ConfigurationError
from sblcosim.fmus import stopping
from sblcosim.simulation.how import How
from sblcosim.study import campaign, executors, store, study
from seams import Seam

MADE = {
    "name": "wide",
    "scenario": "paper-scenario-3",
    "fixed": {"time": {"duration_s": 10.0}},
    "receivers": ["ekf", "sequential"],
    "replicates": 5,
    "factors": {
        "arm": {"keys": ["platform.arm_length_m"], "levels": [0.4, 3.0]},
        "gps": {"keys": ["platform.gps_horizontal_std_m"], "levels": [0.1, 3.5]},
        "tick": {"keys": ["time.sampling_time_s"], "levels": [0.1, 0.5]},
    },
}


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    out = tmp_path_factory.mktemp("reference")
    table = study.load(MADE).run(out, workers=1)
    assert len(table) == 40
    assert table["error"].isna().all()
    return (out / "runs.parquet").read_bytes()


@pytest.fixture(autouse=True)
def patient(seam: Seam) -> None:
    """A cluster on a busy machine takes more than seconds to have workers."""
    seam.tuned(worker_patience=300)


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    with LocalCluster(n_workers=3, threads_per_worker=1, dashboard_address=None) as made:
        yield made


@pytest.mark.parametrize("workers", few([1, 2, 4], quick=[4]))
@pytest.mark.parametrize("executor", ["threads", "processes"])
def test_threads_and_processes_give_the_same_table(
    tmp_path: Path, reference: bytes, executor: str, workers: int
) -> None:
    study.load(MADE).run(tmp_path / "out", executor=executor, workers=workers)
    assert (tmp_path / "out" / "runs.parquet").read_bytes() == reference


@pytest.mark.slow
@pytest.mark.parametrize("master", ["native", "python"])
def test_the_other_masters_give_the_same_table_in_processes(
    tmp_path: Path, reference: bytes, master: str
) -> None:
    study.load(MADE).run(tmp_path / "out", executor="processes", workers=2, master=master)
    assert (tmp_path / "out" / "runs.parquet").read_bytes() == reference


def test_any_executor_of_the_standard_library_will_do(tmp_path: Path, reference: bytes) -> None:
    with ThreadPoolExecutor(3) as pool:
        study.load(MADE).run(tmp_path / "out", executor=pool)
        assert pool.submit(int, "7").result() == 7  # it is left open
    assert (tmp_path / "out" / "runs.parquet").read_bytes() == reference


@pytest.mark.parametrize("workers", few([1, 2, 4], quick=[1]))
def test_a_dask_cluster_gives_the_same_table(
    tmp_path: Path, reference: bytes, workers: int
) -> None:
    with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as made:
        study.load(MADE).run(tmp_path / "out", scheduler=made.scheduler_address)
    assert (tmp_path / "out" / "runs.parquet").read_bytes() == reference


def test_workers_of_a_cluster_get_the_fmus_over_the_wire(tmp_path: Path, reference: bytes) -> None:
    """A worker with a cache of its own, that has never seen an FMU and may not build one."""
    drivers = executors.cache()
    own = tmp_path / "cache"
    own.mkdir()
    for path in drivers.iterdir():  # the C drivers are the worker's own
        if path.is_dir() and not list(path.glob("**/*.fmu")):
            (own / path.name).symlink_to(path)
    no_models = (
        "import sys; sys.modules['casadi'] = None\n"
        "from distributed.cli.dask_worker import main\n"
        "if __name__ == '__main__': main()\n"
    )
    (tmp_path / "worker.py").write_text(no_models)
    with LocalCluster(n_workers=0, dashboard_address=None, host="127.0.0.1") as made:
        worker = subprocess.Popen(
            [sys.executable, "worker.py", made.scheduler_address, "--nthreads", "2", "--no-nanny",
             "--no-dashboard"],
            cwd=tmp_path,
            env={**os.environ, "SBLCOSIM_CACHE": str(own)},
            stderr=subprocess.PIPE,
        )  # fmt: skip
        try:
            study.load(MADE).run(tmp_path / "out", scheduler=made.scheduler_address)
        finally:
            worker.terminate()
            worker.communicate(timeout=300)
    assert (tmp_path / "out" / "runs.parquet").read_bytes() == reference
    received = {p.name for p in (own / "received").glob("*/*.fmu")}
    assert received == {
        "target.fmu", "platform.fmu", "acoustics.fmu", "ekf.fmu", "sequential.fmu",
    }  # fmt: skip


@pytest.mark.slow
def test_a_worker_that_is_killed_costs_nothing(
    tmp_path: Path, seam: Seam, cluster: LocalCluster
) -> None:
    made = study.load({**MADE, "replicates": 60})
    made.run(tmp_path / "alone")
    seam.tuned(batch=8)
    killed: list[int] = []

    def kill(share: float) -> None:
        if share > 0.2 and not killed:
            worker = next(iter(cluster.workers.values()))
            killed.append(worker.pid)
            os.kill(worker.pid, signal.SIGKILL)

    table = made.run(tmp_path / "out", scheduler=cluster.scheduler_address, progress=kill)
    assert killed
    assert table["error"].isna().all()
    assert (tmp_path / "out" / "runs.parquet").read_bytes() == (
        tmp_path / "alone" / "runs.parquet"
    ).read_bytes()


def test_processes_end_with_the_one_that_started_them(tmp_path: Path) -> None:
    script = (
        "import os, signal, multiprocessing\n"
        "from sblcosim import study\n"
        "def kill(share):\n"
        "    print(*[p.pid for p in multiprocessing.active_children()], flush=True)\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
        "if __name__ == '__main__':\n"
        "    made = study.load('paper-scenario-1')\n"
        "    made.run('out', executor='processes', workers=2, progress=kill)\n"
    )
    (tmp_path / "script.py").write_text(script)
    ended = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert ended.returncode == -signal.SIGKILL
    children = [int(pid) for pid in ended.stdout.split()]
    assert len(children) == 2
    until = time.monotonic() + 300
    while time.monotonic() < until and any(map(_lives, children)):
        time.sleep(0.05)
    assert not any(map(_lives, children))


def _lives(pid: int) -> bool:
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False


def test_of_processes_that_were_stopped_no_thread_is_left() -> None:
    """One that ends later may meet the end of the interpreter, which then complains."""
    before = {*threading.enumerate()}

    def stopped() -> None:
        with executors.processes(2) as pool:
            pool.submit(time.sleep, 600)
            raise KeyboardInterrupt

    for _ in range(3):
        with pytest.raises(KeyboardInterrupt):
            stopped()
        assert {*threading.enumerate()} <= before


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGSTOP")
@pytest.mark.parametrize("what", few(["SIGSTOP", "SIGKILL", "writes on"], quick=["SIGKILL"]))
def test_of_processes_that_cannot_tidy_up_no_file_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    """Being too busy to obey in time, killed by somebody, or just unpacking something."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    workers, failure = 2, KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt) as caught, executors.processes(workers) as pool:  # noqa: PT012
        asked = [pool.submit(tasks.scratch_of_one, tmp_path, workers) for _ in range(workers)]
        places = {task.result() for task in asked}
        assert len(places) == workers
        for pid, place in places:
            assert place.is_dir()
            if what == "writes on":
                pool.submit(tasks.write_on, place)
            else:
                os.kill(pid, getattr(signal, what))
        while what == "writes on" and not all((place / "0").exists() for _, place in places):
            time.sleep(0.01)
        raise failure
    assert caught.value is failure
    assert os.listdir(tmp_path) == []


def test_a_worker_that_ended_before_it_got_runs_is_said_too() -> None:
    """It may end between two parts: then handing over the next one fails."""
    with ProcessPoolExecutor(1) as pool:
        with pytest.raises(BrokenExecutor):
            pool.submit(os._exit, 1).result()
        prepared = campaign.prepare(study.load(MADE))
        with (
            executors.ready(prepared, How(executor=pool)) as simulate,
            pytest.raises(ConfigurationError, match=r"workers: must live until their runs are"),
        ):
            next(iter(simulate([campaign.batch(prepared, 1, 1)], lambda part, share: None)))


def test_a_worker_process_that_ends_is_said_and_nothing_is_lost(
    tmp_path: Path, seam: Seam, reference: bytes
) -> None:
    seam.tuned(batch=8)
    import multiprocessing

    def kill(share: float) -> None:
        if share > 0.3:
            for child in multiprocessing.active_children():
                child.kill()

    with pytest.raises(ConfigurationError, match=r"workers: must live until their runs are done"):
        study.load(MADE).run(tmp_path / "out", executor="processes", workers=2, progress=kill)
    kept = store.table(tmp_path / "out")
    assert 0 < len(kept) < 40
    assert (kept["point"].value_counts() == len(kept) / 8).all()  # balanced
    study.load(MADE).run(tmp_path / "out")
    assert (tmp_path / "out" / "runs.parquet").read_bytes() == reference


def test_bad_workers_get_one_line_and_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seam: Seam
) -> None:
    original = distributed.Client.wait_for_workers

    def wait(client: distributed.Client, number: int, timeout: float) -> Any:
        return original(client, number, 1)

    seam.tuned(worker_patience=1)
    made = study.load(MADE)
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"scheduler": "tcp://127.0.0.1:1"}, r"that answers, got 'tcp://127.0.0.1:1'"),
        ({"scheduler": "nothing://"}, r"that answers, got 'nothing://' \(unknown address scheme"),
        ({"executor": "proceses"}, r"got 'proceses'; did you mean 'processes'\?"),
        ({"executor": "processes", "scheduler": "tcp://127.0.0.1:1"}, "must not be given with"),
    ]
    with LocalCluster(n_workers=0, dashboard_address=None, host="127.0.0.1") as empty:
        wrong.append(({"scheduler": empty.scheduler_address}, "must have workers, got none"))
        for arguments, message in wrong:
            if arguments.get("scheduler") == empty.scheduler_address:  # it answers, however late
                seam.tuned(worker_patience=300)
                monkeypatch.setattr(distributed.Client, "wait_for_workers", wait)
            with pytest.raises(ConfigurationError, match=message) as caught:
                made.run(tmp_path / "out", **arguments)
            assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_workers_of_another_version_are_refused(seam: Seam) -> None:
    parcel = executors.pack(campaign.prepare(study.load(MADE)))
    seam.instead(importlib.metadata.version, lambda _: "0.0")
    with pytest.raises(ConfigurationError, match=r"workers: must have sblcosim .*, got 0\.0"):
        executors.unpack(parcel)


def started(folder: Path) -> subprocess.Popen[str]:
    """A study in processes of its own, which a terminal's Ctrl-C reaches."""
    return subprocess.Popen(
        [sys.executable, "-m", "sblcosim", "study", "paper-scenario-1", "--executor", "processes",
         "--replicates", "500"],
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip


def interrupted(process: subprocess.Popen[str]) -> str:
    """What a command writes to stderr after a Ctrl-C in its terminal."""
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=300)
    assert process.returncode == 130
    return err


def test_ctrl_c_ends_processes_quietly(tmp_path: Path) -> None:
    process = started(tmp_path)
    parts = tmp_path / "studies" / "paper-scenario-1" / "parts"
    until = time.monotonic() + 300
    while time.monotonic() < until and not (parts.is_dir() and list(parts.glob("*.parquet"))):
        assert process.poll() is None, process.communicate()
        time.sleep(0.005)
    err = interrupted(process)
    assert err.startswith("interrupted; ")
    assert err.count("\n") == 1


@pytest.mark.skipif(not Path("/proc/self/cmdline").exists(), reason="looks for processes in /proc")
@pytest.mark.slow
@pytest.mark.parametrize("moment", [0.0, 0.02, 0.1, 0.3])
def test_ctrl_c_while_processes_start_is_quiet(tmp_path: Path, moment: float) -> None:
    def of_a_worker(folder: Path) -> bool:
        try:
            words = (folder / "cmdline").read_bytes()
            return b"spawn_main" in words and os.getsid(int(folder.name)) == process.pid
        except OSError:  # it has ended
            return False

    process = started(tmp_path)
    until = time.monotonic() + 300
    while not any(map(of_a_worker, Path("/proc").glob("[0-9]*"))):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
    time.sleep(moment)
    err = interrupted(process)
    assert err.startswith("interrupted")
    assert err.count("\n") == 1


def test_ctrl_c_is_deferred_and_not_lost() -> None:
    reached = False
    with (  # noqa: PT012
        pytest.raises(KeyboardInterrupt), stopping.stoppable(), executors.deferring_signals()
    ):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(2 * stopping.GRACE)
        reached = True
    assert reached
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.slow
def test_the_table_of_a_part_is_that_of_its_pieces(tmp_path: Path) -> None:
    study.load(MADE).run(tmp_path / "one", workers=1)
    study.load(MADE).run(tmp_path / "two", executor="processes", workers=2)
    parts = [sorted((tmp_path / n / "parts").iterdir()) for n in ("one", "two")]
    assert [p.name for p in parts[0]] == [p.name for p in parts[1]]
    for one, two in zip(*parts, strict=True):
        pd.testing.assert_frame_equal(pd.read_parquet(one), pd.read_parquet(two), check_exact=True)


@pytest.mark.slow
def test_a_scheduler_that_is_gone_is_said_in_one_line_and_nothing_is_lost(tmp_path: Path) -> None:
    address = tmp_path / "scheduler.json"
    programs = [
        ["dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
         "--scheduler-file", str(address)],
        ["dask_worker", "--scheduler-file", str(address), "--no-nanny", "--no-dashboard"],
    ]  # fmt: skip
    running = [
        subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.{name}", *options],
            cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        for name, *options in programs
    ]  # fmt: skip
    try:
        until = time.monotonic() + 300
        while time.monotonic() < until and not (address.exists() and address.read_text()):
            time.sleep(0.05)
        scheduler = json.loads(address.read_text())["address"]
        study_command = [
            sys.executable, "-m", "sblcosim", "study", "paper-scenario-1", "--replicates", "500",
            "--scheduler", scheduler,
        ]  # fmt: skip
        campaign_ = subprocess.Popen(
            study_command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        parts = tmp_path / "studies" / "paper-scenario-1" / "parts"
        while time.monotonic() < until and not (parts.is_dir() and list(parts.glob("*.parquet"))):
            assert campaign_.poll() is None, campaign_.communicate()
            time.sleep(0.005)
        running[0].kill()
        out, err = campaign_.communicate(timeout=600)
    finally:
        for process in running:
            process.kill()
            process.wait()
    assert (campaign_.returncode, out) == (2, "")
    assert err.count("\n") == 1
    assert err.startswith("error: --scheduler: must stay until all runs are done")
    assert err.endswith("finished runs are kept, and the same command continues with them\n")
    assert len(store.table(tmp_path / "studies" / "paper-scenario-1")) >= 2048


def test_an_fmu_that_was_received_and_damaged_is_taken_from_the_parcel(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seam: Seam
) -> None:
    parcel = executors.pack(campaign.prepare(study.load(MADE)))
    monkeypatch.setenv("SBLCOSIM_CACHE", str(tmp_path))
    for damage in (b"", b"PK"):
        seam.forgets(executors)
        executors.unpack(parcel)
        for sha256, (name, content) in parcel.fmus.items():
            path = tmp_path / "received" / sha256 / name
            assert path.read_bytes() == content
            path.write_bytes(damage)


@pytest.mark.slow
def test_processes_that_draw_end_with_the_one_that_started_them(tmp_path: Path) -> None:
    script = (
        "import os, signal, multiprocessing\n"
        "from sblcosim.report.paper import figures\n"
        "if __name__ == '__main__':\n"
        "    with figures.painters(2):\n"
        "        print(*[p.pid for p in multiprocessing.active_children()], flush=True)\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    (tmp_path / "script.py").write_text(script)
    with (tmp_path / "out").open("w") as out:  # a pipe would stay open with them
        subprocess.run([sys.executable, "script.py"], cwd=tmp_path, stdout=out, check=False)
    children = [int(pid) for pid in (tmp_path / "out").read_text().split()]
    assert len(children) == 2
    until = time.monotonic() + 300
    while time.monotonic() < until and any(map(_lives, children)):
        time.sleep(0.05)
    assert not any(map(_lives, children))

"""A campaign through the command line: killed, resumed, replayed."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
from seams import program

STUDY = """
scenario = "paper-scenario-1"
replicates = 150

[fixed.time]
duration_s = 20.0

[factors.gps]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]

[factors.sampling_time]
keys = ["time.sampling_time_s"]
levels = [0.1, 1.0]
"""
RUNS = 600
# Small batches, so that there is much to interrupt.
COMMAND = program(batch=4)


def command(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    (folder / "gps.toml").write_text(STUDY)
    return subprocess.Popen(
        [sys.executable, "-c", COMMAND, *arguments],
        cwd=folder,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def finish(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    out, err = process.communicate(timeout=600)
    return process.returncode, out, err


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a campaign that nobody disturbed."""
    folder = tmp_path_factory.mktemp("whole")
    code, out, err = finish(command(folder, "study", "gps.toml", "--workers", "1"))
    assert (code, err) == (0, "")
    assert f"{RUNS} runs, 0 failed" in out
    return folder / "studies" / "gps"


def some_parts(folder: Path, process: subprocess.Popen[str], number: int = 3) -> None:
    """Wait until a campaign has written some parts."""
    until = time.monotonic() + 300
    parts = folder / "studies" / "gps" / "parts"
    while time.monotonic() < until:
        if parts.is_dir() and len([p for p in parts.iterdir() if p.suffix == ".parquet"]) >= number:
            return
        assert process.poll() is None, finish(process)
        time.sleep(0.001)
    raise AssertionError("no parts")


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL")
@pytest.mark.slow
def test_a_campaign_that_is_killed_goes_on_and_ends_with_the_same_table(
    tmp_path: Path, whole: Path
) -> None:
    for _ in range(2):
        process = command(tmp_path, "study", "gps.toml")
        some_parts(tmp_path, process, 3)
        process.send_signal(signal.SIGKILL)
        assert finish(process)[0] == -signal.SIGKILL
    folder = tmp_path / "studies" / "gps"
    assert not (folder / "runs.parquet").exists()
    kept = {p.name: p.read_bytes() for p in (folder / "parts").iterdir() if p.suffix == ".parquet"}
    done = pd.concat(pd.read_parquet(folder / "parts" / name) for name in kept)
    assert 0 < len(done) < RUNS
    assert (done["point"].value_counts() == len(done) / 4).all()  # balanced
    code, _, err = finish(command(tmp_path, "study", "gps.toml"))
    assert (code, err) == (0, "")
    assert (folder / "runs.parquet").read_bytes() == (whole / "runs.parquet").read_bytes()
    for name, content in kept.items():
        assert (folder / "parts" / name).read_bytes() == content
    parts = [p for p in (folder / "parts").iterdir() if p.suffix == ".parquet"]
    assert sum(len(pd.read_parquet(p)) for p in parts) == RUNS  # nothing was done twice


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals")
@pytest.mark.parametrize(("number", "expected"), [
    (signal.SIGINT, 130), pytest.param(signal.SIGTERM, 143, marks=pytest.mark.slow),
])  # fmt: skip
def test_ctrl_c_says_how_to_resume(
    tmp_path: Path, whole: Path, number: signal.Signals, expected: int
) -> None:
    process = command(tmp_path, "study", "gps.toml")
    some_parts(tmp_path, process)
    process.send_signal(number)
    code, _, err = finish(process)
    assert code == expected
    assert err.startswith("interrupted; ")
    assert f" of {RUNS} runs are in studies/gps; go on with: sblcosim study gps.toml" in err
    assert err.count("\n") == 1
    assert finish(command(tmp_path, "study", "gps.toml"))[0] == 0
    resumed = tmp_path / "studies" / "gps" / "runs.parquet"
    assert resumed.read_bytes() == (whole / "runs.parquet").read_bytes()


def test_runs_that_fail_are_rows_of_the_table(tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text(
        STUDY.replace("150", "2").replace("[0.1, 1.0]", "[0.1, 1e300]").replace(
            "time.sampling_time_s", "acoustics.range_std_m"
        )
        + "[fixed.receiver]\nrange_std_m = 0.1\n"
    )
    code, out, err = finish(command(tmp_path, "study", "bad.toml"))
    assert (code, err) == (0, "")
    assert "\n8 runs, 4 failed\n  e.g. " in out
    table = pd.read_parquet(tmp_path / "studies" / "bad" / "runs.parquet")
    assert (table["error"].notna() == (table["sampling_time"] > 1)).all()
    assert table["ekf.absolute_total_rms_m"].isna().sum() == 4


def test_a_dry_run_writes_nothing(tmp_path: Path) -> None:
    code, out, err = finish(command(tmp_path, "study", "gps.toml", "--dry-run"))
    assert (code, err) == (0, "")
    # per point: 200 steps at 0.1 s, 20 at 1 s
    assert out.startswith("4 points x 150 replicates = 600 runs, 66000 steps; about ")
    assert [p.name for p in tmp_path.iterdir()] == ["gps.toml"]


def test_a_dry_run_tells_what_is_missing(tmp_path: Path, whole: Path) -> None:
    shutil.copytree(whole, tmp_path / "studies" / "gps")
    (tmp_path / "studies" / "gps" / "runs.parquet").unlink()
    code, out, err = finish(command(tmp_path, "study", "gps.toml", "--dry-run"))
    assert (code, err) == (0, "")
    assert out.endswith("; 600 runs are in studies/gps; nothing was run\n")
    code, out, err = finish(
        command(tmp_path, "study", "gps.toml", "--dry-run", "--replicates", "160")
    )
    assert "= 640 runs, " in out
    assert "; 600 runs are in studies/gps; about " in out
    assert not (tmp_path / "studies" / "gps" / "runs.parquet").exists()


def test_a_run_of_a_campaign_can_be_replayed(tmp_path: Path, whole: Path) -> None:
    run_id = pd.read_parquet(whole / "runs.parquet")["run_id"][17]
    shutil.copytree(whole, tmp_path / "results")
    code, out, err = finish(
        command(tmp_path, "replay", "results", run_id, "--out", "again", "--no-figures")
    )
    assert (code, err) == (0, "")
    assert "written to again" in out
    assert (tmp_path / "again" / "record.parquet").exists()


def mounts() -> bool:
    """Whether this machine lets us mount a small file system of our own."""
    ask = ["unshare", "--map-root-user", "--mount", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]
    try:
        return subprocess.run(ask, capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        return False


@pytest.mark.slow
@pytest.mark.skipif(not mounts(), reason="needs a file system of its own")
def test_a_disk_that_is_full_ends_it_in_one_line_and_what_is_done_stays(
    tmp_path: Path, whole: Path
) -> None:
    out = tmp_path / "studies"
    out.mkdir()
    (tmp_path / "gps.toml").write_text(STUDY)
    script = (
        f"mount -t tmpfs -o size=256k tmpfs {out} || exit 99\n"
        f"{sys.executable} -c '{COMMAND}' study gps.toml; code=$?\n"
        f"ls -A {out}/gps/parts | grep -v parquet$ >&2\n"  # nothing half-written
        f"mkdir {tmp_path}/kept && cp -r {out}/gps {tmp_path}/kept/\n"
        "exit $code\n"
    )
    ended = subprocess.run(
        ["unshare", "--map-root-user", "--mount", "sh", "-c", script],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (ended.returncode, ended.stdout) == (2, "")
    assert "must be writable, got No space left on device; finished runs" in ended.stderr
    assert ended.stderr.count("\n") == 1
    kept = tmp_path / "kept" / "gps"
    done = [p.name for p in (kept / "parts").iterdir()]
    assert done
    code, _, err = finish(command(tmp_path, "study", "gps.toml", "--out", "kept/gps"))
    assert (code, err) == (0, "")
    assert (kept / "runs.parquet").read_bytes() == (whole / "runs.parquet").read_bytes()


@pytest.mark.slow
def test_bad_input_gets_one_line(tmp_path: Path, whole: Path) -> None:
    shutil.copytree(whole, tmp_path / "results")
    for arguments, message in (
        (["study", "nothing"], "error: study: must be a TOML file or one of"),
        (["study", "paper-scenario-1", "--out", "results"], "got those of 'gps' with other"),
        (["study", "gps.toml", "--master", "fast"], "error: --master: must be"),
        (["replay", "results", "nothing"], "error: run: must be the run_id of one run in results"),
        (["replay", "nowhere", "a"], "error: nowhere: must be a folder of a study's results"),
    ):
        code, out, err = finish(command(tmp_path, *arguments))
        assert (code, out) == (2, ""), arguments
        assert message in err
        assert err.count("\n") == 1


def test_the_shipped_studies_are_listed(tmp_path: Path) -> None:
    code, out, err = finish(command(tmp_path, "studies"))
    assert (code, err) == (0, "")
    assert len(out.splitlines()) == 4
    assert "ways-to-range     Ways to range: error against distance" in out
    assert "The paper's study of Scenario 3: random path" in out

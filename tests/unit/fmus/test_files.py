"""Files that are whole or not there, and nothing that stays of processes that were killed."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest
from sblcosim.fmus import files
from seams import Seam

POSIX = pytest.mark.skipif(os.name == "nt", reason="POSIX")

START = """
import sys, time
from pathlib import Path
from sblcosim.fmus import files

def wait():
    print("there", flush=True)
    sys.stdin.read()

folder = Path(sys.argv[1])
"""


def start(script: str, folder: Path) -> subprocess.Popen[str]:
    """A process that has come to the place where it waits."""
    process = subprocess.Popen(
        [sys.executable, "-c", START + script, str(folder)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "TMPDIR": str(folder), "TEMP": str(folder)},
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "there\n"
    return process


def kill(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.communicate()


UNFINISHED = """
with files.unfinished(folder) as path:
    path.mkdir()
    (path / "half.txt").write_text("half")
    wait()
"""


@pytest.fixture(autouse=True)
def untidy(seam: Seam) -> None:
    seam.forgets(files)


def test_a_file_appears_when_it_is_complete_and_nothing_beside_it(tmp_path: Path) -> None:
    for content in (b"one", b"two"):
        files.write_file(tmp_path / "deep" / "file", content)
        assert (tmp_path / "deep" / "file").read_bytes() == content
        assert os.listdir(tmp_path / "deep") == ["file"]


def test_a_file_that_must_not_give_way_stays(tmp_path: Path) -> None:
    files.write_file(tmp_path / "file", b"one", replace=False)
    with pytest.raises(FileExistsError):
        files.write_file(tmp_path / "file", b"two", replace=False)
    assert (tmp_path / "file").read_bytes() == b"one"
    assert os.listdir(tmp_path) == ["file"]


def test_two_that_make_the_same_new_file_do_not_both_succeed(
    tmp_path: Path, seam: Seam
) -> None:
    def quicker(folder: Path) -> bool:
        (folder / "file").write_bytes(b"theirs")
        return False

    seam.instead(files.sweep, quicker)
    with pytest.raises(FileExistsError):
        files.write_file(tmp_path / "file", b"mine", replace=False)
    assert (tmp_path / "file").read_bytes() == b"theirs"


def test_what_is_no_file_is_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    with pytest.raises(FileExistsError):
        files.write_file(tmp_path / "folder", b"")
    assert (tmp_path / "folder").is_dir()


@pytest.mark.parametrize("durable", [True, False])
def test_a_file_that_cannot_be_finished_is_not_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, durable: bool
) -> None:
    (tmp_path / "file").write_bytes(b"before")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="No space left"):
        files.write_file(tmp_path / "file", b"after", durable=durable)
    assert os.listdir(tmp_path) == ["file"]
    assert (tmp_path / "file").read_bytes() == b"before"


def test_what_a_killed_process_left_is_removed_by_the_next(
    tmp_path: Path, seam: Seam
) -> None:
    process = start(UNFINISHED, tmp_path)
    assert len(os.listdir(tmp_path)) == 2
    files.sweep(tmp_path)
    assert len(os.listdir(tmp_path)) == 2  # it lives
    files.write_file(tmp_path / "file", b"")
    assert len(os.listdir(tmp_path)) == 3
    kill(process)
    assert len(os.listdir(tmp_path)) == 3
    seam.forgets(files)
    files.write_file(tmp_path / "file", b"")
    assert os.listdir(tmp_path) == ["file"]


def test_several_at_once_keep_their_hands_off_each_other(tmp_path: Path) -> None:
    living = [start(UNFINISHED, tmp_path) for _ in range(2)]
    dead = start(UNFINISHED, tmp_path)
    kill(dead)
    with files.unfinished(tmp_path) as mine:
        mine.write_text("mine")
        assert files.sweep(tmp_path)
        assert mine.read_text() == "mine"
        assert len(os.listdir(tmp_path)) == 6
    for process in living:
        kill(process)
    assert files.sweep(tmp_path)
    assert os.listdir(tmp_path) == []
    assert not files.sweep(tmp_path)


def test_what_was_moved_away_gets_its_name_back(tmp_path: Path) -> None:
    script = """
(folder / "result").mkdir()
with files.unfinished(folder, instead="result") as path:
    (folder / "result").rename(path)
    wait()
"""
    kill(start(script, tmp_path))
    assert not (tmp_path / "result").exists()
    files.sweep(tmp_path)
    assert os.listdir(tmp_path) == ["result"]


def test_what_was_moved_away_does_not_come_back_over_its_successor(tmp_path: Path) -> None:
    script = """
with files.unfinished(folder, instead="result") as path:
    path.mkdir()
    (folder / "result").write_text("new")
    wait()
"""
    kill(start(script, tmp_path))
    files.sweep(tmp_path)
    assert os.listdir(tmp_path) == ["result"]
    assert (tmp_path / "result").read_text() == "new"


@pytest.mark.parametrize("name", [".sblcosim-notes", ".sblcosim-notes.lock", "thesis.lock", ".x"])
def test_what_is_not_ours_stays(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("mine")
    files.sweep(tmp_path)
    assert os.listdir(tmp_path) == [name]


def test_scratch_is_removed_at_the_end_and_after_a_kill(tmp_path: Path) -> None:
    script = "(files.scratch() / 'file').write_text('x')\nwait()\n"
    process = start(script, tmp_path)
    assert len(os.listdir(tmp_path)) == 2
    process.communicate("")
    assert os.listdir(tmp_path) == []
    kill(start(script, tmp_path))
    assert len(os.listdir(tmp_path)) == 2
    process = start(script, tmp_path)
    assert len(os.listdir(tmp_path)) == 2  # its own
    process.communicate("")
    assert os.listdir(tmp_path) == []


def test_scratch_of_worker_processes_is_removed(tmp_path: Path) -> None:
    script = """
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
if __name__ == "__main__":
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        places = {str(pool.submit(files.scratch).result()) for _ in range(4)}
    assert all(place.startswith(str(folder)) for place in places)
    wait()
"""
    process = start(script, tmp_path)
    assert os.listdir(tmp_path) == []
    process.communicate("")


def test_scratch_is_removed_once_whoever_comes_first(tmp_path: Path) -> None:
    """A worker that is told to end, and ends just then, does both."""
    script = """
import os, threading
place = files.scratch()
threads = [threading.Thread(target=files.leave) for _ in range(20)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert os.listdir(folder) == []
with open(folder / "another", "w") as file:  # with the number that the lock had
    wait()
    files.leave()
    file.write("whole")
"""
    process = start(script, tmp_path)
    _, err = process.communicate("")
    assert (process.returncode, err) == (0, "")
    assert (tmp_path / "another").read_text() == "whole"


@POSIX
def test_scratch_that_is_just_made_is_removed_after_a_stop(tmp_path: Path) -> None:
    script = """
import os, signal, time
from sblcosim.fmus import stopping
make = Path.mkdir
def slow(*given, **named):
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(4 * stopping.GRACE)
    make(*given, **named)
Path.mkdir = slow
try:
    with stopping.stoppable(command=True):
        files.scratch()
except stopping.Terminated:
    wait()
"""
    process = start(script, tmp_path)
    _, err = process.communicate("")
    assert (process.returncode, err) == (0, "")
    assert os.listdir(tmp_path) == []


@POSIX
def test_a_forked_process_leaves_its_parents_scratch_alone(tmp_path: Path) -> None:
    script = """
import errno
import os
place = files.scratch()
if os.fork() == 0:
    sys.exit(0)
os.wait()
assert place.is_dir()
if os.fork() == 0:
    assert files.scratch() != place
    sys.exit(0)
os.wait()
wait()
"""
    process = start(script, tmp_path)
    assert len(os.listdir(tmp_path)) == 2
    process.communicate("")
    assert os.listdir(tmp_path) == []


@POSIX
def test_without_locks_all_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("fcntl.flock", refused)
    files.write_file(tmp_path / "file", b"x")
    assert os.listdir(tmp_path) == ["file"]


def test_deep_folders_are_made(tmp_path: Path) -> None:
    place = tmp_path.joinpath(*["d"] * 1200)
    files.make_folder(place)
    assert place.is_dir()
    os.system(f"rm -r '{tmp_path}/d'")  # pytest cannot


def test_an_empty_seal_seals_nothing(tmp_path: Path) -> None:
    (tmp_path / f"file{files.SEAL}").write_bytes(b"")
    assert not files.intact(tmp_path / "file")
    (tmp_path / "file").write_bytes(b"")
    assert not files.intact(tmp_path / "file")

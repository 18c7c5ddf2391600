"""On a full disk every command ends in one line, and leaves what was there as it was."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import made_logs
import pytest
from said import apart_from_compiling

COMMANDS = {
    "new": ["new", "PLACE/mine.toml"],
    "new over an old one": ["new", "PLACE/old.toml", "--force"],
    "build": ["build", "range_model", "--out", "PLACE"],
    "export": ["export", "ssp", "paper-scenario-1", "--out", "PLACE/mine.ssp"],
    "run": ["run", "paper-scenario-1", "--set", "time.duration_s=5", "--out", "PLACE/mine",
            "--no-figures"],
    "run into an empty folder": ["run", "paper-scenario-1", "--set", "time.duration_s=5", "--out",
                                 "PLACE/empty", "--no-figures"],
    "calibrate": ["calibrate", "--out", "PLACE/mine"],
    "run with its log and paths": ["run", "paper-scenario-1", "--set", "time.duration_s=5", "--out",
                                   "PLACE/mine", "--no-figures", "--log", "--trajectories", "tum"],
    "log": ["log", "PLACE/../dive", "--out", "PLACE/mine", "--no-figures", "--convert"],
    "log with its picture": ["log", "PLACE/../dive", "--out", "PLACE/mine"],
    "process": ["process", "PLACE/../dive", "--receiver", "sequential", "--out", "PLACE/mine",
                "--no-figures", "--trajectories", "tum"],
    "identify": ["identify", "PLACE/../dive", "--out", "PLACE/mine", "--no-figures"],
    "study": ["study", "paper-scenario-1", "--replicates", "1", "--out", "PLACE/study"],
}  # fmt: skip

SCRIPT = """
import json, os, resource, sys
from pathlib import Path
from sblcosim.cli import app
from sblcosim.fmus.build.factory import build
from typer.testing import CliRunner

place, commands, full = Path(sys.argv[1]), json.loads(sys.argv[2]), sys.argv[3]
(place / "old.toml").write_text("old")
(place / "empty").mkdir()
if full == "disk":
    with (place / "filling").open("wb", buffering=0) as file:
        try:
            while file.write(bytes(512)):
                pass
        except OSError:
            pass

def there():
    return {str(p): p.read_bytes() for p in place.rglob("*") if p.is_file()}

before, results = there(), {}
for name, arguments in commands.items():
    if full == "limit":
        resource.setrlimit(resource.RLIMIT_FSIZE, (200, resource.RLIM_INFINITY))
    done = CliRunner().invoke(app, [a.replace("PLACE", str(place)) for a in arguments])
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    left = sorted(os.path.relpath(p, place) for p in there().keys() ^ before.keys())
    same = all(there().get(p) == content for p, content in before.items())
    results[name] = [done.exit_code, done.stdout, done.stderr, left, same, repr(done.exception)]
print(json.dumps(results))
"""


def mounts() -> bool:
    """Whether this machine lets us mount a small file system of our own."""
    ask = ["unshare", "--map-root-user", "--mount", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]
    try:
        return subprocess.run(ask, capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        return False


DISK = pytest.param(
    "disk",
    ["unshare", "--map-root-user", "--mount", "sh", "-c",
     'mount -t tmpfs -o size=64k tmpfs "$1" && shift && exec "$@"', "sh"],
    marks=pytest.mark.skipif(not mounts(), reason="needs a file system of its own"),
)  # fmt: skip
LIMIT = pytest.param(
    "limit",
    ["env"],
    marks=pytest.mark.skipif(sys.platform == "win32", reason="no limits of files' sizes"),
)


@pytest.mark.slow
@pytest.mark.parametrize(("full", "prefix"), [DISK, LIMIT])
def test_every_file_is_there_whole_or_not_at_all(
    tmp_path: Path, full: str, prefix: list[str]
) -> None:
    place = tmp_path / "place"
    place.mkdir()
    made_logs.in_folder(tmp_path / "dive")
    done = subprocess.run(
        [*prefix, *([str(place)] if full == "disk" else []), sys.executable, "-c", SCRIPT,
         str(place), json.dumps(COMMANDS), full],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    for name, (code, out, err, left, same, raised) in json.loads(done.stdout).items():
        assert (code, out, same) == (2, "", True), (name, err, raised)
        assert left == [], name
        told = apart_from_compiling(err)
        assert told.startswith("error: "), name
        assert told.count("\n") == 1, (name, err)
        words = "No space left on device" if full == "disk" else "File too large"
        assert words in told, (name, err)

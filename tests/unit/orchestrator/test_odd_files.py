"""What is no file where one is expected, odd encodings, and messages that name the file."""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pyarrow as pa
import pytest
import sblcosim
from pyarrow import parquet
from said import apart_from_compiling
from sblcosim import study
from sblcosim.cli import app
from sblcosim.errors import ConfigurationError
from sblcosim.study import parts
from sblcosim.study.campaign import prepare
from sblcosim.tracks.read import read
from typer.testing import CliRunner

pytestmark = pytest.mark.skipif(os.name == "nt", reason="there are no such files")
PATIENCE = 600
"""For a command that refuses something [s]."""


def _fifo(path: Path) -> None:
    os.mkfifo(path)


def _device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def _socket(path: Path) -> None:
    here = os.getcwd()
    os.chdir(path.parent)  # a socket's path has at most 107 characters
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(path.name)
    os.chdir(here)


def _loop(path: Path) -> None:
    path.symlink_to(path.name)


ODD: dict[str, Callable[[Path], None]] = {
    "pipe": _fifo, "device": _device, "socket": _socket, "folder": Path.mkdir, "loop": _loop,
}  # fmt: skip

SCENARIO = "[time]\nduration_s = 1.0\nsampling_time_s = 0.1\n"
STUDY = """
scenario = "paper-scenario-1"
[factors.gps]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]
"""
QUESTION = """
scenario = "paper-scenario-1"
settling_time_s = 0
response = "absolute_total_rms_m"
limit = 1.0
[choices.gps]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]
costs = [2.0, 1.0]
"""
TRACK = SCENARIO + '[target]\ntrajectory = "file"\ntrack_file = "{}"\n'

# The name of the odd file is in the second place; what else is needed in the third.
CASES: list[tuple[str, str, dict[str, str]]] = [
    ("run {}", "x.toml", {}),
    ("plan {}", "x.toml", {}),
    ("compare {} --runs 2", "x.toml", {}),
    ("map {} --area 9x9 --depth 3", "x.toml", {}),
    ("budget {}", "x.toml", {}),
    ("study {}", "x.toml", {}),
    ("require {}", "x.toml", {}),
    ("run {}", "x.ssp", {}),
    ("run paper-scenario-1 --receiver {}", "x.fmu", {}),
    ("run paper-scenario-1 --receiver {}:C", "x.py", {}),
    ("compare paper-scenario-1 --runs 2 --response {}:f", "x.py", {}),
    ("check {}", "x.fmu", {}),
    ("conformance {}", "x.fmu", {}),
    ("export ssp {}", "x.toml", {}),
    ("export fmu {}", "x.toml", {}),
    ("run scenario.toml", "x.gpx", {"scenario.toml": TRACK.format("x.gpx")}),
    ("run scenario.toml", "x.csv", {"scenario.toml": TRACK.format("x.csv")}),
    ("run scenario.toml", "x.fmu", {"scenario.toml": SCENARIO + '[platform]\nfmu = "x.fmu"\n'}),
    ("study study.toml", "x.toml", {"study.toml": STUDY.replace("paper-scenario-1", "x.toml")}),
    ("study study.toml", "x.py", {"study.toml": 'responses = ["x.py:f"]\n' + STUDY}),
    ("study study.toml", "x.fmu", {"study.toml": 'receivers = ["x.fmu"]\n' + STUDY}),
    ("require q.toml", "x.toml", {"q.toml": QUESTION.replace("paper-scenario-1", "x.toml")}),
    ("smooth {}", "x", {}),
    ("analyse {}", "x", {}),
    ("analyse folder", "folder/study.json", {}),
    ("smooth folder", "folder/manifest.json", {"folder/record.parquet": ""}),
    ("run paper-scenario-1 --out folder", "folder/manifest.json", {}),
    ("run paper-scenario-1 --out {}", "x", {}),
    ("run paper-scenario-1 --runs 3 --out {}", "x", {}),
    ("study study.toml --out {}", "x", {"study.toml": STUDY}),
    ("map paper-scenario-1 --area 9x9 --depth 3 --out {}", "x", {}),
    ("budget paper-scenario-1 --out {}", "x", {}),
    ("compare paper-scenario-1 --receiver ekf --receiver coupled --out {}", "x", {}),
    ("require q.toml --out {}", "x", {"q.toml": QUESTION}),
    ("paper --quick --out {}", "x", {}),
    ("calibrate --out {}", "x", {}),
    ("advise results --costs {}", "x.toml", {}),
]


@contextmanager
def patience() -> Iterator[None]:
    def hung(*_: object) -> None:
        raise AssertionError("the command waits for ever")

    before = signal.signal(signal.SIGALRM, hung)
    signal.alarm(PATIENCE)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a small study."""
    file = tmp_path_factory.mktemp("study") / "study.toml"
    file.write_text(STUDY.replace("[factors", 'receivers = ["ekf"]\nreplicates = 2\n[factors'))
    out = file.with_name("results")
    done = CliRunner().invoke(app, ["study", str(file), "--out", str(out)])
    assert done.exit_code == 0, done.output
    return out


@pytest.mark.parametrize("kind", ODD)
@pytest.mark.parametrize(("command", "name", "beside"), CASES)
def test_what_is_no_file_is_refused_in_a_line(
    kind: str, command: str, name: str, beside: dict[str, str], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest,
) -> None:  # fmt: skip
    if kind == "folder" and name == "x":
        pytest.skip("that is what it must be")
    monkeypatch.chdir(tmp_path)
    if command.startswith("advise"):
        shutil.copytree(request.getfixturevalue("results"), "results")
    for other, text in beside.items():
        (tmp_path / other).parent.mkdir(exist_ok=True)
        (tmp_path / other).write_text(text)
    (tmp_path / name).parent.mkdir(exist_ok=True)
    ODD[kind](tmp_path / name)
    with patience():
        done = CliRunner().invoke(app, command.format(name).split())
    assert done.exit_code == 2, done.output
    assert "must not happen" not in done.stderr
    (line,) = [x for x in done.stderr.splitlines() if x.startswith("error: ")]
    # A folder whose manifest is not one is named itself, and of a link what it leads to.
    named = "folder" if name == "folder/manifest.json" else name
    names = [named, "/dev/zero"] if kind == "device" else [named]
    assert any(re.search(rf"(?<!\w){re.escape(one)}(?!\w)", line) for one in names), line
    if command.startswith("run") and kind in ("pipe", "device", "socket") and name != "x":
        assert f"a {kind}" in line or name == "folder/manifest.json"
        assert "did you mean" not in line


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path: Path) -> None:
    """Editors on Windows begin files with one."""
    file = tmp_path / "x.toml"
    file.write_text(SCENARIO)
    plain = sblcosim.load(file)
    file.write_text(SCENARIO, "utf-8-sig")
    assert sblcosim.load(file) == plain


@pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse such names")
def test_a_working_directory_that_is_no_utf_8_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = os.fsencode(tmp_path) + b"/n\xff"
    os.mkdir(folder)
    monkeypatch.chdir(os.fsdecode(folder))
    done = CliRunner().invoke(app, ["run", "paper-scenario-1"])
    assert done.exit_code == 2
    line = apart_from_compiling(done.stderr).strip()
    assert line.startswith("error: working directory: must have a name in UTF-8, got ")
    assert line.endswith("/n\\udcff'")


GPX = """<?xml version="1.0" encoding="{}"?>
<gpx version="1.1" creator="潜水" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>
<trkpt lat="59.0" lon="10.0"><ele>-5</ele><time>2024-01-01T00:00:00{}</time></trkpt>
<trkpt lat="59.0001" lon="10.0"><ele>-6</ele><time>2024-01-01T00:00:10{}</time></trkpt>
</trkseg></trk></gpx>"""


@pytest.mark.parametrize(
    "encoding",
    ["UTF-8", "utf-8-sig", "Shift_JIS", "EUC-JP", "ISO-2022-JP", "GB18030", "UTF-16", "UTF-32",
     "UTF-32-LE", "UTF-16-BE"],
)  # fmt: skip
def test_gpx_is_read_in_any_encoding(encoding: str, tmp_path: Path) -> None:
    file, plain = tmp_path / "a.gpx", tmp_path / "b.gpx"
    file.write_bytes(GPX.format(encoding, "Z", "Z").encode(encoding))
    plain.write_bytes(GPX.format("UTF-8", "Z", "Z").encode())
    assert read(file).times.tolist() == read(plain).times.tolist() == [0.0, 10.0]
    assert (read(file).points == read(plain).points).all()


@pytest.mark.parametrize("encoding", ["x-nope", "hex", "undefined", "", "潜水"])
def test_gpx_in_no_encoding_is_refused(encoding: str, tmp_path: Path) -> None:
    file = tmp_path / "a.gpx"
    file.write_bytes(GPX.format(encoding, "Z", "Z").encode())
    with pytest.raises(ConfigurationError, match=r"a\.gpx, line 1, column 1: must be XML in an"):
        read(file)


def test_gpx_that_is_not_in_its_encoding_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.gpx"
    for said, real in (("UTF-8", "Shift_JIS"), ("EUC-JP", "Shift_JIS"), ("ascii", "UTF-8")):
        file.write_bytes(GPX.format(said, "Z", "Z").encode(real))
        with pytest.raises(ConfigurationError, match=f"line 2, .*must be text in {said.upper()}"):
            read(file)


@pytest.mark.parametrize("zones", [("", "Z"), ("Z", ""), ("+01:00", "")])
def test_times_with_and_without_a_zone_are_refused(zones: tuple[str, str], tmp_path: Path) -> None:
    file = tmp_path / "a.gpx"
    file.write_text(GPX.format("UTF-8", *zones))
    with pytest.raises(ConfigurationError, match=r"a\.gpx, line 4, column 1 .*time zone"):
        read(file)


@pytest.mark.parametrize("metadata", [b"", b"{", b"\xff", b"[1"])
def test_a_part_with_broken_metadata_is_refused(metadata: bytes, tmp_path: Path) -> None:
    table = pa.table({"point": [1], "replicate": [1], "run_id": ["a"]})
    path = tmp_path / "p.parquet"
    parquet.write_table(table.replace_schema_metadata({"pandas": metadata}), path)
    with pytest.raises(ConfigurationError, match=r"p\.parquet: must be"):
        parts.table(parts.Parts(tmp_path, (path,), frozenset()))


@pytest.mark.parametrize("cost", ["1e308", "1e16"])
def test_costs_whose_sums_are_not_exact_are_refused(cost: str, tmp_path: Path) -> None:
    file = tmp_path / "q.toml"
    file.write_text(QUESTION.replace("2.0", cost).replace("limit = 1.0", "limit = 1e-300"))
    from sblcosim import require

    with pytest.raises(ConfigurationError, match=r"q\.toml: \[choices.gps\] costs: .*at most 1e"):
        require.load(file)


@pytest.mark.parametrize("closed", [(0,), (1,), (2,), (0, 2), (0, 1, 2)])
def test_closed_streams(closed: tuple[int, ...], tmp_path: Path) -> None:
    program = (
        f"import os; [os.close(n) for n in {closed}]; import sys\n"
        f"os.execv(sys.executable, [sys.executable, '-m', 'sblcosim', 'new', 'a.toml'])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True,
        timeout=PATIENCE, check=False,
    )  # fmt: skip
    if 1 in closed:
        assert done.returncode == 2
        said = "" if 2 in closed else "error: output: must be open, got it closed\n"
        assert done.stderr == said
        assert list(tmp_path.iterdir()) == []
    else:
        assert (done.returncode, done.stderr) == (0, "")
        assert (tmp_path / "a.toml").is_file()


# --- Messages name the file ----------------------------------------------------------------------

AFTER_LOADING = {
    "path of a still diver": '[time]\nduration_s = "path"\n[target]\nspeed_m_s = 0.0\n',
    "an FMU that is missing": SCENARIO + '[platform]\nfmu = "none.fmu"\n',
    "intervals": "[time]\nduration_s = 0.05\nsampling_time_s = 0.1\n",
}


@pytest.mark.parametrize("text", AFTER_LOADING.values(), ids=AFTER_LOADING)
@pytest.mark.parametrize("named", ["", 'name = "other"\n'])
@pytest.mark.parametrize("command", ["run", "compare --runs 2", "budget", "run --runs 2"])
def test_checks_after_loading_name_the_file(
    command: str, named: str, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my-dive.toml").write_text(named + text)
    word, *options = command.split()
    done = CliRunner().invoke(app, [word, "my-dive.toml", *options])
    assert done.exit_code == 2, done.output
    errors = [x for x in done.stderr.splitlines() if x.startswith("error: ")]
    assert errors
    assert all(x.startswith("error: my-dive.toml: ") or "none.fmu" in x for x in errors), errors


@pytest.mark.parametrize(
    "change",
    ['responses = ["none.py:f"]', "responses = 3", 'responses = ["nope"]',
     'scenario = "none.toml"', 'receivers = ["efk"]'],
)  # fmt: skip
def test_what_is_wrong_in_a_study_names_the_file(change: str, tmp_path: Path) -> None:
    file = tmp_path / "my-study.toml"
    text = STUDY if change[:3] != "sce" else STUDY.replace('scenario = "paper-scenario-1"', "")
    file.write_text(f"{change}\n{text}")
    with pytest.raises(ConfigurationError) as caught:
        prepare(study.load(file))
    assert all(line.startswith(f"{file}: ") for line in str(caught.value).splitlines())


def test_what_is_wrong_at_a_point_names_the_file(tmp_path: Path) -> None:
    file = tmp_path / "my-study.toml"
    file.write_text(
        STUDY.replace("platform.gps_horizontal_std_m", "time.duration_s").replace("0.1", "0.05")
    )
    with pytest.raises(ConfigurationError) as caught:
        prepare(study.load(file))
    assert all(str(file) in line for line in str(caught.value).splitlines())

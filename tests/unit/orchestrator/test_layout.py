"""Text that fits a terminal, also a real one, and stays as it is in a pipe."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import log_samples
import pytest
from sblcosim.layout import filled, fitted, table
from sblcosim.results.figures.drawing import wrapped
from sblcosim.scenario.scenario import shipped

LONG = "ekf: 2.9 m RMS, 95 % within 5.1 m; claims 0.6 m: do not trust its covariance, says NEES"


def test_lines_that_fit_are_left_alone() -> None:
    text = "a  b\n\n  c" + " " * 3 + "d\n"
    assert fitted(text, 60) == text
    assert fitted(LONG, None) == LONG
    assert fitted(LONG, len(LONG)) == LONG


@pytest.mark.parametrize("width", range(24, len(LONG)))
def test_long_lines_are_wrapped_between_words_and_indented(width: int) -> None:
    first, *rest = fitted(f"  {LONG}", width).split("\n")
    assert first.startswith("  ekf")
    assert all(line.startswith("    ") and line[4] != " " for line in rest)
    assert max(map(len, (first, *rest))) <= width
    assert " ".join(line.strip() for line in (first, *rest)) == LONG
    assert not any(line.strip().startswith(("%", "m;", "m:")) for line in rest)


@pytest.mark.parametrize("width", range(9, 60, 3))
def test_labels_of_figures_keep_numbers_with_their_units(width: int) -> None:
    words = "5 % outliers; surveyed to 0.03 m (1σ); 25 % loss; 0.4 m/s; errors from 20 s to 60 s"
    for lines in (filled(words, width), wrapped(words, width / 13)):
        assert " ".join(lines.split("\n")) == words
        assert not [line for line in lines.split("\n") if line.startswith(("%", "m ", "m/", "s "))]


def test_a_path_is_left_whole() -> None:
    path = "runs/" + "x" * 80
    assert path in fitted(f"written to {path}", 40).split()


def test_a_table_is_as_wide_as_it_must_be_or_may_be() -> None:
    rows = [("ekf", "the paper's filter, with all that it needs", "3.25"), ("raw", "a fix", "12")]
    head = ("name", "what it is", "error [m]")
    wide = [*table(rows, None, head, (2,))]
    assert len(wide) == 3
    assert wide[1].endswith("       3.25")
    assert wide[2].endswith("         12")
    narrow = [*table(rows, 40, head, (2,))]
    assert max(map(len, narrow)) <= 40
    assert "3.25" in narrow[1]
    assert set(" ".join(wide).split()) == set(" ".join(narrow).split())
    for tight in range(24, 40):  # numbers are not broken while there is room for them
        row = ("a term", "1.234e-05", "0.1234%")
        lines = [*table([row], tight, ("", "to", "std of it"), (1, 2))]
        assert max(map(len, lines)) <= tight
        assert {"1.234e-05", "0.1234%"} <= set(" ".join(lines).split()), lines
    assert [*table([], None, head)] == ["name  what it is  error [m]"]
    assert [*table([("[bold]x[/bold]", ":smile:")], None)] == ["[bold]x[/bold]  :smile:"]


STUDY = """
scenario = "paper-scenario-1"
receivers = ["sequential", "coupled"]
replicates = 2
[fixed]
"time.duration_s" = 5.0
[factors.gps_of_the_platform]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]
[factors.noise_of_the_ranges]
keys = ["acoustics.range_std_m"]
levels = [0.1, 0.2]
"""
QUESTION = """
scenario = "paper-scenario-1"
response = "total_rms_m"
limit = 30.0
share = 0.5
most_runs = 700
settling_time_s = 2.0
[fixed.time]
duration_s = 5.0
[choices.gps_of_the_platform]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]
costs = [1000, 2]
"""
COMMANDS = [
    ["run", "paper-scenario-1", "--receiver", "coupled", "--receiver", "sequential", "--verbose",
     "--set", "time.duration_s=5", "--no-figures"],
    ["smooth", "runs/paper-scenario-1", "--no-figures"],
    ["plan", "paper-scenario-1"], ["plan", "paper-scenario-1", "--verbose"],
    ["calibrate"],
    ["log", "modem.log", "--verbose"],
    ["run", "harbour-lbl", "--set", "time.duration_s=60", "--log", "--no-figures",
     "--trajectories", "tum"],
    ["process", "runs/harbour-lbl/log", "--receiver", "sequential", "--verbose", "--smooth",
     "--no-figures"],
    ["process", "modem.log", "--no-figures"],
    ["identify", "runs/harbour-lbl/log", "--verbose", "--no-figures"],
    ["scenarios"], ["receivers"], ["studies"], ["schema"],
    ["study", "s.toml", "--dry-run"],
    ["study", "s.toml", "--verbose"],
    ["analyse", "studies/s", "--verbose", "--practical", "1"],
    ["advise", "studies/s", "--costs", "costs.toml", "--verbose"],
    ["budget", "paper-scenario-1", "--verbose", "--runs", "30", "--no-figures", "--better",
     "--set", "time.duration_s=5", "--with", "GPS+heading+range-noise"],
    ["require", "q.toml", "--verbose"], ["questions"],
    ["conformance", "fmus/fmi2/target.fmu", "--check", "description"],
    ["check", "fmus/fmi2/ekf.fmu"],
    ["new", "mine.toml"],
]  # fmt: skip
SCRIPT = """
import json, sys
from sblcosim.cli import app
app(["build", "target", "ekf", "--fmi", "2"], standalone_mode=False)
for command in json.loads(sys.argv[1]):
    print("$", command[0], flush=True)
    app(command, standalone_mode=False)
    sys.stdout.flush()
"""


def printed(folder: Path, columns: int | None) -> dict[str, list[str]]:
    """Lines of each command, on a terminal of so many columns or in a pipe."""
    (folder / "s.toml").write_text(STUDY)
    (folder / "q.toml").write_text(QUESTION)
    (folder / "modem.log").write_text(log_samples.modem()["modem.log"])
    (folder / "costs.toml").write_text("gps_of_the_platform = [900, 40]\n")
    command = [sys.executable, "-c", SCRIPT, json.dumps(COMMANDS)]
    environment = os.environ | {"COLUMNS": "33"} if columns is None else {**os.environ}
    if columns is None:
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, check=True
        )
        text = done.stdout
    else:
        text = _on_terminal(command, folder, columns)
    lines: dict[str, list[str]] = {}
    for part in text.split("$ ")[1:]:
        name, *rest = part.splitlines()
        lines.setdefault(name, []).extend(rest)
    return lines


def _on_terminal(command: list[str], folder: Path, columns: int) -> str:
    import fcntl
    import pty
    import termios

    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    kept = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES")}
    process = subprocess.Popen(
        command, cwd=folder, env=kept, stdout=theirs, stderr=subprocess.PIPE, text=True
    )
    os.close(theirs)
    text = b""
    while True:
        try:
            some = os.read(ours, 65536)
        except OSError:  # how Linux says that nobody writes any more
            some = b""
        if not some:
            break
        text += some
    os.close(ours)
    assert process.stderr is not None
    errors = process.stderr.read()
    assert process.wait() == 0, errors
    return text.decode().replace("\r\n", "\n")


@pytest.mark.skipif(sys.platform == "win32", reason="no such terminals")
def test_what_is_printed_fits_the_terminal(tmp_path: Path) -> None:
    columns = 60
    lines = printed(tmp_path, columns)
    assert set(lines) == {command[0] for command in COMMANDS}
    long = {name: [li for li in some if len(li) > columns] for name, some in lines.items()}
    assert not any(long.values()), long
    assert not any("\x1b" in line for some in lines.values() for line in some)


@pytest.mark.slow
def test_a_pipe_gets_whole_lines_whatever_the_terminal(tmp_path: Path) -> None:
    lines = printed(tmp_path, None)
    assert any(len(line) > 100 for line in lines["study"])
    assert any(line.startswith("coupled: ") and " claims " in line for line in lines["run"])
    assert len(lines["scenarios"]) == len(shipped())


@pytest.mark.parametrize("unit", [
    "%", "m", "s", "ms", "cm", "mm", "km", "m/s", "Hz", "kHz", "min", "h", "ppm", "°C", "µs",
])
def test_no_number_is_parted_from_its_unit(unit: str) -> None:
    """At any width that holds them; a word that only begins like a unit may be parted."""
    text = f"a clock that is off by 0.9 {unit} and more, of 3 methods"
    for width in range(len(f"0.9 {unit}") + 1, len(text)):
        assert f"0.9 {unit}" in filled(text, width)
    assert any("of 3\n" in filled(text, width) or "\n3\n" in filled(text, width)
               for width in range(12, len(text)))  # fmt: skip

"""The command that begins a scenario: its options, its questions on a terminal, what it writes."""

from __future__ import annotations

import os
import random
import re
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from click.testing import Result
from sblcosim.cli import app
from sblcosim.models.platform.gps import GRADES
from sblcosim.scenario.decided import decided
from sblcosim.scenario.decisions import DECISIONS
from sblcosim.scenario.explained import explained
from sblcosim.scenario.file_schema import FILE_NAME
from sblcosim.scenario.likes import ASKED, LIKES, USUAL
from sblcosim.scenario.scenario import Scenario, load
from sblcosim.words.numbers import meters
from typer.testing import CliRunner

ANSWERS = {
    "beacons": "2 1 0.5; 2 -1 0.5; -2 0 1.5", "mounting": "0.2 m", "gps": "RTK", "compass": "5°",
    "sea": "Beaufort 3", "pings": "2 Hz", "noise": "0.3 m", "path": "Circle",
    "depth": "4, 9", "speed": "0.3 m/s",
}  # fmt: skip
ON_A_TERMINAL = [sys.executable, "-m", "sblcosim", "new"]


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def new(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["new", *arguments])


def content(scenario: Scenario) -> dict[str, Any]:
    return scenario.model_dump(exclude={"name"})


def test_each_question_has_an_option_in_the_order_of_the_questions() -> None:
    command = typer.main.get_command(app).commands["new"]  # type: ignore[attr-defined]
    options = [option[2:] for param in command.params for option in param.opts]
    assert [name for name in options if name in ASKED] == [*ASKED]
    for param in command.params:
        if param.name in ASKED:
            assert ASKED[param.name].about in param.help
    assert {*ANSWERS} == {*ASKED}


def test_options_are_the_answers_and_say_how_they_were_read() -> None:
    done = new("mine", *(word for name, text in ANSWERS.items() for word in (f"--{name}", text)))
    assert done.exit_code == 0, done.output
    begin = load(LIKES[USUAL].source)
    assert content(load("mine.toml")) == content(decided(begin, ANSWERS).scenario)
    assert "gps: rtk_fixed\n" in done.stderr
    assert "pings: 0.5 s\n" in done.stderr
    assert "compass" not in done.stderr


@pytest.mark.parametrize("name", ASKED)
def test_the_example_of_a_question_is_an_answer(name: str) -> None:
    done = new("mine", f"--{name}", ASKED[name].example)
    assert done.exit_code == 0, done.output
    begin = load(LIKES[USUAL].source)
    assert content(load("mine.toml")) != content(begin)


@pytest.mark.parametrize(
    ("options", "words"),
    [(["--gps", "rtkk"], "--gps: must be standalone, sbas, differential, rtk_float or rtk_fixed, "
                         "got 'rtkk'; did you mean 'rtk'?"),
     (["--gps", "0.3 m"], "or sizes of the errors as platform.gps_… in the file, got '0.3 m'"),
     (["--noise", "-1"], "--noise: must be at least 0.0, got -1"),
     (["--depth", "-5"], "--depth: must be at least 0.0, got -5"),
     (["--speed", "fast"], "--speed: must be a number in m/s, got 'fast'"),
     (["--beacons", "0.5, 0.5, 1"], "--beacons: must be an array of 3 to 8 rows of 3 numbers, got "
                                    "[0.5, 0.5, 1]"),
     (["--beacons", "6"], "--beacons: must have a unit or a length, '6 m' for arms of 6 m or "
                          "'6 x 3 m' for 6 beacons on arms of 3 m, got '6'"),
     (["--beacons", "9 x 3 m"], "--beacons: must be at most 8, got 9"),
     (["--like", "lbl", "--gps", "rtk"], "--gps: must be left out, as beacons on the bottom have "
                                         "none, got 'rtk'"),
     (["--like", "bouys"], "--like: must be platform, water-linked, usbl, buoys, lbl or paper, got "
                           "'bouys'; did you mean 'buoys'?"),
     (["--like", "lbl", "--from", "realistic-dive"], "--like: must come without --from, got both"),
     (["--path", "0 0; 9 0"], "--path: must be points, each north, east and down in m, e.g. 0 0 5; "
                              "20 0 8, got '0 0; 9 0'"),
     (["--path", "no.gpx"], "no.gpx: no such file")],
)  # fmt: skip
def test_a_wrong_option_is_one_line_and_writes_nothing(options: list[str], words: str) -> None:
    done = new("mine.toml", "--yes", *options)
    assert (done.exit_code, done.stdout) == (2, "")
    assert re.fullmatch(r"error: [^\n]*" + re.escape(words) + "\n", done.stderr), done.stderr
    assert not [*Path().iterdir()]


def test_the_question_about_the_gps_says_how_good_each_is() -> None:
    takes = DECISIONS["gps"].takes(load(LIKES[USUAL].source))
    for name, grade in GRADES.items():
        errors = np.random.default_rng(1).normal(0.0, grade.horizontal, (200_000, 2))
        within = np.quantile(np.hypot(*errors.T), 0.95)
        assert within == pytest.approx(grade.within, rel=0.01)
        assert f"{name} ({meters(grade.within)})" in takes


@pytest.mark.parametrize(("word", "grade"), [
    ("ordinary", "standalone"), ("Autonomous", "standalone"), ("WAAS", "sbas"), ("egnos", "sbas"),
])  # fmt: skip
def test_a_gps_is_known_under_the_names_that_people_have_for_it(word: str, grade: str) -> None:
    assert new("mine", "--gps", word).exit_code == 0
    assert load("mine.toml").platform.gps_grade == grade


def test_the_time_between_pings_is_not_that_of_one_beacon() -> None:
    """Words say so, of the option and in the file, and say how all ping at once."""
    for words in (ASKED["pings"].about, explained("time", "sampling_time_s")):
        assert "ne beacon pings after the other, so each of four pings every 4 T" in words
        assert 'acoustics.schedule = "simultaneous" lets all ping at once' in words
    takes = DECISIONS["pings"].takes
    at_once = {"acoustics.schedule": "simultaneous"}
    for keys, every in (({}, "4 T"), (at_once, "T")):
        scenario = load(LIKES["platform"].source, keys)
        assert takes(scenario).endswith(f"each of 4 beacons pings every {every}")
    assert takes(load(LIKES["water-linked"].source)).endswith(
        "the diver pings every T, and all beacons hear it"
    )


def test_the_page_says_what_the_usual_system_takes_to_be_perfect() -> None:
    """Each of its keys is at a value that makes no error, and the example changes it."""
    page = (Path(__file__).parents[3] / "docs/howto/own-system.md").read_text("utf-8")
    table = page[page.index("| perfect in `platform`") : page.index("sblcosim new plain.toml")]
    named = dict(re.findall(r"`(\w+\.\w+) = ([^`]+)`", table))
    usual = load(LIKES[USUAL].source)
    assert len(named) == 7
    changed = load(usual, [(key, tomllib.loads(f"x = {text}")["x"]) for key, text in named.items()])
    for key, text in named.items():
        component, own = key.split(".")
        before = getattr(getattr(usual, component), own)
        assert before != getattr(getattr(changed, component), own)
        assert f"--set {key}={text.strip(chr(34))}" in page
        assert own in ("sound_speed_m_s", "outlier_mean_m") or not before
    assert usual.acoustics.sound_speed_m_s == usual.acoustics.assumed_sound_speed_m_s


def test_noise_may_be_in_centimetres() -> None:
    assert new("mine", "--noise", "5 cm").exit_code == 0
    assert load("mine.toml").acoustics.range_std_m == 0.05


def test_a_kind_of_system_is_read_in_any_case() -> None:
    assert new("mine", "--like", "Water Linked").exit_code == 0
    assert load("mine.toml").title == "Four receivers off a boat"


@pytest.mark.parametrize("like", [name for name, it in LIKES.items() if load(it.source).title])
def test_a_title_that_tells_another_number_of_beacons_is_left_out(like: str) -> None:
    title = load(LIKES[like].source).title
    for count in (4, 6):
        points = "; ".join(f"{3 * (k % 2)} {2 * k} 1" for k in range(count))
        assert new("mine", "--force", "--like", like, "--beacons", points).exit_code == 0
        assert load("mine.toml").title == (title if count == 4 else "")


def test_all_keys_are_written_on_request() -> None:
    assert new("few", "--gps", "rtk").exit_code == 0
    assert new("all", "--gps", "rtk", "--all").exit_code == 0
    few, every = Path("few.toml").read_text(), Path("all.toml").read_text()
    assert len(every.splitlines()) > 5 * len(few.splitlines())
    assert "# side_m = 15.0\n" in every
    assert "side_m" not in few
    assert content(load("few.toml")) == content(load("all.toml"))


@pytest.mark.parametrize("given", [b"", b"\n", b"rtk\n" * 30, None])
def test_a_pipe_is_asked_nothing(given: bytes | None) -> None:
    """Nor is an input that is closed."""
    more: dict[str, Any] = {"input": given}
    if given is None:
        more = {"preexec_fn": lambda: os.close(0)}
    done = subprocess.run(
        [*ON_A_TERMINAL, "mine.toml"], capture_output=True, timeout=600, check=False, **more
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert content(load("mine.toml")) == content(load(LIKES[USUAL].source))


def test_what_cannot_be_written_leaves_nothing_and_is_named() -> None:
    Path("place", FILE_NAME).mkdir(parents=True)
    done = new("place/mine.toml")
    assert done.stderr.startswith(f"error: place/{FILE_NAME}: must be writable, got ")
    assert [path.name for path in Path("place").iterdir()] == [FILE_NAME]
    Path("folder.toml").mkdir()
    for force in ((), ("--force",)):
        done = new("folder.toml", *force)
        assert done.stderr == "error: folder.toml: must be a file, got a folder\n"
    assert not Path(FILE_NAME).exists()
    assert not Path(FILE_NAME).exists()
    Path("link.toml").symlink_to("nowhere.toml")
    assert new("link.toml").stderr.startswith("error: link.toml: must not exist yet, got ")
    assert not Path(FILE_NAME).exists()
    assert new("x" * 300).stderr.startswith("error: ")
    assert not Path(FILE_NAME).exists()


# --- On a terminal -------------------------------------------------------------------------------

PROMPT = r"(\w+) \[[^\n]*\]: $"


class Terminal:
    """The command on a real terminal, and all that it shows."""

    def __init__(self, *arguments: str, command: Sequence[str] = ON_A_TERMINAL) -> None:
        pexpect = pytest.importorskip("pexpect")
        self.end, self.shown = pexpect.EOF, ""
        self.child = pexpect.spawn(
            command[0], [*command[1:], *arguments], encoding="utf-8", codec_errors="replace",
            timeout=600, dimensions=(40, 100),
        )  # fmt: skip

    def question(self) -> str:
        """The name of the next question; empty at the end."""
        at = self.child.expect([PROMPT, self.end])
        self.shown += self.child.before + (self.child.after if at == 0 else "")
        return str(self.child.match[1]) if at == 0 else ""

    def said(self) -> str:
        """All that it showed, without the ends of lines."""
        return " ".join(self.shown.split())

    def end_code(self) -> int:
        self.child.close()
        return int(self.child.exitstatus)


def test_enter_keeps_everything_and_asks_for_all() -> None:
    terminal = Terminal("mine.toml")
    asked = []
    while name := terminal.question():
        asked.append(name)
        terminal.child.sendline(" " * len(asked))
    assert asked == ["like", *ASKED]
    assert terminal.end_code() == 0
    assert content(load("mine.toml")) == content(load(LIKES[USUAL].source))
    for name, it in LIKES.items():
        assert name in terminal.said()
        assert " ".join(it.about.split()) in terminal.said()
    for it in ASKED.values():
        assert it.about in terminal.said()
    for default in ("4 arms of 3 m", "0 m", "standalone", "2°", "Beaufort 2", "0.1 s", "semicircle",
                    "5 m", "0.5 m/s"):  # fmt: skip
        assert f"[{default}]: " in terminal.shown


CARELESS = {
    "like": ("watr-linked", "did you mean 'water-linked'?"),
    "beacons": ("[[0, 0, 9], [50, 0, 9]]", "beacons: must be an array of 3 to 8 rows"),
    "mounting": ("0,05", "mounting: must have a point before decimals"),
    "gps": ("rtkk", "got 'rtkk'; did you mean 'rtk'?"),
    "compass": ("two degrees", "compass: must be a number in °, got 'two degrees'"),
    "sea": ("9", "sea: must be at most 6, got 9"),
    "pings": ("0 Hz", "pings: must be more than 0, got '0 Hz'"),
    "noise": ("quiet", "noise: must be a number in m, got 'quiet'"),
    "path": ("crcle", "did you mean 'circle'?"),
    "depth": ("5-10", "depth: must be one depth or two in m, got '5-10'"),
    "speed": ("30 knots", "speed: must be a number in m/s, got '30 knots'"),
}
"""Answers that nobody should give, and what is said."""


def test_what_is_wrong_is_said_and_asked_again() -> None:
    terminal = Terminal("mine.toml")
    for name, (wrong, _) in CARELESS.items():
        assert terminal.question() == name
        terminal.child.sendline(wrong)
        assert terminal.question() == name
        terminal.child.sendline({"like": "WATER-LINKED", **ANSWERS}[name])
    assert terminal.question() == ""
    for _, words in CARELESS.values():
        assert words in terminal.said()
    assert "override" not in terminal.shown
    assert "Traceback" not in terminal.shown
    begin = load(LIKES["water-linked"].source)
    assert content(load("mine.toml")) == content(decided(begin, ANSWERS).scenario)


def test_what_is_given_is_not_asked_and_binds_the_answers() -> None:
    Path("dive.csv").write_text("time_s,north_m,east_m,down_m\n0,10,0,5\n20,10,8,6\n")
    terminal = Terminal("mine.toml", "--like", "lbl", "--depth", "7", "--pings", "2")
    asked = []
    while name := terminal.question():
        asked.append(name)
        terminal.child.sendline("dive.csv" if asked[-2:] == ["noise", "path"] else "")
    assert asked == ["beacons", "mounting", "noise", "path", "path", "speed"]
    assert "depth: must be left out, as trajectory is \"file\", got '7'" in terminal.said()
    assert load("mine.toml").target.waypoint_m[2::3] == (7.0,) * 8


@pytest.mark.parametrize("key", ["c", "d"])
@pytest.mark.parametrize("after", [0, 3])
def test_an_interruption_writes_nothing(key: str, after: int) -> None:
    terminal = Terminal("mine.toml")
    for _ in range(after):
        terminal.question()
        terminal.child.sendline("")
    terminal.question()
    terminal.child.sendcontrol(key)
    assert terminal.question() == ""
    assert terminal.said().endswith("interrupted; nothing was written")
    assert terminal.end_code() == 130
    assert not [*Path().iterdir()]


def test_an_existing_file_is_refused_before_anything_is_asked() -> None:
    Path("mine.toml").write_text("precious")
    terminal = Terminal("mine.toml")
    assert terminal.question() == ""
    assert "must not exist yet, got an existing file; --force replaces it" in terminal.said()
    assert Path("mine.toml").read_text() == "precious"


def test_random_keys_end_in_a_scenario_or_in_words() -> None:
    """Also bytes that are no text, and control characters that terminals leave alone."""
    rng = random.Random(20)
    letters = [*b"0123456789.,;-+ []()'\"abcxyzm/\xff\xc3\xb0\\{}=#%", 0xE2, 0x88, 0x92]
    for shell in ('"$@"', '"$@" | cat'):  # with and without the editing of lines
        strict = ["env", "PYTHONIOENCODING=utf-8:strict"]
        command = ["bash", "-o", "pipefail", "-c", shell, "sh", *strict, *ON_A_TERMINAL]
        terminal = Terminal("mine.toml", "--force", "--like", "platform", command=command)
        while terminal.question():
            if rng.random() < 0.7:
                text = bytes(rng.choice(letters) for _ in range(rng.randrange(1, 30)))
                os.write(terminal.child.child_fd, text)
            terminal.child.sendline("")
        assert "Traceback" not in terminal.shown
        assert "must not happen" not in terminal.shown
        assert terminal.end_code() == 0, terminal.shown
        load("mine.toml")


def test_the_track_of_a_path_warns_once() -> None:
    Path("dry.csv").write_text("time_s,north_m,east_m,down_m\n0,10,0,5\n20,10,8,-60\n")
    done = new("mine", "--path", "dry.csv", "--pings", "2")
    assert done.stderr.count("should be under water") == 1
    assert "times)" not in done.stderr
    terminal = Terminal("mine", "--force", "--like", "lbl", "--path", "dry.csv")
    while name := terminal.question():
        assert terminal.said().count("should be under water") == 1, name
        terminal.child.sendline(ANSWERS[name])
    assert terminal.said().count("should be under water") == 1
    assert "times)" not in terminal.said()

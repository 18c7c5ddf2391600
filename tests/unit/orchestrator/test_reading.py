"""Texts in TOML that are too long, too deep or too large: one short line each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from sblcosim.analysis.advice.of_study import advice_on_study
from sblcosim.cli import app
from sblcosim.errors import ConfigurationError
from sblcosim.scenario.reading import DEEPEST, LARGEST, check_values, parse
from sblcosim.scenario.scenario import load
from sblcosim.scenario.wiring import connect
from sblcosim.study import study
from typer.testing import CliRunner

LONG = "a" * 5000
KEY = ".".join(["a"] * 3000)
DIGITS = "9" * 5000
TEXTS = {
    "deep arrays": ("x = " + "[" * 5000 + "]" * 5000, "at most 16 levels, got far more"),
    "deep tables": ("x = " + "{a=" * 5000 + "1" + "}" * 5000, "at most 16 levels, got far more"),
    "long key": (f"[platform]\n{KEY} = 1", "at most 16 levels, got more"),
    "long table": (f"[{KEY}]\nx = 1", "at most 16 levels, got more"),
    "digits": (f"seed = {DIGITS}", "integers of 64 bits, got one of thousands of digits"),
    "hexadecimal": (f"seed = 0x{'f' * 5000}", "must have integers of 64 bits, got an integer"),
    "65 bits": (f"seed = {2**63}", f"seed: must have integers of 64 bits, got {2**63}"),
    "inside": (f"[a]\nb = [1, {-(2**63) - 1}]", "a.b.2: must have integers of 64 bits"),
    "no value": (f"{LONG} =", "must be a value of TOML"),
    "long value": (f"a = x{LONG}", "must be a value of TOML"),
    "twice": (f"{LONG} = 1\n{LONG} = 2", "Cannot overwrite"),
}


def line_of(call: Callable[[], object]) -> str:
    with pytest.raises(ConfigurationError) as caught:
        call()
    line = str(caught.value)
    assert len(line) < 600, line
    assert "\n" not in line
    return line


@pytest.fixture(scope="module")
def costs(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Path], object]:
    """Reads a file of costs, for advice on the results of a small study."""
    out = tmp_path_factory.mktemp("costs") / "out"
    fixed = {"time.duration_s": 2.0}
    tables = {"scenario": "paper-scenario-1", "fixed": fixed, "factors": {"a": ARM}}
    study.load({**tables, "replicates": 2}).run(out)
    return lambda file: advice_on_study(out, costs=file)


@pytest.mark.parametrize("name", TEXTS)
def test_a_text_that_is_too_much_is_refused_in_one_short_line(
    name: str, tmp_path: Path, costs: Callable[[Path], object]
) -> None:
    text, message = TEXTS[name]
    for kind, read in (("scenario", load), ("study", study.load), ("costs", costs)):
        file = tmp_path / f"{kind}.toml"
        file.write_text(text)
        line = line_of(lambda: read(file))  # noqa: B023
        assert line.startswith(str(file))
        assert message in line


def test_the_largest_integers_and_the_deepest_tables_are_read() -> None:
    assert parse("x", f"a = [{2**63 - 1}, {-(2**63)}]") == {"a": [2**63 - 1, -(2**63)]}
    parse("x", ".".join(["a"] * DEEPEST) + " = 1")
    line_of(lambda: parse("x", ".".join(["a"] * (DEEPEST + 1)) + " = 1"))
    line_of(lambda: check_values("x", 1, DEEPEST + 1))


OVERRIDES: list[Any] = [
    [f"{KEY}=1"],
    [f"receiver.parameters.{KEY}=1"],
    {KEY: 1},
    [f"seed={DIGITS}"],
    [f"seed=0x{'f' * 5000}"],
    {"time.duration_s": 10**5000},
    [f"platform.arm_length_m={'[' * 5000}{']' * 5000}"],
    [f"platform.arm_length_m={'@' * 5000}"],
    [f"platform.{LONG}=1"],
    [f"{LONG}.x=1"],
    [LONG],
    [f"target.trajectory={LONG}"],
    [f"platform.mean_position_m=[{'9, ' * 5000}1]"],
    [f"name={LONG}"],
    ['name="a\\u0000b"'],
    [f"time.duration_s={LONG}"],
    {f"seed.{LONG}": 1},
    {"receiver": {"type": "ekf", "fmu": LONG}},
]


@pytest.mark.parametrize("overrides", OVERRIDES, ids=range(len(OVERRIDES)))
def test_an_override_that_is_too_much_is_refused_in_one_short_line(overrides: Any) -> None:
    line = line_of(lambda: load("paper-scenario-1", overrides))
    assert line.startswith("override")


ARM = {"keys": ["platform.arm_length_m"], "levels": [1, 2]}
STUDIES: list[dict[str, Any]] = [
    {"name": LONG, "factors": {"a": ARM}},
    {"scenario": LONG, "factors": {"a": ARM}},
    {"fixed": {KEY: 1}, "factors": {"a": ARM}},
    {"factors": {LONG: ARM}},
    {"factors": {"a": {**ARM, LONG: 1}}},
    {"factors": {"a": {**ARM, "keys": [LONG]}}},
    {"factors": {"a": {**ARM, "label": f"{LONG} × b"}}},
    {"factors": {"a": {**ARM, "levels": [1, 10**400]}}},
    {"factors": {"a": {**ARM, "levels": [1, LONG]}}},
    {"factors": {"a": ARM}, "design": {"kind": LONG}},
    {"factors": {"a": ARM}, "design": {"kind": "fraction", "generators": [LONG]}},
    {"factors": {"a": ARM}, "settling_time_s": 10**400},
    {"factors": {"a": ARM}, LONG: 1},
]


@pytest.mark.parametrize("tables", STUDIES, ids=range(len(STUDIES)))
def test_a_study_that_is_too_much_is_refused_in_one_short_line(tables: dict[str, Any]) -> None:
    line_of(lambda: study.load({"scenario": "paper-scenario-1", **tables}))


@pytest.mark.parametrize("receiver", [LONG, f"{LONG}.fmu"])
def test_a_receiver_that_is_no_file_is_refused_in_one_short_line(receiver: str) -> None:
    line_of(lambda: connect(load("paper-scenario-1"), receiver))


@pytest.mark.parametrize(
    ("text", "line", "key"),
    [
        ("[platform]\nbeaufort = 2\n\n# again = 1\nbeaufort = 3\n", 5, "beaufort"),
        ("seed = 1\nseed = 2\n", 2, "seed"),
        ("platform.a = [\n1,\n]\nplatform.a = [\n1,\n2,\n]\n", 7, "platform.a"),
    ],
)
def test_a_key_that_is_given_twice_is_named(
    text: str, line: int, key: str, tmp_path: Path
) -> None:
    file = tmp_path / "a.toml"
    file.write_text(text)
    with pytest.raises(ConfigurationError) as caught:
        load(file)
    assert str(caught.value) == f"{file}, line {line}: {key} must be given once, got it twice"


@pytest.mark.parametrize(("options", "key"), [
    (["--set", "acoustics.range_std_m=0.2", "--set", "acoustics.range_std_m=0.9"],
     "--set acoustics.range_std_m: must be given once, got '0.2' and '0.9'"),
    (["--set", "seed=3", "--seed", "4"], "seed: must be given once, got '3' and '4'"),
])  # fmt: skip
def test_a_key_that_is_set_twice_is_refused(
    options: list[str], key: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["run", "harbour-square", *options])
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert key in result.stderr
    assert not [*tmp_path.iterdir()]
    same = load("harbour-square", ["time.duration_s=5", "time.duration_s=5"])
    assert same.time.duration_s == 5


def test_the_nearest_file_of_a_folder_is_named(tmp_path: Path) -> None:
    (tmp_path / "quay.toml").write_text(load("harbour-square").dump_toml(), "utf-8")
    (tmp_path / "quay.csv").write_text("")
    assert line_of(lambda: load(tmp_path / "quya.toml")) == (
        f"{tmp_path / 'quya.toml'}: no such file; did you mean 'quay.toml'?"
    )
    assert "did you mean" not in line_of(lambda: load(tmp_path / "nowhere" / "quay.toml"))
    assert "did you mean" not in line_of(lambda: load(tmp_path / "pier.toml"))


def test_the_command_line_says_it_without_a_traceback(tmp_path: Path) -> None:
    (tmp_path / "deep.toml").write_text(TEXTS["deep arrays"][0])
    for arguments in (
        ["run", str(tmp_path / "deep.toml")], ["run", LONG], ["study", LONG],
        ["run", "paper-scenario-1", "--set", f"{KEY}=1"],
    ):
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 2
        assert isinstance(result.exception, SystemExit)
        assert result.stderr.startswith("error: ")
        assert result.stderr.count("\n") == 1


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="needs a file without end")
def test_a_file_without_end_is_not_read(costs: Callable[[Path], object]) -> None:
    for read in (load, study.load, costs):
        assert line_of(lambda: read(Path("/dev/zero"))) == (  # noqa: B023
            "/dev/zero: must be a file that can be read, got a device"
        )


def test_a_large_file_is_not_read_to_its_end(
    tmp_path: Path, costs: Callable[[Path], object]
) -> None:
    large = tmp_path / "large.toml"
    with large.open("wb") as file:
        file.truncate(1 << 40)  # of holes
    for read in (load, study.load, costs):
        assert line_of(lambda: read(large)) == (  # noqa: B023
            f"{large}: must have at most {LARGEST:,} bytes, got more"
        )


def test_line_ends_of_any_system_are_read(tmp_path: Path) -> None:
    text = "[target]\nspeed_m_s = 0.25\n[time]\nduration_s = 3.0\n"
    for end in ("\n", "\r\n", "\r"):
        (tmp_path / "s.toml").write_bytes(text.replace("\n", end).encode())
        assert load(tmp_path / "s.toml").target.speed_m_s == 0.25

"""Receivers of users: the adapter, files, identity and messages."""

from __future__ import annotations

import re
from dataclasses import fields
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import sblcosim
from quick import one_in
from sblcosim.cli import app
from sblcosim.errors import ConfigurationError
from sblcosim.models.ports import DEPTH, PING_POSE, RECEPTION, REQUIRED_ESTIMATE
from sblcosim.models.receiver import variables
from sblcosim.models.receiver.receiver import ReceiverDeclaration
from sblcosim.scenario.sources import known_source
from sblcosim.simulation.code import user_code
from sblcosim.study import study
from typer.testing import CliRunner

SHORT = {"time.duration_s": 3.0}
FILE = """
import numpy as np
import sblcosim


class Mine(sblcosim.Receiver):
    parameters = {{"shift": {shift}, "wanted": True, "place": (1.0, 2.0, 3.0)}}

    def update(self, samples):
        {body}
        return sblcosim.Estimate(samples[-1].epoch, np.array(self.place) + self.shift)
"""


def written(folder: Path, body: str = "pass", shift: float = 0.5, name: str = "mine.py") -> Path:
    file = folder / name
    file.write_text(FILE.format(body=body, shift=shift))
    return file


class Noting(sblcosim.Receiver):
    """Keeps the samples of all calls."""

    parameters: ClassVar = {"prior_position": (0.0, 0.0, 0.0), "number": 3, "drawn": 0.0}
    outputs: ClassVar = ("velocity", "covariance")
    made: ClassVar[list[Noting]] = []

    def start(self) -> None:
        self.calls: list[list[Any]] = []
        self.made.append(self)

    def update(self, samples: Any) -> sblcosim.Estimate:
        self.calls.append(list(samples))
        return sblcosim.Estimate(
            samples[-1].epoch, (1.0, 2.0, 3.0), velocity=np.ones(3), covariance=4 * np.eye(3)
        )


def noted(
    scenario: str = "harbour-square", **overrides: Any
) -> tuple[Noting, sblcosim.Result]:
    Noting.made.clear()
    result = sblcosim.run(scenario, Noting, {**SHORT, **overrides})
    return Noting.made[-1], result


def test_each_sample_comes_once_and_in_order() -> None:
    seen, result = noted(**{"receiver.interval_s": 0.05})
    values = result.record.values
    samples = [s for call in seen.calls for s in call]
    ranges = [s for s in samples if isinstance(s, sblcosim.Range)]
    depths = [s for s in samples if isinstance(s, sblcosim.Depth)]
    last = len(result.record) - 1
    assert len(ranges) + len(depths) == len(samples)
    # What came with the last instant is seen by nobody.
    counts = values["acoustics.reception_count"]
    assert len(ranges) in range(counts[last - 2].sum(), counts[last].sum() + 1)
    assert len({(s.beacon, s.epoch) for s in ranges}) == len(ranges) > 10
    assert len({s.epoch for s in depths}) == len(depths) > 25
    for call in seen.calls:
        keys = [(s.epoch, isinstance(s, sblcosim.Range), getattr(s, "beacon", 0)) for s in call]
        assert keys == sorted(keys)
    newest = [s for s in ranges if s.epoch == values["acoustics.range_epoch"][20, s.beacon]]
    assert newest
    for s in newest:
        assert s.range == values["acoustics.range"][20, s.beacon]
        expected = values["acoustics.ping_beacon_position"][20, s.beacon]
        assert np.array_equal(s.beacon_position, expected)


def test_the_depth_at_the_start_is_no_sample() -> None:
    seen, start_ns, tick_ns = Noting(), 100_050_000_000, 100_000_000  # between its own times
    seen.initialise(start_ns, {"update_interval": np.array(0.1)})
    none = np.zeros(seen.beacons, dtype=np.int32)
    for k, epoch in enumerate([100.05, 100.05, 100.15]):
        inputs = {"depth_epoch": np.array(epoch), "depth": np.array(4.0 + k)}
        seen.do_step(start_ns + k * tick_ns, tick_ns, {**inputs, "reception_count": none})
    assert seen.calls == [[sblcosim.Depth(100.15, 6.0)]]


def test_parameters_of_the_scenario_are_attributes() -> None:
    seen, _ = noted(**{
        "seed": 7, "receiver.range_std_m": 0.3, "receiver.parameters": {"number": 5},
    }, scenario="paper-scenario-1")  # fmt: skip
    assert (seen.seed, seen.range_std, seen.depth_std, seen.number) == (7, 0.3, 0.01, 5)
    assert seen.update_interval == 0.1
    assert isinstance(seen.prior_position, np.ndarray)
    assert seen.prior_position[2] == 5.0  # handed over: the true start
    assert noted(**{"receiver.parameters": {"seed": 3}})[0].seed == 3


def test_an_estimate_fills_the_ports() -> None:
    _, result = noted()
    values = result.record.values
    valid = values["Noting.valid"]
    assert not valid[0]
    assert valid[-1]
    assert (values["Noting.velocity"][valid] == 1.0).all()
    assert (values["Noting.position_std"][valid] == 2.0).all()
    whole = np.zeros((6, 6))
    whole[[0, 2, 4], [0, 2, 4]] = 4.0
    assert np.array_equal(values["Noting.covariance"][-1], whole)
    assert values["Noting.update_count"][-1] == len(result.tracks["Noting"])
    names = {v.name for v in Noting().variables if v.causality == "input"}
    assert names < {v.name for v in (*RECEPTION, *PING_POSE, *DEPTH)}
    bare = {v.name for v in sblcosim.Receiver().variables if v.causality == "output"}
    assert bare == {"valid", *REQUIRED_ESTIMATE}


class Beside(sblcosim.Receiver):
    """Takes the diver to be below the platform, as the packet has it."""

    outputs: ClassVar = ("relative_position", "platform_position")

    def update(self, samples: Any) -> sblcosim.Estimate | None:
        heard = [s for s in samples if isinstance(s, sblcosim.Range)]
        if not heard:
            return None
        place = heard[-1].platform_position
        return sblcosim.Estimate(
            heard[-1].epoch, place, relative_position=np.zeros(3), platform_position=place
        )


def test_the_pose_of_a_packet_and_what_is_said_of_the_system() -> None:
    result = sblcosim.run("harbour-square", Beside, SHORT)
    values, judged = result.record.values, result.tracks["Beside"]
    said = values["platform.reported_position"]
    row = np.searchsorted(result.record.time_ns, round(judged.epoch_s.iloc[-1] * 1e9))
    assert np.array_equal(values["Beside.platform_position"][-1], said[row])
    assert "own_relative" in result.errors.index.get_level_values("frame")
    offset = values["target.position"] - values["platform.position"]
    assert judged.own_relative_error_x_m.iloc[-1] == -offset[row, 0]


def test_a_fix_needs_three_ranges_and_a_depth() -> None:
    class Fixed(sblcosim.Receiver):
        def update(self, samples: Any) -> sblcosim.Estimate | None:
            position = self.fix(samples)
            return None if position is None else sblcosim.Estimate(samples[-1].epoch, position)

    calm = {
        "time": {"duration_s": 5.0}, "acoustics": {"range_std_m": 0.0},
        "target": {"depth_std_m": 0.0}, "receiver": {"range_std_m": 0.1},
    }  # fmt: skip
    result = sblcosim.run(calm, Fixed, {"platform.gps_horizontal_std_m": 0.0})
    assert result.errors.loc["Fixed", "relative", "total"].rms_m < 0.5


def test_a_fix_is_nearest_to_the_newest_ranges_and_the_depth() -> None:
    """All differences count alike: their sum of squares has no slope at the fix."""
    rng = np.random.default_rng(4)
    beacons = rng.uniform(-30.0, 30.0, (5, 3)) * [1.0, 1.0, 0.1]
    lengths = np.linalg.norm(beacons - [6.0, -9.0, 20.0], axis=1) + rng.normal(0.0, 1.0, 5)

    def heard(i: int, extra: float = 0.0) -> sblcosim.Range:
        return sblcosim.Range(
            epoch=0.1 * i, arrival_epoch=0.1 * i, beacon=i, range=lengths[i] + extra,
            beacon_position=beacons[i], platform_position=np.zeros(3),
            platform_attitude=np.zeros(3),
        )

    seen = Noting()
    seen.initialise(0, {"update_interval": np.array(0.1)})
    assert seen.fix([heard(0, 9.0), heard(1), heard(2), heard(3, -7.0)]) is None
    few = Noting()
    few.initialise(0, {"update_interval": np.array(0.1)})
    assert few.fix([sblcosim.Depth(0.0, 21.5), heard(0), heard(1)]) is None
    assert few.fix([heard(1)]) is None
    assert few.fix([heard(2)]) is not None
    found = seen.fix([heard(3), sblcosim.Depth(0.0, 21.5), heard(0), heard(4)])
    assert found is not None
    away = np.linalg.norm(found - beacons, axis=1)
    slope = ((away - lengths) / away) @ (found - beacons)
    slope[2] += found[2] - 21.5
    assert np.abs(away - lengths).max() > 0.3
    np.testing.assert_allclose(slope, 0.0, atol=1e-5)


@pytest.mark.parametrize("form", ["mine.py:Mine", "mine.py"])
def test_a_file_is_a_receiver_on_the_command_line(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written(tmp_path)
    monkeypatch.chdir(tmp_path)
    options = ["--set", "time.duration_s=2.0", "--set", "receiver.parameters.shift=0.25"]
    shown = cli("run", "harbour-square", "--receiver", form, "--receiver", "ekf", *options,
                "--no-figures", "--out", "out")  # fmt: skip
    assert shown.exit_code == 0, shown.output
    assert "Mine" in shown.output
    text = (tmp_path / "out" / "scenario.toml").read_text()
    assert 'fmu = "../mine.py:Mine"' in text
    again = sblcosim.run(tmp_path / "out" / "scenario.toml")
    first = sblcosim.run("harbour-square", "mine.py", options[1::2])
    for name, values in again.record.values.items():
        if not name.startswith("raw."):
            assert values.tobytes() == first.record.values[name].tobytes(), name
    assert again.record.values["Mine.position"][-1].tolist() == [1.25, 2.25, 3.25]


def cli(*arguments: str) -> Any:
    return CliRunner().invoke(app, arguments, catch_exceptions=False)


def test_a_scenario_names_a_file_beside_it(tmp_path: Path) -> None:
    written(tmp_path)
    (tmp_path / "here.toml").write_text(
        '[time]\nduration_s = 2.0\n[receiver]\nfmu = "mine.py"\nparameters = { shift = 2.0 }\n'
    )
    result = sblcosim.run(tmp_path / "here.toml")
    assert result.record.values["Mine.position"][-1].tolist() == [3.0, 4.0, 5.0]


CASES: list[tuple[str, str]] = [
    ("none.py", "got no Python file 'none.py'"),
    ("none.py:Mine", "got no Python file 'none.py'"),
    ("mine.py:Mien", "must name a class of 'mine.py', got 'Mien'; did you mean 'Mine'?"),
    ("mine.py:np", "must name a class of 'mine.py', got 'np'"),
    ("two.py", "if the file does not have a single class with variables, initialise, do_step, got "
               "two.py:A, two.py:B"),
    ("empty.py", "initialise, do_step, got none"),
    ("broken.py", "must be importable, got ZeroDivisionError: division by zero (broken.py, line 2"),
    ("syntax.py", "must be importable, got SyntaxError: "),
    ("plain.py:Plain", "must make a component, got plain.py:Plain, whose object has no variables"),
    ("bare.py", "must be a subclass of sblcosim.Receiver, got class Bare of 'bare.py'; write "
                "'class Bare(sblcosim.Receiver):'"),
    ("bare.py:Bare", "'bare.py:Bare' must be a subclass of sblcosim.Receiver, got class Bare of "),
    ("raw", "got 'raw'; 'raw' is shown beside every receiver; as a receiver choose "
            "'multilateration'"),
    ("init.py", "must make the component, got ValueError: no (init.py:Init in init.py, line 4)"),
    ("outputs.py", "Odd: outputs must be some of velocity, "),
    ("names.py", "Odd: parameters must have names of their own, got 'update'"),
    ("values.py", "Odd: parameters must be numbers or arrays of numbers, got 'x' as word"),
]  # fmt: skip
HEAD = "import sblcosim\nclass {}(sblcosim.Receiver):\n"


@pytest.mark.parametrize(("text", "message"), CASES)
@one_in(2)
def test_what_is_no_receiver_is_refused_in_one_line(
    text: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written(tmp_path)
    for name, content in {
        "two": HEAD.format("A") + "    pass\n" + HEAD.format("B") + "    pass\n",
        "empty": "import sblcosim\nfrom sblcosim import Receiver\n",
        "broken": "x = 1\n1 / 0\n",
        "syntax": "def\n",
        "bare": "class Bare:\n    def update(self, samples):\n        return None\n",
        "plain": "class Plain:\n    pass\n",
        "init": HEAD.format("Init") + "    def __init__(self):\n        raise ValueError('no')\n",
        "outputs": HEAD.format("Odd") + "    outputs = ('speed',)\n",
        "names": HEAD.format("Odd") + "    parameters = {'update': 1.0}\n",
        "values": HEAD.format("Odd") + "    parameters = {'word': 'x'}\n",
    }.items():
        (tmp_path / f"{name}.py").write_text(content)
    monkeypatch.chdir(tmp_path)
    shown = cli("run", "harbour-square", "--receiver", text)
    assert shown.exit_code == 2
    assert message in shown.stderr
    assert len(shown.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize("attribute", ["parameters", "outputs", "beacons", "start", "update"])
@pytest.mark.parametrize("value", [
    3, 1.5, "x", None, object(), [3], ("x",), {"x": "y"}, {3: 1.0}, {"x": None}, {"x": 1j},
    {"x": [[1.0], [2.0, 3.0]]}, {"x": np.zeros((2, 2, 2))}, {"x": {}}, [[]],
])  # fmt: skip
def test_an_attribute_of_a_wrong_type_is_named(attribute: str, value: Any) -> None:
    if (attribute, value) == ("beacons", 3):
        return
    with pytest.raises(ConfigurationError, match=rf"Odd: {attribute} must ") as raised:
        sblcosim.run("harbour-square", type("Odd", (Noting,), {attribute: value}), SHORT)
    assert "\n" not in str(raised.value)


FOLDER = """
from sblcosim.models.receiver.receiver import ReceiverDeclaration
from sblcosim.models.receiver.variables import receiver

RECEIVER = ReceiverDeclaration({})
"""


def given(arguments: dict[str, Any]) -> str:
    return ", ".join(f"{name}={value}" for name, value in arguments.items())


@pytest.mark.parametrize(("of", "part"), [
    *(("declaration", it.name) for it in fields(ReceiverDeclaration)),
    *(("receiver", name) for name in signature(variables.receiver).parameters),
])  # fmt: skip
@one_in(3)
def test_a_part_of_a_wrong_type_of_a_folder_is_named(tmp_path: Path, of: str, part: str) -> None:
    inner = {"name": "'Odd'", "number": 90, "description": "'Odd'", "parameters": ()}
    if of == "receiver":
        inner[part] = 3j
    outer: dict[str, Any] = {"component": f"receiver({given(inner)})"}
    if of == "declaration":
        outer[part] = 3j
    text = FOLDER.format(given(outer))
    (tmp_path / "receiver.py").write_text(text)
    shown = cli("run", "harbour-square", "--receiver", f"{tmp_path}/")
    assert shown.exit_code == 2
    (line,) = shown.stderr.splitlines()
    said = rf"'.*': \S+: {part} must be .*, got 3j \(receiver\.py, line \d+\)"
    assert re.search(rf"{said}$", line), line


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("raise KeyError('x')",
         "must not raise an exception, got KeyError: 'x' (Mine in mine.py, line 10)"),
        ("np.linalg.inv(np.zeros((2, 2)))", "(Mine in mine.py, line 10)"),
        ("return 3", "Mine.update: must return an Estimate or None, got 3"),
        ("return sblcosim.Estimate(1.0, (np.nan, 0, 0))",
         "Mine.update: the estimate must have a finite position, got [nan, 0.0, 0.0]"),
        ("return sblcosim.Estimate(1.0, (0.0, 0.0))",
         "the estimate must have a position of 3, got float64 of shape (2,)"),
        ("return sblcosim.Estimate((0.0, 0.0), (0, 0, 0))",
         "the estimate must have an epoch of one number, got float64 of shape (2,)"),
        ("return sblcosim.Estimate(1.0, (0, 0, 0), velocity=(0, 0, 0))",
         "the estimate must have epoch, position, as listed in the class's outputs, got epoch, "
         "position, velocity"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_receiver_is_named_and_spares_the_others(
    body: str, message: str, tmp_path: Path
) -> None:
    file = written(tmp_path, body)
    result = sblcosim.run("harbour-square", ["ekf", str(file)], SHORT)
    assert message in result.failures["Mine"]
    assert result.failures["Mine"].startswith("Mine at 0.")
    assert "\n" not in result.failures["Mine"]
    assert result.receivers == ("ekf", "raw")
    runs = study.load({
        "scenario": "harbour-square", "fixed": SHORT, "design": {"kind": "single"},
        "receivers": [str(file)],
    }).run(tmp_path / "out")  # fmt: skip
    assert message in runs["error"][0]


def test_parameters_that_no_receiver_has_are_refused(tmp_path: Path) -> None:
    file = str(written(tmp_path))
    with pytest.raises(ConfigurationError, match="got 'shfit'; did you mean 'shift'"):
        sblcosim.run("harbour-square", file, {**SHORT, "receiver.parameters.shfit": 1.0})
    with pytest.raises(ConfigurationError, match="must be parameters of a receiver that is a file"):
        sblcosim.run("harbour-square", "ekf", {**SHORT, "receiver.parameters.shift": 1.0})
    with pytest.raises(ConfigurationError, match="wanted: must be true or false, got 1"):
        sblcosim.run("harbour-square", file, {**SHORT, "receiver.parameters.wanted": 1})


def test_a_run_is_known_by_the_file(tmp_path: Path) -> None:
    tables = {
        "scenario": "harbour-square", "fixed": SHORT, "design": {"kind": "single"},
        "receivers": [str(tmp_path / "mine.py")],
    }  # fmt: skip
    written(tmp_path)
    first = study.load(tables).run(tmp_path / "first")
    again = study.load(tables).run(tmp_path / "again")
    assert again["run_id"].tolist() == first["run_id"].tolist()
    from sblcosim.study.again import replay

    assert replay(tmp_path / "first", first["run_id"][0]).receivers[0] == "Mine"
    written(tmp_path, shift=0.6)
    other = study.load(tables)
    assert other.run(tmp_path / "other")["run_id"].tolist() != first["run_id"].tolist()
    with pytest.raises(ConfigurationError, match=r"with other FMU or code of Mine$"):
        other.run(tmp_path / "first")
    with pytest.raises(ConfigurationError, match="with the original FMUs and files, got others"):
        replay(tmp_path / "first", first["run_id"][0])


def test_a_class_is_known_by_its_source(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    known = user_code.component_of(Shifted)
    assert user_code.component_of(Shifted) == known
    monkeypatch.setitem(globals(), "SHIFT", 2.0)
    assert user_code.component_of(Shifted) != known
    monkeypatch.setattr(Noting, "update", Shifted.update)
    assert user_code.component_of(Noting).sha256 != known.sha256
    tables = {"scenario": "harbour-square", "fixed": SHORT, "design": {"kind": "single"}}
    made = study.load(tables, receivers=[Shifted, "ekf"]).with_replicates(2)
    table = made.run(tmp_path / "out", executor="processes", workers=2)
    assert table["error"].isna().all()
    assert study.study_of(tmp_path / "out").receivers[0].sha256 != known.sha256
    with pytest.raises(ConfigurationError, match="must be names, files, or classes"):
        study.load(tables, receivers=[partial(Shifted)])
    with pytest.raises(ConfigurationError, match="must be an array of names and files"):
        study.load(tables, receivers=[3])  # type: ignore[list-item]


SHIFT = 1.0


class Shifted(sblcosim.Receiver):
    def update(self, samples: Any) -> sblcosim.Estimate:
        return sblcosim.Estimate(samples[-1].epoch, (SHIFT, 0.0, 0.0))


def test_a_file_is_run_once_and_leaves_no_module(tmp_path: Path) -> None:
    import sys

    file = written(tmp_path, name="numpy.py")
    before = dict(sys.modules)
    source = known_source(str(file))
    assert source is known_source(f"{file}:Mine")
    assert sys.modules["numpy"] is before["numpy"]
    assert "numpy.py" not in sys.modules
    assert [p.name for p in tmp_path.iterdir()] == ["numpy.py"]


class Once(sblcosim.Receiver):
    """Forgets to return what it estimates, but for the first time."""

    def update(self, samples):
        if self.fixed is None and (position := self.fix(samples)) is not None:
            self.fixed = position
            return sblcosim.Estimate(samples[-1].epoch, position)
        return None

    fixed = None


def test_progress_goes_on_with_receivers_that_run_after_the_others(tmp_path: Path) -> None:
    """Classes run together, and each file alone; all stages count alike."""
    file = str(written(tmp_path))
    for receivers, stages in (([Shifted, "ekf"], 2), ([Shifted, file, Noting], 3)):
        shares: list[float] = []
        sblcosim.run("harbour-square", receivers, SHORT, progress=shares.append)
        assert shares == sorted(shares)
        assert shares[-1] == 1.0
        for stage in range(1, stages):
            assert min(abs(share - stage / stages) for share in shares) < 1e-12


def test_few_estimates_are_said_before_their_error() -> None:
    result = sblcosim.run("realistic-dive", ["coupled", Once], {"time.duration_s": 60.0})
    lines = str(result).splitlines()
    assert "1 estimate in 59 updates; " in lines[1]
    assert "updates; " not in lines[0]

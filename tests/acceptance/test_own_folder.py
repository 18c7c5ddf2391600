"""Receivers in folders of the user: run as ours are, and errors for people where they are wrong."""

from __future__ import annotations

import inspect
import json
import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
from quick import one_in
from sblcosim.comparison.many.run import run_many
from sblcosim.errors import ConfigurationError
from sblcosim.fmus.build import factory
from sblcosim.fmus.host import watch
from sblcosim.fmus.host.libraries import ours
from sblcosim.fmus.read.archive import opened
from sblcosim.fmus.read.ports import Fmu
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters import lanes
from sblcosim.simulation.masters.python import execute
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.user import building
from sblcosim.study import study
from seams import Seam

PAGE = Path(__file__).parents[2] / "docs" / "howto" / "receiver.md"
(TEXT,) = re.findall(r"^```python damped/receiver.py\n(.*?)^```$", PAGE.read_text("utf-8"),
                     re.DOTALL | re.MULTILINE)
SHORT = {"time.duration_s": 8.0}
ANGLE = '''        parameter("tilt", "An angle", "rad", start=0.0, min=-1.0, max=1.0),
    )),
'''


def folder(parent: Path, *changes: tuple[str, str], name: str = "damped") -> Path:
    """The receiver of the page with some changes."""
    text = TEXT
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    (parent / name).mkdir(exist_ok=True)
    (parent / name / "receiver.py").write_text(text)
    return parent / name


def plan_of(receiver: Path, fmi: int = 2, **overrides: Any) -> Any:
    scenario = sblcosim.load("harbour-square", {**SHORT, **overrides})
    return resolve(connect(scenario, [str(receiver)], fmi=fmi))


def source_of(plan: Any) -> Fmu:
    (found,) = (c.source for c in plan.components if c.name == "damped")
    assert isinstance(found, Fmu)
    return found


def test_it_runs_in_lanes_as_alone_and_is_trusted(tmp_path: Path) -> None:
    plan = plan_of(folder(tmp_path))
    assert all(ours(c.source) for c in plan.components)
    alone = execute(plan)
    seeds = {f"{name}.seed": np.array([1, 2]) for name in ("target", "platform", "acoustics")}
    names = [c.name for c in plan.columns]
    beside = lanes.execute(plan, seeds, record=names)
    for name, values in alone.values.items():
        np.testing.assert_array_equal(beside.values[name][0], values, err_msg=name)
    assert alone.values["damped.update_count"][-1] > 3


@pytest.mark.slow
def test_for_other_beacons_and_the_other_version_it_is_made_anew(tmp_path: Path) -> None:
    made = folder(tmp_path)
    six = source_of(plan_of(made, fmi=3, **{"platform.beacons": 6}))
    assert six.fmi == 3
    assert six.ports["range"].shape == (6,)


def test_its_keys_have_units_and_bounds_and_its_page_is_made(tmp_path: Path) -> None:
    made = folder(tmp_path, ("    )),\n", ANGLE))
    (made / "README.md").write_text("# Damped\n\nIt *damps*.\n")
    given = {"receiver.parameters": {"share": 0.25, "tilt_deg": 30.0}, "receiver.range_std_m": 0.3}
    system = connect(sblcosim.load("harbour-square", {**SHORT, **given}), [str(made)])
    values = system.components["damped"].parameters
    assert values["share"] == 0.25
    assert values["tilt"] == pytest.approx(np.pi / 6)
    assert values["range_std"] == 0.3
    with opened(source_of(resolve(system)).path) as archive:
        page = archive.read("documentation/index.html").decode()
    assert "<em>damps</em>" in page
    assert "Share of a step that is made" in page
    for given, message in (
        ({"share": 2.0}, r"\.share: must be at most 1(\.0)?, got 2"),
        ({"tilt_deg": "x"}, r"\.tilt_deg: must be a number, got"),
        ({"shar": 0.5}, r"got 'shar'; did you mean 'share'\?"),
    ):
        with pytest.raises(ConfigurationError, match=message):
            plan_of(made, **{"receiver.parameters": given})


def test_what_it_imports_is_part_of_it(tmp_path: Path) -> None:
    helper = ("import casadi as ca\n", "import os, sys\nsys.path.insert(0, os.path.dirname("
              "__file__))\nimport casadi as ca\nfrom helper_of_damped import GAIN\n")  # fmt: skip
    made = folder(tmp_path, helper, ("share * (least", "GAIN * share * (least"))
    known = []
    for gain in ("1.0", "0.5", "1.0"):
        (made / "helper_of_damped.py").write_text(f"GAIN = {gain}\n")
        known.append(source_of(plan_of(made)).sha256)
    assert known[0] == known[2] != known[1]


def test_a_saved_run_names_the_folder_and_can_be_repeated(tmp_path: Path) -> None:
    made = folder(tmp_path)
    result = sblcosim.run("harbour-square", str(made), SHORT)
    result.save(tmp_path / "out")
    text = (tmp_path / "out" / "scenario.toml").read_text()
    assert re.search(r'^fmu = ".*damped"$', text, re.MULTILINE)
    again = sblcosim.run(tmp_path / "out" / "scenario.toml")
    assert again.errors.loc["damped"].equals(result.errors.loc["damped"])


def test_it_warns_where_it_is_not_for_the_beacons(tmp_path: Path) -> None:
    unfit = ("    equations=equations,\n", "    equations=equations,\n"
             "    unfit={'platform': 'the boat moves'},\n")  # fmt: skip
    with pytest.warns(Warning, match="damped: is for divers who hardly move; here the boat moves"):
        plan_of(folder(tmp_path, unfit))


@one_in(2)
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ((("def equations()", "def equations("),), "must be importable, got SyntaxError"),
        ((("RECEIVER =", "RECIEVER ="),),
         r"must have RECEIVER, .*, got none; did you mean 'RECIEVER'\?"),
        ((("RECEIVER = ReceiverDeclaration(", "RECEIVER = dict("),
          ("    receiver(", "    a=receiver(")),
         "must have RECEIVER, a ReceiverDeclaration, got"),
        ((('receiver("Damped", 1000', 'receiver("EKF", 1000'),), "a name of its own, got 'EKF'"),
        ((('receiver("Damped", 1000', 'receiver("Damped", 4'),), "a number of its own, got 4"),
        ((('"Damped"', '"So damped"'),), "name must consist of letters, digits and _"),
        ((("    equations=equations,\n", ""),), "must have equations, a function that makes them"),
        ((("return Equations(", "return dict("),), "equations must make Equations, got"),
        ((("p.share", "p.shar"),), "must fit its declaration, got AttributeError.*line"),
        ((('"seen": s.mark,', '"saw": s.mark,'),), "not a state: saw"),
        ((("return estimate.outputs(", "return dict(position=x.position) or ("),),
         "outputs do not match: covariance"),
        ((("min=0.0, max=1.0", "unit='furlong'"),), "unit 'furlong' is not one of"),
        ((("def equations() -> Equations:\n", "def equations() -> Equations:\n    1 / 0\n"),),
         "must make its equations, got ZeroDivisionError: .*receiver.py, line"),
        ((("    def initial(p", "    import os\n    os._exit(3)\n\n    def initial(p"),),
         r"receiver.py ended the process \(exit code 3\) in its equations"),
        ((("x.position + share", "ca.SX.sym('free', 3) + share"),), "must fit its declaration"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_a_line(
    changes: tuple[tuple[str, str], ...], message: str, tmp_path: Path
) -> None:
    made = folder(tmp_path, *changes)
    with pytest.raises(ConfigurationError, match=message) as caught:
        connect(sblcosim.load("harbour-square", SHORT), [str(made)])
    said = str(caught.value)
    assert re.match(r"receiver: '.*/damped'|receiver: the Python file receiver.py ended", said)
    assert "\n" not in said


def test_a_folder_without_the_file_is_said_to_be_one(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "near").mkdir()
    (tmp_path / "near" / "reciever.py").touch()
    near = "got reciever.py; did you mean 'reciever.py'"
    for name, got in (("empty", "got none"), ("near", near)):
        with pytest.raises(ConfigurationError, match=f"must be a folder with receiver.py, {got}"):
            connect(sblcosim.load("harbour-square", SHORT), [str(tmp_path / name)])


@pytest.mark.parametrize("text", ["", "no-such-folder/"])
def test_what_is_no_folder_is_no_receiver(text: str) -> None:
    with pytest.raises(ConfigurationError, match=r"receiver: must be ekf, sequential, .*, got '"):
        connect(sblcosim.load("harbour-square", SHORT), [text])


HANG = (
    "import os, tempfile\n"
    "open(os.path.join(tempfile.gettempdir(), 'hangs'), 'w').close()\n"
    "while True: pass\n"
)
"""It says so first: time counts from then on (`only_hangs_take_time`)."""
def made_log(out: Path) -> Path:
    """The log of a simulated dive."""
    sblcosim.run("harbour-square", "sequential", SHORT).save(out, figures=False, log=True)
    return out / "log"


WITH_A_LIMIT: dict[str, Callable[[str, Path], object]] = {
    "run": lambda made, out: sblcosim.run("harbour-square", made, SHORT, step_timeout=0.5),
    "compare": lambda made, out: sblcosim.compare(
        "harbour-square", ["ekf", made], overrides=SHORT, runs=2, step_timeout=0.5),
    "run_many": lambda made, out: run_many(
        "harbour-square", made, SHORT, runs=2, step_timeout=0.5),
    "process": lambda made, out: sblcosim.process(made_log(out), made, step_timeout=0.5),
    "study": lambda made, out: study.load({
        "scenario": "harbour-square", "fixed": SHORT, "design": {"kind": "single"},
        "receivers": [made],
    }).run(out, step_timeout=0.5),
}  # fmt: skip


@pytest.mark.usefixtures("only_hangs_take_time")
@pytest.mark.parametrize("function", WITH_A_LIMIT)
def test_the_time_limit_holds_for_all_that_a_function_does(function: str, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "receiver.py").write_text(HANG)
    with pytest.raises(ConfigurationError, match=r"not returned from its import for 0\.5 s"):
        WITH_A_LIMIT[function](str(tmp_path / "mine"), tmp_path / "out")


def test_each_public_function_with_a_time_limit_is_tried() -> None:
    limited = {
        name for name in sblcosim.__all__
        if inspect.isfunction(thing := getattr(sblcosim, name))
        and "step_timeout" in inspect.signature(thing).parameters
    }
    assert limited <= WITH_A_LIMIT.keys()


@pytest.mark.slow
def test_what_it_prints_is_no_part_of_the_result(tmp_path: Path) -> None:
    made = folder(tmp_path, (
        "RECEIVER =", "print('{not json')\nimport os; os.write(1, b'raw\\n')\nRECEIVER ="))
    done = subprocess.run(
        [sys.executable, "-m", "sblcosim", "run", "harbour-square", "--json", "--no-figures",
         "--set", "time.duration_s=8", "--receiver", str(made), "--out", str(tmp_path / "out")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert set(json.loads(done.stdout)["errors"]) == {"damped", "raw"}
    assert "{not json\nraw\n" in done.stderr


class _Heard(watch.Watch):
    def __init__(self) -> None:
        self.calls: list[tuple[str, str]] = []
        self.again = threading.Event()

    @contextmanager
    def calling(self, component: str, function: str) -> Iterator[None]:
        if (component, function) in self.calls:
            self.again.set()
        self.calls.append((component, function))
        yield


def test_while_the_compiler_works_the_process_goes_on(tmp_path: Path, seam: Seam) -> None:
    """The parent ends a process that says nothing for a minute; some builds take longer."""
    heard, made = _Heard(), folder(tmp_path)

    def compiled(file: str, of: str, make: Callable[[], Any], fmi: int) -> Path:
        make()
        assert heard.again.wait(600)
        return tmp_path / file

    seam.instead(factory.kept_fmu, compiled)
    seam.instead(watch.watch, lambda: heard)
    path = made / "receiver.py"
    asked, where = ("mine", "", 4, 2), "receiver: 'mine'"
    built, _ = building.receiver(path, path.read_bytes(), "", asked, where)
    assert built[0] == tmp_path / "mine.fmu"
    assert heard.calls[:3] == [
        ("receiver", "its import"), ("receiver", "its declaration"), ("receiver", "its equations")]
    assert {*heard.calls[3:]} == {("receiver", "its compilation")}
    said = len(heard.calls)
    time.sleep(1.2)
    assert len(heard.calls) == said


def test_its_compilation_is_announced_once(tmp_path: Path) -> None:
    code = (
        "from sblcosim.simulation.user.receivers import of_folder\n"
        f"of_folder({str(folder(tmp_path))!r})"
    )
    own = {**os.environ, factory.CACHE_VARIABLE: str(tmp_path / "cache")}
    told = [
        subprocess.run(
            [sys.executable, "-c", code], env=own, capture_output=True, text=True, check=True
        ).stderr
        for _ in range(2)
    ]
    assert len(re.findall(r"^compiling damped: about .*\ncompiled in ", told[0], re.M)) == 1
    assert told[1] == ""

"""What ``import sblcosim`` offers: few names, quickly; and what comes along."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import pytest
import sblcosim
from sblcosim.cli.common.app import app
from sblcosim.errors import ConfigurationError
from sblcosim.models.declaration import Variable
from sblcosim.scenario.scenario import load
from sblcosim.simulation.system import PythonComponent
from typer.testing import CliRunner


def test_the_names_are_few_and_all_there() -> None:
    assert dir(sblcosim) == sorted(sblcosim.__all__)
    assert len(dir(sblcosim)) <= 41
    assert [name for name in dir(sblcosim) if name.startswith("_")] == ["__version__"]
    assert all(getattr(sblcosim, name) is not None for name in sblcosim.__all__)
    for package in (sblcosim.analysis, sblcosim.limits, sblcosim.study, sblcosim.research):
        names = dir(package)
        assert names == sorted(package.__all__)
        assert len(names) <= 15


def test_a_component_in_python_needs_no_other_import() -> None:
    assert sblcosim.Variable is Variable
    assert sblcosim.PythonComponent is PythonComponent


def test_importing_it_loads_nothing_large() -> None:
    code = (
        "import json, sys; before = {*sys.modules}; import sblcosim; dir(sblcosim);"
        "print(json.dumps(sorted({*sys.modules} - before)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = json.loads(done.stdout)
    own = [name for name in loaded if name.startswith("sblcosim")]
    assert own == ["sblcosim", "sblcosim.lazy"]
    assert not {"numpy", "pandas", "matplotlib", "pydantic", "xarray"} & {*loaded}
    code = (
        "import sys, sblcosim; sblcosim.PythonComponent, sblcosim.Variable, sblcosim.Receiver;"
        "assert not {'pandas', 'matplotlib', 'xarray'} & {*sys.modules}"
    )
    subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)


@pytest.mark.parametrize(
    ("name", "listing"),
    [
        ("scenarios", sblcosim.scenarios),
        ("studies", sblcosim.studies),
        ("receivers", sblcosim.receivers),
        ("questions", sblcosim.questions),
    ],
)
def test_what_comes_along_is_what_the_command_lists(name: str, listing: Any) -> None:
    found = listing()
    assert len(found) >= (1 if name == "questions" else 3)
    assert all(found.values())
    printed = CliRunner().invoke(app, [name], catch_exceptions=False).stdout
    assert all(key in printed for key in found)
    assert repr(found).splitlines()[0].startswith(next(iter(found)))


def test_what_comes_along_can_be_used() -> None:
    for name in sblcosim.scenarios():
        assert sblcosim.load(name).title == sblcosim.scenarios()[name]
    for name in sblcosim.studies():
        assert sblcosim.study.load(name).title == sblcosim.studies()[name]
    for name in sblcosim.questions():
        assert sblcosim.require.load(name).study.title == sblcosim.questions()[name]
    short = {"time.duration_s": 2.0}
    assert "ekf" in sblcosim.receivers()
    assert sblcosim.run("harbour-square", [*sblcosim.receivers()], short.items()).receivers


PLATFORM = {"arm_length_m": 0.5}


@pytest.mark.parametrize(
    "overrides",
    [
        {"platform.arm_length_m": 0.5},
        {"platform": PLATFORM},
        {"platform.arm_length_m": 0.5}.items(),
        {"platform": PLATFORM}.items(),
        [("platform.arm_length_m", 0.5)],
        iter([("platform.arm_length_m", 0.5)]),
        ["platform.arm_length_m=0.5"],
        "platform.arm_length_m=0.5",
    ],
)
def test_overrides_are_keys_with_values_or_pairs_or_texts(overrides: Any) -> None:
    assert load("harbour-square", overrides).platform.arm_length_m == 0.5
    assert load("harbour-square").override([("seed", 3)]).seed == 3


def test_pairs_are_checked_as_all_overrides_are() -> None:
    deep: Any = {}
    deep["platform"] = deep
    with pytest.raises(ConfigurationError, match="at most 16 levels"):
        load("harbour-square", deep.items())
    with pytest.raises(ConfigurationError, match="must be at least"):
        load("harbour-square", [("platform.arm_length_m", -1.0)])
    with pytest.raises(ConfigurationError, match="must be a text like"):
        load("harbour-square", [("platform.arm_length_m", 1.0, 2.0)])  # type: ignore[list-item]

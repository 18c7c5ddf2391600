"""Code of the user that changes after its study was loaded: no run of it is stored or served."""

from __future__ import annotations

import builtins
import importlib
import itertools
import pickle
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sblcosim.errors import CodeChangedError, ConfigurationError
from sblcosim.simulation.children import messages
from sblcosim.simulation.children.children import waiting
from sblcosim.simulation.code import user_code
from sblcosim.simulation.user import loading
from sblcosim.study import load
from seams import Seam

SHORT = {
    "name": "its", "scenario": "harbour-square", "fixed": {"time.duration_s": 2.0},
    "design": {"kind": "single"}, "settling_time_s": 0.0, "replicates": 2,
}  # fmt: skip
GRID = {
    "name": "its", "design": {"kind": "grid"}, "factors": {"x": {"levels": [1.0, 2.0]}},
    "replicates": 1,
}  # fmt: skip
SOURCE = """
import sblcosim
{helper}
def response_m(run): return float(X)
def model(x): return X * x
class Mine(sblcosim.Receiver):
    def update(self, samples):
        return sblcosim.Estimate(samples[-1].epoch, (float(X), 2.0, 3.0))
"""
KINDS = ("receiver", "response", "model")
_numbers = itertools.count()


def study_with(kind: str, thing: Any) -> Any:
    """A study with a receiver, response or function."""
    if kind == "model":
        return load({**GRID, "model": thing})
    if kind == "response":
        return load({**SHORT, "receivers": ["ekf"]}, responses=[thing])
    return load(SHORT, receivers=[thing])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder whose modules can be imported."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def written(folder: Path, helper: str) -> tuple[str, str]:
    """Names of a new module and of a helper, which it imports by this line."""
    number = next(_numbers)
    (folder / f"helps{number}.py").write_text("X = 1.0\n")
    text = SOURCE.format(helper=helper.replace("HELPER", f"helps{number}"))
    (folder / f"its{number}.py").write_text(text)
    return f"its{number}", f"helps{number}"


@pytest.mark.parametrize("kind", KINDS)
def test_code_given_in_python_that_changes_after_loading_is_refused(
    folder: Path, kind: str
) -> None:
    name, _ = written(folder, "X = 1.0")
    module = importlib.import_module(name)
    thing = {"receiver": module.Mine, "response": module.response_m, "model": module.model}[kind]
    study = study_with(kind, thing)
    first = study.run(folder / "out")
    assert study.run(folder / "out")["run_id"].tolist() == first["run_id"].tolist()
    module.X = 50.0
    for out in ("out", "other"):
        with pytest.raises(CodeChangedError, match=r"^(receivers|responses|model): \w+ must be as"):
            study.run(folder / out)
    assert not (folder / "other").exists()
    with pytest.raises(CodeChangedError):
        study.with_replicates(3).run(folder / "out")
    again = study_with(kind, thing).run(folder / "other")
    assert not set(again["run_id"]) & set(first["run_id"])
    module.X = 1.0
    assert study.run(folder / "out").equals(first)


@pytest.mark.parametrize(
    ("kind", "how"),
    [
        ("receiver", "from HELPER import X"),
        ("response", "import importlib; X = importlib.import_module('HELPER').X"),
        ("model", "import runpy; X = runpy.run_path('HELPER.py')['X']"),
    ],
)  # fmt: skip
def test_a_process_that_starts_later_runs_the_code_that_was_loaded_or_none(
    folder: Path, kind: str, how: str
) -> None:
    name, helper = written(folder, how)
    part = {"receiver": "Mine", "response": "response_m", "model": "model"}[kind]
    study = study_with(kind, f"{name}.py:{part}")
    first = study.run(folder / "out")
    waiting.close()
    assert study.run(folder / "out").equals(first)
    (folder / f"{helper}.py").write_text("X = 50.0\n")
    waiting.close()
    if kind != "receiver":  # a path, which is loaded when the study is run
        with pytest.raises(CodeChangedError, match=rf"but {helper}.py, which it imports, has"):
            study.run(folder / "other")
        assert not [*folder.glob("other/parts/*")]
        study = study_with(kind, f"{name}.py:{part}")
    again = study.run(folder / "fresh")
    assert not set(again["run_id"]) & set(first["run_id"])


def test_a_study_ends_when_what_its_receiver_imports_changes_under_way(folder: Path) -> None:
    # What it does to NumPy makes each run the last of its process.
    name, helper = written(folder, "import numpy as np\nfrom HELPER import X")
    path = folder / f"{name}.py"
    path.write_text(path.read_text().replace("return sblcosim", "np.seterr(all='raise')\n        "
                                             "return sblcosim"))  # fmt: skip
    study = load({**SHORT, "replicates": 6}, receivers=[f"{path}:Mine"])

    def change(share: float) -> None:
        if share > 0.2:
            (folder / f"{helper}.py").write_text("X = 50.0\n")

    with pytest.raises(CodeChangedError, match=rf"but {helper}.py, which it imports, has changed"):
        study.run(folder / "out", workers=1, progress=change)
    (folder / f"{helper}.py").write_text("X = 1.0\n")
    table = study.run(folder / "out")
    assert table.filter(like="Mine.absolute_total_rms_m").max(axis=None) < 20.0


def test_two_files_that_import_the_same_in_one_process_are_both_known(folder: Path) -> None:
    how = "import importlib; X = importlib.import_module('shared_by_both').X"
    (folder / "shared_by_both.py").write_text("X = 1.0\n")
    names = [written(folder, how)[0] for _ in range(2)]
    study = load(SHORT, receivers=[f"{name}.py:Mine" for name in names])
    waiting.close()
    assert study.run(folder / "out")["error"].isna().all()


@pytest.fixture
def _as_in_a_child() -> Iterator[None]:
    user_code.allow(lambda: None)
    yield
    user_code.allow(None)  # type: ignore[arg-type]


@pytest.mark.usefixtures("_as_in_a_child")
def test_code_sent_by_value_is_refused_where_its_imports_differ(folder: Path, seam: Seam) -> None:
    name, helper = written(folder, "import HELPER\nfrom HELPER import X")
    path = folder / f"{name}.py"
    thing, _ = loading.function(path, path.read_bytes(), "key", "model", "model")
    sent = loading.packed(thing)
    assert sent.load()(2.0) == 2.0
    (folder / f"{helper}.py").write_text("X = 50.0\n")
    seam.forgets(user_code)
    with pytest.raises(CodeChangedError, match=helper):
        sent.load()


def test_runs_are_told_apart_by_all_digits_of_their_levels(folder: Path) -> None:
    (folder / "m.py").write_text("def target(x): return x\n")

    def values(*levels: float) -> list[float]:
        tables = {**GRID, "model": "m.py:target", "factors": {"x": {"levels": [*levels]}}}
        found: list[float] = load(tables).run(folder / "out")["target.value"].tolist()
        return found

    first = values(250000.1, 2.0)
    (folder / "out" / "study.json").unlink()
    with pytest.raises(ConfigurationError, match="may differ from its own beyond six digits"):
        values(250000.4, 2.0)
    assert values(250000.1, 2.0) == first


def test_an_answer_imports_nothing_whatever_it_is_called(folder: Path) -> None:
    types = [name for name, thing in vars(builtins).items() if isinstance(thing, type)]
    assert {"set", "range", "complex", "ValueError"} <= set(types)
    for name in types:
        (folder / "only_theirs.py").write_text(f"class {name}: pass\n")
        module = importlib.import_module("only_theirs")
        content = pickle.dumps(getattr(module, name)())
        del sys.modules["only_theirs"]
        with pytest.raises(ConfigurationError, match="must be plain values"):
            messages.read(content)
        assert "only_theirs" not in sys.modules
        importlib.invalidate_caches()
    assert messages.read(pickle.dumps([range(3), {1}, slice(2)])) == [range(3), {1}, slice(2)]
    assert messages.read(pickle.dumps(np.float64(2.0))) == 2.0

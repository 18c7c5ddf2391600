"""The one form of an answer: all kinds of answers have it, and whoever takes one takes any."""

from __future__ import annotations

import importlib
import inspect
import json
import pkgutil
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from html import escape
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import as_recorded
import log_samples
import made_logs
import pandas as pd
import pytest
import sblcosim
from quick import one_in
from sblcosim import analysis, require
from sblcosim.analysis import workflow
from sblcosim.answer import Answer, Extended
from sblcosim.areas.over_places import OverPlaces
from sblcosim.calibrate import calibrate
from sblcosim.cli.documents.by_command import DOCUMENTS, document
from sblcosim.data.tables import Columns
from sblcosim.errors import ConfigurationError
from sblcosim.estimation.after import smooth
from sblcosim.identification.run import identify
from sblcosim.report.study import analysed
from sblcosim.study import load, table

ROOT = Path(__file__).parents[3]
SHORT = {"time.duration_s": 8.0}
HEARD = {"time.duration_s": 90.0}
GPS = {"keys": ["platform.gps_horizontal_std_m"], "levels": [0.1, 3.0]}
ARM = {"keys": ["platform.arm_length_m"], "levels": [0.4, 3.0]}


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("answers")


def study_of(here: Path, kind: str, **about: Any) -> Path:
    """Runs of a small study in a folder."""
    folder = here / str(about.get("name", kind))
    if not folder.exists():
        design = {"kind": kind, **about.pop("design", {})}
        made = load({
            "name": kind, "design": design,
            **({"scenario": "paper-scenario-1", "fixed": {"time": {"duration_s": 8.0}}}
               if "model" not in about else {}),
            **about,
        })  # fmt: skip
        made.run(folder)
    return folder


def added(x1: float = 1.0, x2: float = 1.0) -> float:
    return x1 + 2 * x2


def full(here: Path) -> Path:
    return study_of(here, "full", replicates=6, factors={"gps": GPS, "arm": ARM})


def grid(here: Path) -> Path:
    return study_of(here, "grid", replicates=6, factors={"gps": GPS, "arm": ARM})


def space(here: Path) -> Path:
    x = {"distribution": "uniform", "range": [0.0, 1.0]}
    return study_of(here, "space", model=added, factors={"x1": x, "x2": x},
                    design={"base_rows": 16})  # fmt: skip


def sweeps(here: Path) -> Path:
    loss = {"keys": ["acoustics.loss_probability"], "levels": [0.0, 0.3]}
    return study_of(here, "sweep", replicates=3, name="sweeps",
                    factors={"loss": loss, "arm": ARM})  # fmt: skip


def sweep(here: Path) -> Path:
    return study_of(here, "sweep", replicates=3, factors={"gps": GPS})


def question(here: Path) -> Any:
    asked = {
        "name": "small", "settling_time_s": 0.0, "scenario": "paper-scenario-1",
        "fixed": {"time": {"duration_s": 8.0}},
        "response": "absolute_total_rms_m", "limit": 50.0, "share": 0.5, "confidence": 0.9,
        "choices": {"gps": {"keys": ["platform.gps_horizontal_std_m"], "levels": [0.1, 3.0],
                            "costs": [100.0, 10.0]}},
        "conditions": {"loss": {"keys": ["acoustics.loss_probability"], "levels": [0.0, 0.2],
                                "combine": "all"}},
    }  # fmt: skip
    return require.decide(asked, here / "question", most_runs=400)


def costs(here: Path) -> Any:
    return analysis.advice_on_study(full(here), {"gps": [100, 10]}, limit=50.0, percentile=50.0)


def logged(here: Path) -> Path:
    folder = here / "dive"
    folder.mkdir(exist_ok=True)
    for name, text in log_samples.own().items():
        (folder / name).write_text(text.replace("true", "false", 1), "utf-8")
    return folder


KINDS: dict[str, Callable[[Path], Any]] = {
    "run": lambda _: sblcosim.run("paper-scenario-1", "coupled", SHORT),
    "smooth": lambda _: smooth(sblcosim.run("paper-scenario-1", "coupled", SHORT)),
    "runs": lambda _: sblcosim.run_many("paper-scenario-1", "coupled", SHORT, runs=3),
    "compare": lambda _: sblcosim.compare(
        "paper-scenario-1", ["ekf", "coupled"], runs=3, overrides=SHORT, timed=False
    ),
    "budget": lambda _: sblcosim.budget(
        sblcosim.load("paper-scenario-1", SHORT), "coupled", runs=30
    ),
    "map": lambda _: sblcosim.map_area(
        "paper-scenario-1", "10x10", 5.0, cells="2", runs=2, duration_s=8.0, settling_s=2.0
    ),
    "distances": lambda _: sblcosim.map_distance(
        "paper-scenario-1", 10, 5.0, cells=2, runs=2, duration_s=8.0, settling_s=2.0
    ),
    "require": question,
    "calibrate": lambda _: calibrate(pings=20),
    "log": lambda here: sblcosim.log(logged(here)),
    "process": lambda _: sblcosim.process(made_logs.made(seconds=60), smooth=True),
    "identify": lambda _: identify(sblcosim.run("harbour-lbl", overrides=HEARD)),
    "advise": costs,
    "analyse full": lambda here: analysed(full(here)),
    "analyse grid": lambda here: analysed(grid(here), practical=0.5),
    "analyse space": lambda here: analysed(space(here)),
    "analyse sweep": lambda here: analysed(sweep(here)),
    "analyse sweeps": lambda here: analysed(sweeps(here)),
    "two levels": lambda here: analysis.of_study(full(here)),
    "two levels, logarithm": lambda here: analysis.of_study(full(here), transform="log",
                                                            practical=1.1),
    "levels": lambda here: workflow.of_grid(load_of(grid(here)), table(grid(here))),
    "levels, logarithm": lambda here: workflow.of_grid(
        load_of(grid(here)), table(grid(here)), transform="log"
    ),
    "indices": lambda here: workflow.of_space(load_of(space(here)), table(space(here)),
                                              "added.value")[0],
}  # fmt: skip
PRINTED = {"run", "smooth", "runs", "compare", "budget", "map", "distances", "require",
           "calibrate", "identify", "log", "process", "advise", "analyse"}  # fmt: skip
PARTS = {"two levels", "levels", "indices"}
"""Those that others show as they are."""


def load_of(folder: Path) -> Any:
    from sblcosim.study import study_of as of_folder

    return of_folder(folder)


@cache
def made(kind: str, here: Path) -> Any:
    return KINDS[kind](here)


def every_class() -> set[type]:
    """All answers of the sources that are not the base of others alone."""
    for info in pkgutil.walk_packages(sblcosim.__path__, "sblcosim."):
        if not info.name.startswith(("sblcosim.fmus", "sblcosim.models", "sblcosim.__main__")):
            importlib.import_module(info.name)
    found, left = set(), [Answer]
    while left:
        own = left.pop().__subclasses__()
        left += own
        found |= {*own} - {Extended, OverPlaces}
    return found


def test_all_kinds_of_answers_are_tried(here: Path) -> None:
    tried = {type(made(kind, here)) for kind in KINDS}
    tried |= {type(a.found) for kind in KINDS if hasattr(a := made(kind, here), "found")}
    names = {kind.__name__ for kind in every_class() if kind.__module__.startswith("sblcosim")}
    assert names - {kind.__name__ for kind in tried} == {"Recording"}  # of a package: no answer
    assert {made(kind, here).document for kind in KINDS} - {""} == PRINTED


@pytest.mark.parametrize("kind", KINDS)
@one_in(4)
def test_an_answer_has_its_one_form(kind: str, here: Path, tmp_path: Path) -> None:
    found = made(kind, here)
    assert isinstance(found, Answer)
    assert found.answer.strip()
    assert found.title.strip()
    assert str(found) == found.text()
    first = re.sub(r"\s+", " ", found.answer.splitlines()[0])
    assert first.rstrip(".") in re.sub(r"\s+", " ", found.text())
    assert all(isinstance(line, str) and line for line in (*found.remarks, *found.problems))
    shown = found._repr_html_()
    assert shown.startswith(f"<h4>{escape(found.title)}</h4>")
    assert escape(first.rstrip(".")) in re.sub(r"\s+", " ", shown)
    folder = found.save(tmp_path / "it")
    files = {path.name for path in folder.iterdir()}
    assert folder == tmp_path / "it"
    assert {f"{name}.csv" for name in found.tables} <= files
    assert {f"{job.name}.svg" for job in found.figures} <= files
    assert (found.report in files) == bool(found.report)
    if found.report:
        page = (folder / found.report).read_text("utf-8")
        as_recorded.check(f"page {kind}", {"page": as_recorded.words_of(page, here)})
    assert json.loads((folder / "manifest.json").read_text("utf-8"))
    assert found.save(tmp_path / "it", figures=False) == folder  # of the same question
    kept = kind in ("run", "smooth")  # an equal run keeps what it has
    assert found.report or bool([*folder.rglob("*.svg")]) == (kept and bool(found.figures))
    bare = found.save(tmp_path / "bare", figures=False)
    assert found.report or not [*bare.rglob("*.svg")]
    json.dumps(found.to_json(), allow_nan=False)
    if found.document:
        told = document(found, folder)
        assert isinstance(told, DOCUMENTS[found.document])
        assert json.loads(told.text())["folder"] == str(folder)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in PARTS])
def test_an_answer_is_as_recorded(kind: str, here: Path) -> None:
    told = as_recorded.told(made(kind, here), here)
    as_recorded.check(kind, told, *[as_recorded.SEARCHED][: kind == "identify"])


@pytest.mark.parametrize("kind", ["require", "analyse full", "analyse grid", "analyse sweep"])
def test_a_page_is_light_whatever_the_theme_of_the_files(
    kind: str, here: Path, tmp_path: Path
) -> None:
    folders = [made(kind, here).save(tmp_path / it, theme=it) for it in ("light", "dark")]
    pages = [(folder / "report.html").read_text("utf-8") for folder in folders]
    light, dark = (re.findall(r"(?:stroke|fill): ?[^;\"]+", page) for page in pages)
    assert Counter(light) == Counter(dark)
    assert "var(--ink)" in pages[1]
    for path in folders[0].glob("*.svg"):
        assert path.read_bytes() != (folders[1] / path.name).read_bytes()


def test_both_answers_of_advice_have_the_labels_of_the_study(here: Path) -> None:
    found = costs(here)
    told = found.to_json()
    assert "RMS total error" in told["answer"]
    assert "RMS total error" in told["beside"]["answer"]
    assert "absolute_total_rms_m" not in told["beside"]["answer"]


def test_a_scenario_is_named_where_it_is_written(here: Path, tmp_path: Path) -> None:
    for chosen in (0, None):
        found = replace(made("require", here), chosen=chosen)
        folder = found.save(tmp_path / str(chosen))
        written = folder / "scenario.toml"
        assert written.is_file() == (chosen is not None)
        assert found.located(folder)["scenario"] == (str(written) if written.is_file() else None)


def test_an_answer_that_says_more_is_otherwise_the_other() -> None:
    other: Any = MagicMock()

    class More(Extended):
        main = other

    more: Any = More()
    for name in ("columns", "title", "answer", "tables", "figures", "remarks", "problems"):
        assert getattr(more, name) is getattr(other, name)
    assert more.text(verbose=True, width=7) is other.text.return_value
    other.text.assert_called_once_with(verbose=True, width=7)
    assert more.to_json() is other.to_json.return_value
    assert more.manifest() is other.manifest.return_value


def test_another_question_is_another_answer(here: Path, tmp_path: Path) -> None:
    folder = full(here)
    asked: list[Any] = [
        analysis.of_study(folder, **options)
        for options in ({}, {"transform": "log"}, {"order": 1}, {"practical": 0.3})
    ]  # fmt: skip
    levels = [
        workflow.of_grid(load_of(grid(here)), table(grid(here)), **options)
        for options in ({}, {"transform": "log"}, {"order": 1}, {"practical": 0.3})
    ]  # fmt: skip
    advice = [
        analysis.advice_on_study(full(here), {"gps": [100, cost]}, limit=50.0, percentile=p)
        for cost, p in ((10, 50.0), (20, 50.0), (10, 60.0))
    ]
    for several in (asked, levels, advice):
        several[0].save(tmp_path / "one", other="replace")
        for other in several[1:]:
            with pytest.raises(ConfigurationError, match="got that of another"):
                other.save(tmp_path / "one")
        assert len({json.dumps(it.manifest()) for it in several}) == len(several)


@pytest.mark.parametrize("kind", KINDS)
def test_the_columns_of_all_tables_are_declared(kind: str, here: Path) -> None:
    found = made(kind, here)
    for name, given in found.tables.items():
        if name not in found.columns:  # its columns are those of a study's runs, or of a record
            assert name in ("runs", "record") or name.startswith("estimates-")
            continue
        declared: Columns = found.columns[name]
        every = {c.name: c for c in (*declared.index, *declared.columns)}
        known = [n for n in given.columns if n in every]
        assert sorted(known) == sorted(set(known))
        missing = {n for n in every if n not in known and not every[n].sometimes}
        assert missing == set() or name == "estimates"
        assert bool(declared.more) or set(given.columns) <= {*every}
        for column in every.values():
            if column.name in given and column.type in (int, float, str, bool):
                values = given[column.name].dropna()
                assert all(of_type(value, column.type) for value in values), column.name


@pytest.mark.parametrize("kind", KINDS)
def test_attributes_are_what_they_are_described_to_be(kind: str, here: Path) -> None:
    found = made(kind, here)
    own = type(found)
    about = re.search(r"Attributes\n-+\n(.*?)(\n\n|$)", inspect.getdoc(own) or "", re.DOTALL)
    heads = re.findall(r"^(\w[\w, ]*)$", about[1] if about else "", re.MULTILINE)
    for name in ", ".join(heads).split(", ") if heads else ():
        assert hasattr(found, name), name
    for name, members in vars(own).items():
        returned = getattr(getattr(members, "fget", getattr(members, "func", None)),
                           "__annotations__", {}).get("return")  # fmt: skip
        if returned is not None and not name.startswith("_"):
            assert is_a(getattr(found, name), returned), f"{name}: {returned}"
    for name in {*found.columns} & {*found.tables} & {*dir(found)}:
        table = getattr(found, name)
        assert isinstance(table, pd.DataFrame), name
        written = found.tables[name]
        named = table.reset_index() if None not in table.index.names else table
        assert {*named.columns} <= {*written.columns}
        pd.testing.assert_frame_equal(named, written[[*named.columns]])


def is_a(value: Any, annotation: str) -> bool:
    """Whether a value is of one of the types that an annotation names, as far as that is known."""
    known = {"pd.DataFrame": pd.DataFrame, "dict": dict, "list": list, "tuple": tuple, "str": str,
             "float": float, "bool": bool, "int": int, "None": type(None)}  # fmt: skip
    named = [re.sub(r"\[.*\]", "", one).strip() for one in annotation.split(" | ")]
    return any(one not in known or isinstance(value, known[one]) for one in named)


def of_type(value: Any, kind: type) -> bool:
    if kind is float:
        return isinstance(value, float | int) or hasattr(value, "dtype")
    if kind is int:
        return float(value).is_integer()
    if kind is bool:
        return value in (True, False)
    return isinstance(value, str)


def test_all_declared_tables_are_in_the_reference() -> None:
    every_class()
    pages = "".join(path.read_text("utf-8") for path in (ROOT / "docs/reference").glob("*.md"))
    named = set(re.findall(r"<!-- made: columns (\S+) -->", pages))
    parts = {}
    for info in pkgutil.walk_packages(sblcosim.__path__, "sblcosim."):
        if info.name.endswith((".tables", ".columns", ".range_test")):
            module = importlib.import_module(info.name)
            parts |= {
                f"{info.name}.{name}": it for name, it in vars(module).items()
                if isinstance(it, Columns) and f"\n{name} = Columns(" in Path(
                    str(module.__file__)).read_text("utf-8")
            }  # fmt: skip
    assert set(parts) == named
    names = [it.part for it in parts.values()]
    assert len(names) == len(set(names)) > 15
    for it in parts.values():
        for column in it.columns:
            assert column.description.strip()
            assert column.name.endswith(f"_{column.unit}" if column.unit else column.name)


def test_a_table_that_is_no_frame_is_no_table(here: Path) -> None:
    for kind in KINDS:
        assert all(isinstance(t, pd.DataFrame) for t in made(kind, here).tables.values())

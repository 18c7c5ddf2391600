"""Arguments that take one of a few words or numbers refuse all others, in one line."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, get_origin

import made_logs
import numpy as np
import pandas as pd
import pytest
import sblcosim
from sblcosim import artifacts, calibrate, catalogue, style
from sblcosim.analysis import workflow
from sblcosim.analysis.advice import advice
from sblcosim.analysis.advice import figures as advice_figures
from sblcosim.analysis.levels import analysis as general
from sblcosim.analysis.levels import figures as general_figures
from sblcosim.analysis.means import analysis as sweep
from sblcosim.analysis.space import analysis as sensitivity
from sblcosim.analysis.space import figures as sensitivity_figures
from sblcosim.analysis.two_level import analysis as factorial
from sblcosim.analysis.two_level import figures as effect_figures
from sblcosim.areas import distance_figures
from sblcosim.areas import figures as area_figures
from sblcosim.areas import result as area_result
from sblcosim.areas.distance_result import DistanceCurve
from sblcosim.areas.grid import Grid
from sblcosim.comparison.budget import figures as budget_figures
from sblcosim.comparison.budget import result as budget_result
from sblcosim.comparison.many.result import Many
from sblcosim.comparison.tournament import figures as tournament_figures
from sblcosim.comparison.tournament import run as tournament
from sblcosim.errors import ConfigurationError, check_choice
from sblcosim.export import ssp
from sblcosim.identification import figures as device_figures
from sblcosim.judge import metrics
from sblcosim.logs.checks import log_of
from sblcosim.logs.contents import contents_of
from sblcosim.logs.figures import plot_log
from sblcosim.logs.raw import Raw
from sblcosim.models.declaration import Variable
from sblcosim.paths.diver_path import of_estimates
from sblcosim.processing import figures as processed_figures
from sblcosim.report import page
from sblcosim.report import two_level as report
from sblcosim.report.paper import figures as paper_figures
from sblcosim.require import figures as require_figures
from sblcosim.results import result
from sblcosim.results.figures import animation
from sblcosim.results.figures import run as figures
from sblcosim.scenario.wiring import connect
from sblcosim.simulation import execution
from sblcosim.simulation.how import How
from sblcosim.study import campaign, distributions, executors, space, study
from synthetic_record import make_record, track

RECORD = make_record()
TRACKS = {"ekf": track(RECORD, "ekf")}
RUNS = pd.DataFrame(list(product((0.0, 1.0), repeat=2)) * 2, columns=["a", "b"]).assign(
    y=np.arange(1.0, 9) ** 2, replicate=np.repeat([1, 2], 4)
)
FOUND = factorial.analyse(RUNS, "ab", "y")
GENERAL = general.analyse(RUNS, "ab", "y")
ADVICE = advice.advise(RUNS, "ab", "y", {})
MEANS = sweep.means(RUNS, "ab", "y", [0.0, 0.0])
RESULT = result.Result(result.RunDescription("x", {}, ["ekf"]), RECORD)
AREA = area_result.AreaMap(
    scenario=sblcosim.load("paper-scenario-1"), receiver="ekf", motion="rests", failures={},
    settings={
        "limit_m": None, "error": "absolute_total", "runs": 1, "settling_s": 0.0, "duration_s": 1.0
    },
    grid=Grid((0.0, 2.0), (0.0, 2.0), 2, 2, 5.0), beacons=np.zeros((4, 3)), origin=None,
    cells=pd.DataFrame(dict.fromkeys(
        ("runs", "p95_m", "std_error_m", "lost_share", "possible_p95_m", "accuracy", "hdop"),
        [1.0] * 4,
    )).astype({"accuracy": bool}),
)  # fmt: skip
DISTANCE = DistanceCurve(
    scenario=AREA.scenario, receiver="ekf", motion="rests", failures={},
    settings={
        **AREA.settings, "distance_m": [0.0, 9.0], "depth_m": [5.0], "cells": 2,
    },
    distances=pd.DataFrame({
        "depth_m": [5.0, 5.0], "distance_m": [0.0, 9.0], **dict.fromkeys(
            ("rms_m", "p95_m", "std_error_m", "bound_m", "lost_share", "possible_p95_m"), 1.0
        )
    }),
)  # fmt: skip
RANGE_TEST = (np.array([0.0, 1.0]), np.array([0.0, 1.0]), np.zeros(2), (0.0, 1.0))
CALIBRATED = calibrate.CalibrationResult(
    {}, calibrate.SoundSpeed(1.0, 0.0), 0.0, calibrate.SoundSpeed(1.0, 0.0), 0.0, 0.0, 1.0, 0.0,
    pd.DataFrame({"distance_m": [0.0, 1.0], "mean_m": [0.0, 1.0], "std_m": [0.0, 0.0]}),
)
COMPARED = tournament.evaluate(
    {"x": pd.DataFrame({
        f"ekf.{name}": [1.0, 2.0]
        for name in (tournament.RESPONSE, "absolute_total_p95_m", "nees_position", "lost")
    })},
    {"response": tournament.RESPONSE, "practical": None, "contamination": 0.05},
)  # fmt: skip
BUDGET = budget_result.Budget(
    "x", "ekf", pd.DataFrame({"frame": ["absolute"], "source": ["does not add up"]}).assign(
        kind="remainder", **dict.fromkeys(("rms_m", "share", "share_low", "share_high",
                                           "bound_share", "bound_rms_m"), 0.0),
    ), 30, 0, 1, False, False, 0.0, 3, "reference", 0.003,
)  # fmt: skip
LOG = log_of(Raw("log", {"beacons": {"A": [0, 0, 0]}}, tables={"receptions": pd.DataFrame(
    {"time_ns": [0, 1], "beacon": ["A", "A"], "range_m": [1.0, 2.0]}
)}))
PROCESSED = made_logs.processed()
STUDY = study.load("paper-scenario-1").with_replicates(1)
DRAWN = space.sample(
    [space.DrawnFactor("x", distributions.distribution_of("uniform", range=[1.0, 2.0]))], 16
)
SHARES = sensitivity.indices(DRAWN, DRAWN.values["x"].to_numpy())
PICTURE = page.PagePicture("x", "<svg></svg>", "x", "x")


def of_runs(function: Any, **options: Any) -> Any:
    """What is done with a study's table."""
    table = RUNS.rename(columns={"a": "gps", "b": "baseline", "y": "ekf.absolute_total_rms_m"})
    tables = {name: table["gps"] for name in STUDY.factors if name not in table}
    return function(STUDY, table.assign(**tables), **options)


CALLS: dict[str, Any] = {
    "results.figures.maps.plot_path theme": partial(figures.plot_path, RECORD, TRACKS),
    "results.figures.maps.plot_path_3d theme": partial(figures.plot_path_3d, RECORD, TRACKS),
    "results.figures.run.plot_axes theme": partial(figures.plot_axes, RECORD, TRACKS),
    "results.figures.run.plot_errors theme": partial(figures.plot_errors, RECORD, TRACKS),
    "results.figures.run.plot_errors frame": partial(figures.plot_errors, RECORD, TRACKS),
    "results.figures.run.plot_inclination theme": partial(figures.plot_inclination, RECORD),
    "results.figures.run.plot_range_test theme": partial(figures.plot_range_test, *RANGE_TEST),
    "logs.figures.plot_log theme": partial(plot_log, LOG),
    "logs.contents.LogContents.plot theme": contents_of(LOG).plot,
    "logs.contents.LogContents.save other": partial(contents_of(LOG).save, "nowhere"),
    "logs.contents.LogContents.save theme": partial(contents_of(LOG).save, "nowhere"),
    "results.result.Result.plot_path theme": RESULT.plot_path,
    "results.result.Result.plot_path_3d theme": RESULT.plot_path_3d,
    "results.result.Result.plot_axes theme": RESULT.plot_axes,
    "results.result.Result.plot_errors theme": RESULT.plot_errors,
    "results.result.Result.plot_errors frame": RESULT.plot_errors,
    "results.result.Result.plot_inclination theme": RESULT.plot_inclination,
    "catalogue.Job.axes theme": catalogue.Job(
        "x", figures.plot_path, (RECORD, {})
    ).axes,
    "areas.figures.plot_map theme": partial(area_figures.plot_map, AREA),
    "areas.figures.plot_certainty theme": partial(area_figures.plot_certainty, AREA),
    "areas.result.AreaMap.plot theme": AREA.plot,
    "areas.distance_figures.plot_distance theme": partial(
        distance_figures.plot_distance, DISTANCE, None
    ),
    "areas.distance_result.DistanceCurve.plot theme": DISTANCE.plot,
    "areas.result.AreaMap.save other": partial(AREA.save, "nowhere", figures=False),
    "areas.result.AreaMap.save theme": partial(AREA.save, "nowhere", figures=False),
    "artifacts.check other": partial(artifacts.check, Path("nowhere")),
    "artifacts.draft other": lambda other: artifacts.draft("nowhere", {}, other).__enter__(),
    "artifacts.place_for other": partial(artifacts.place_for, Path("nowhere"), {}),
    "results.figures.animation.write theme": partial(
        animation.write, RECORD, TRACKS, Path("nowhere.gif")
    ),
    "paths.diver_path.of_estimates kind": partial(of_estimates, "ekf", RECORD.estimates("ekf")),
    "results.result.Result.animate theme": partial(RESULT.animate, "nowhere.gif"),
    "identification.figures.plot_residuals theme": partial(
        device_figures.plot_residuals, {"1": RECORD.time_ns * 0.0}, 0.1, 0.0, 1.0
    ),
    "processing.figures.plot_map theme": partial(
        processed_figures.plot_map, PROCESSED.log, PROCESSED.tracks, PROCESSED.truth
    ),
    "processing.figures.plot_errors theme": partial(
        processed_figures.plot_errors, PROCESSED.log, PROCESSED.tracks
    ),
    "processing.figures.plot_residuals theme": partial(
        processed_figures.plot_residuals, PROCESSED.log, "raw", PROCESSED.made["raw"]
    ),
    "processing.processed.Processed.save other": partial(PROCESSED.save, "nowhere", figures=False),
    "processing.processed.Processed.save theme": partial(PROCESSED.save, "nowhere", figures=False),
    "results.result.Result.save other": partial(RESULT.save, "nowhere", figures=False),
    "results.result.Result.save theme": partial(RESULT.save, "nowhere", figures=False),
    "judge.metrics.error_column frame": partial(metrics.error_column, axis="x"),
    "judge.metrics.error_column axis": partial(metrics.error_column, "absolute"),
    "calibrate.CalibrationResult.plot theme": CALIBRATED.plot,
    "calibrate.CalibrationResult.save other": partial(CALIBRATED.save, "nowhere"),
    "calibrate.CalibrationResult.save theme": partial(CALIBRATED.save, "nowhere"),
    "calibrate.calibrate fmi": calibrate.calibrate,
    "comparison.tournament.result.Tournament.plot theme": COMPARED.plot,
    "answer.Answer.save theme": partial(COMPARED.save, "nowhere"),
    "comparison.tournament.result.Tournament.save other": partial(COMPARED.save, "nowhere"),
    "answer.Answer.save other": partial(COMPARED.save, "nowhere"),
    "comparison.tournament.figures.plot_tournament theme": partial(
        tournament_figures.plot_tournament, *tournament_figures.shown(COMPARED)
    ),
    "comparison.many.result.Many.save theme": partial(Many(COMPARED, {}, {}).save, "nowhere"),
    "comparison.many.result.Many.save other": partial(Many(COMPARED, {}, {}).save, "nowhere"),
    "comparison.budget.figures.plot_budget theme": partial(budget_figures.plot_budget, BUDGET),
    "comparison.budget.result.Budget.plot theme": BUDGET.plot,
    "style.use theme": lambda theme: style.use(theme).__enter__(),
    "style.named theme": style.named,
    "analysis.means.analysis.plot_means theme": partial(sweep.plot_means, MEANS),
    "analysis.two_level.analysis.analyse seeding": partial(factorial.analyse, RUNS, "ab", "y"),
    "analysis.two_level.analysis.analyse error": partial(factorial.analyse, RUNS, "ab", "y"),
    "analysis.workflow.of_table error": partial(of_runs, workflow.of_table),
    "report.two_level.find error": partial(of_runs, report.find),
    "analysis.two_level.analysis.analyse transform": partial(factorial.analyse, RUNS, "ab", "y"),
    "analysis.advice.figures.plot_front theme": partial(advice_figures.plot_front, ADVICE),
    "require.figures.plot_front theme": partial(require_figures.plot_front, None),
    "require.figures.plot_narrow theme": partial(require_figures.plot_narrow, None),
    "analysis.workflow.of_table transform": partial(of_runs, workflow.of_table),
    "report.two_level.find transform": partial(of_runs, report.find),
    "report.page.inline theme": partial(page.inline, PICTURE),
    "report.paper.figures.plot_waves theme": partial(paper_figures.plot_waves, {"x": RECORD}),
    "export.ssp.export_ssp version": partial(ssp.export_ssp, "paper-scenario-1"),
    "api.run fmi": partial(sblcosim.run, "paper-scenario-1"),
    "scenario.wiring.connect fmi": partial(connect, sblcosim.load("paper-scenario-1")),
    "simulation.execution.execute master": partial(execution.execute, None),
    "study.campaign.prepare master": lambda master: campaign.prepare(STUDY, How(master=master)),
    "study.runner.run executor": lambda executor: executors.ready(
        None, How(executor=executor)
    ).__enter__(),
}
CALLS |= {
    f"{where}.{name} theme": partial(getattr(module, name), *given)
    for name in ("plot_pareto", "plot_interactions", "plot_main_effects", "plot_residuals",
                 "plot_box_cox")
    for where, module, given in (("analysis.two_level.figures", effect_figures, (FOUND,)),
                                 ("analysis.two_level.analysis.Factorial", FOUND, ()))
}
CALLS |= {
    "study.distributions.distribution_of distribution": distributions.distribution_of,
    "study.space.sample version": partial(space.sample, DRAWN.factors, 16, 1),
    "analysis.space.analysis.indices transform": partial(sensitivity.indices, DRAWN, SHARES.values),
    "analysis.space.analysis.Sensitivity.plot_indices theme": SHARES.plot_indices,
    "analysis.space.analysis.Sensitivity.plot_scatter theme": SHARES.plot_scatter,
    "analysis.space.figures.plot_indices theme": partial(
        sensitivity_figures.plot_indices, SHARES
    ),
    "analysis.space.figures.plot_scatter theme": partial(
        sensitivity_figures.plot_scatter, SHARES
    ),
}
CALLS |= {
    f"{where}.{name} theme": partial(getattr(module, name), *given)
    for name in ("plot_means", "plot_interactions", "plot_pairs")
    for where, module, given in (("analysis.levels.figures", general_figures, (GENERAL,)),
                                 ("analysis.levels.analysis.GeneralFactorial", GENERAL, ()))
}
CALLS |= {
    f"analysis.levels.analysis.analyse {name}": partial(general.analyse, RUNS, "ab", "y")
    for name in ("typ", "transform", "seeding")
}
ELSEWHERE = {
    "areas.figures.plot_narrow theme": "areas.figures.plot_map",
    "study.definition.Definition.with_sample version": "study.space.sample",
    "analysis.space.analysis.of_table transform": "analysis.space.analysis.indices",
    "estimation.after.Smoothed.save other": "results.result.Result.save",
    "analysis.workflow.of_study error": "analysis.workflow.of_table",
    "report.study.analysed error": "report.two_level.find",
    "analysis.workflow.of_study transform": "analysis.workflow.of_table",
    "analysis.workflow.of_grid transform": "analysis.levels.analysis.analyse",
    "analysis.workflow.of_space transform": "analysis.space.analysis.indices",
    "report.study.analysed transform": "report.two_level.find",
    "catalogue.Job.save theme": "catalogue.Job.axes",
    "catalogue.drawing theme": "catalogue.Job.axes",
    "answer.Answer.write theme": "answer.Answer.save",
    "areas.result.AreaMap.write theme": "answer.Answer.save",
    "comparison.budget.result.Budget.write theme": "catalogue.Job.axes",
    "comparison.many.result.Many.write theme": "answer.Answer.save",
    "report.study.Analysis.write theme": "answer.Answer.save",
    "require.result.Requirement.write theme": "answer.Answer.save",
    "identification.result.Identified.write theme": "answer.Answer.save",
    "require.report.write theme": "answer.Answer.save",
    "estimation.after.Smoothed.save theme": "results.result.Result.save",
    "packages.recording.Recording.save theme": "results.result.Result.save",
    "packages.recording.Recording.save other": "results.result.Result.save",
    "simulation.user.receivers.of_folder fmi": "api.run",
}
"""Those that hand the argument on before they do anything with it, or get it checked; and where."""
DERIVED = {"scenario.decisions.Decision.moot kind", "processing.settings.rough arrangement"}
"""Those that no user gives: the kind of the beacons is worked out from the scenario or the log."""


def literals() -> set[str]:
    """All arguments of public functions that are annotated with a Literal."""
    found = set()
    for info in pkgutil.walk_packages(sblcosim.__path__, "sblcosim."):
        name = info.name.removeprefix("sblcosim.")
        if name.startswith(("fmus", "models", "cli", "__main__")):
            continue
        module = importlib.import_module(info.name)
        for word, thing in vars(module).items():
            if getattr(thing, "__module__", None) != info.name or word.startswith("_"):
                continue
            functions = {word: thing} if inspect.isfunction(thing) else {
                f"{word}.{method}": function for method, function in vars(thing).items()
                if inspect.isfunction(function) and not method.startswith("_")
            } if inspect.isclass(thing) else {}
            for path, function in functions.items():
                for parameter in inspect.signature(function).parameters.values():
                    for token in re.findall(r"[\w.]+", str(parameter.annotation)):
                        try:
                            kind = eval(token, vars(module))
                        except (NameError, AttributeError, SyntaxError):
                            continue
                        if str(get_origin(kind) or kind) == "typing.Literal":
                            found.add(f"{name}.{path} {parameter.name}")
    return found


def test_every_argument_that_is_a_choice_is_tried_here() -> None:
    found = literals()
    assert "results.figures.maps.plot_path theme" in found
    assert found >= DERIVED
    assert found <= CALLS.keys() | ELSEWHERE.keys() | DERIVED
    assert {f"{to} {name.split()[1]}" for name, to in ELSEWHERE.items()} <= CALLS.keys()


@pytest.mark.parametrize("name", CALLS)
def test_a_choice_that_there_is_not_is_refused_before_anything_is_done(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    argument = name.split()[1]
    for wrong in ("darck", 7, True, "", ["dark"]):
        with pytest.raises(ConfigurationError) as caught:
            CALLS[name](**{argument: wrong})
        assert re.match(rf"(calibrate )?{argument}: must be .* or .*, got ", str(caught.value))
        assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_the_nearest_choice_is_named() -> None:
    with pytest.raises(ConfigurationError) as caught:
        check_choice("frame", "relativ", ("absolute", "relative"))
    assert str(caught.value) == (
        "frame: must be absolute or relative, got 'relativ'; did you mean 'relative'?"
    )
    with pytest.raises(ConfigurationError, match="fmi: must be 2 or 3, got an instance of ndarray"):
        check_choice("fmi", np.array([2, 3]), (2, 3))
    check_choice("fmi", 2, (2, 3))


@pytest.mark.parametrize("word", ["causality", "type", "variability"])
def test_a_declaration_knows_its_words(word: str) -> None:
    with pytest.raises(ValueError, match=f"x: {word} must be one of .*, got 'outptu'"):
        Variable(**{"name": "x", "description": "", "causality": "output", word: "outptu"})

"""The report of one study: `sblcosim analyse`."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pandas as pd

from .. import artifacts, style
from ..analysis import sweep, workflow
from ..analysis.options import Error, Transform
from ..analysis.sentences import quantity as quantity_of
from ..study import store
from ..study.study import Study, load, shipped, study_of
from . import factorial
from .common import DEFINITIONS, as_toml, method, reproduce, seeding
from .factorial import Findings
from .formats import number, span
from .page import Block, Page, Picture, Section, Table, Text, render

REPORT = "report.html"


def save(
    results: str | Path,
    directory: str | Path,
    response: str = workflow.RESPONSE,
    *,
    receiver: str | None = None,
    order: int | None = None,
    transform: Transform = "none",
    error: Error = "pure",
    practical: float | None = None,
    command: str = "",
) -> str:
    """Analyse a study; write its tables, figures and report into a folder.

    Parameters
    ----------
    response, receiver, order, transform, error, practical
        As in `sblcosim.analysis.of_study`.
    command
        With which this was asked for, for the report.

    Returns
    -------
    str
        The analysis in words.

    Raises
    ------
    ConfigurationError
        There are no runs, or they cannot be analysed so; nothing is written then.
    """
    results = Path(results)
    study, table = study_of(results), store.table(results)
    failed = int(table["error"].notna().sum())
    command = command or shlex.join(["sblcosim", "analyse", str(results)])
    again = _again(study, results, command)
    plain = order is None and transform == "none" and error == "pure" and practical is None
    if study.design.kind in workflow.FACTORIAL or not plain:
        found = factorial.find(study, table, response, receiver=receiver, order=order,
                               transform=transform, error=error, practical=practical)
        with artifacts.folder(directory, workflow.about(found.data)) as folder:
            workflow.write(found.data, folder)
            page = _factorial_page(found, folder, failed, again)
            (folder / REPORT).write_text(render(page), "utf-8")
        return str(found.shown)
    column = workflow.column_of(table, response, receiver)
    table = workflow.in_numbers(table, column)
    means = sweep.means(table, list(study.factors), column, study.sweep_base)
    about = {"analysis": {"response": column, "factors": list(study.factors)}}
    with artifacts.folder(directory, about) as folder:
        artifacts.write_table(means, folder, "means")
        page = _means_page(study, table, means, column, folder, failed, again)
        (folder / REPORT).write_text(render(page), "utf-8")
    shown = means.replace({"factor": study.labels})
    shown = shown if study.factors else shown.drop(columns=["factor", "value"])
    text = _means_answer(study, means, workflow.words(column, table), unit_of(column))
    return f"{text}\n\n{shown.to_string(index=False, float_format='{:.4g}'.format)}"


def _again(study: Study, results: Path, command: str) -> Section:
    """How to reproduce."""
    about = store.described(results)
    lines = [
        f"{len(study.plan.points)} points, {study.replicates} replicates; {seeding(study)}.",
    ]
    source, file = study.name, ""
    if source in shipped() and _same(study, load(source)):
        if study.replicates != load(source).replicates:
            source += f" --replicates {study.replicates}"
    else:
        file = as_toml(study.model_dump(exclude_unset=True))
        source = shlex.quote(f"{source}.toml")
    return reproduce(
        [f"sblcosim study {source} --out {shlex.quote(str(results))}", command],
        lines, about["definition"]["fmus"], file,
    )


def _same(one: Study, other: Study) -> bool:
    """Whether two studies have the same runs, but for the number of replicates."""
    kept = {"title", "replicates", "scenario", "fixed"}
    return (
        one.model_dump(exclude=kept) == other.model_dump(exclude=kept)
        and one.base.given() == other.base.given()
    )


def _lead(study: Study, runs: int, failed: int) -> str:
    title = f"{study.title.rstrip('.')}. " if study.title else ""
    text = f"{title}{runs:,} runs at {len(study.plan.points)} points"
    return f"{text}; {failed} of them failed." if failed else f"{text}."


def _factorial_page(found: Findings, folder: Path, failed: int, again: Section) -> Page:
    study, a = found.study, found.shown
    svgs = {
        name: (folder / f"{name}.svg").read_text("utf-8")
        for name in ("pareto", "main_effects", "interactions", "residuals")
        if (folder / f"{name}.svg").exists()
    }
    if found.profile is not None:
        job = next(j for j in factorial.jobs(found) if j.name == "box_cox")
        svgs["box_cox"] = factorial.draw(job)
    how: list[Block] = [
        Text(method(a)), Text(DEFINITIONS),
        Text(f"Settling time: {study.settling_time_s:g} s. Intervals and the reference line have a "
             f"confidence of {a.confidence:g}."),
        factorial.factor_table(study),
    ]
    return Page(
        f"Which factor matters: {study.name}",
        _lead(study, a.runs, failed),
        [
            Section("Summary", "summary", factorial.summary(found)),
            Section("Tables", "tables", factorial.tables(found)),
            Section("Figures", "figures",
                    [factorial.picture(found, name, svg) for name, svg in svgs.items()]),
            Section("Method", "method", how),
            again,
        ],
        f"sblcosim {artifacts.software()['sblcosim']}",
    )


def _means_answer(study: Study, means: pd.DataFrame, quantity: str, unit: str) -> str:
    unit = f" {unit}" if unit else ""
    if not study.factors:
        row = means.iloc[0]
        return (
            f"Mean {quantity} {number(row['mean'], 4)}{unit}, "
            f"{span(row['low'], row['high'], number)}{unit}. The study has no factors: there are "
            "no effects to analyse."
        )
    parts = []
    for name in study.factors:
        mine = means[means["factor"] == name].reset_index(drop=True)
        best, worst = mine.iloc[mine["mean"].argmin()], mine.iloc[mine["mean"].argmax()]
        own = study.units[name]
        ends = [quantity_of(row["value"], own) for row in (best, worst)]
        parts.append(
            f"with {study.labels[name]} it is lowest, {number(best['mean'])}{unit}, at {ends[0]} "
            f"and highest, {number(worst['mean'])}{unit}, at {ends[1]}"
        )
    return (
        f"Mean {quantity}, one factor at a time: {'; '.join(parts)}. This is a sweep, no "
        "factorial design: it has no interactions and no effects to test."
    )


def _shared(study: Study) -> str:
    """Which rows of the means are of the same runs."""
    base = dict(zip(study.factors, study.sweep_base, strict=False))
    own = [name for name, value in base.items() if value in study.factors[name].levels]
    if len(own) < 2:
        return ""
    rows = ", ".join(
        f"{study.labels[name]} {quantity_of(float(base[name]), study.units[name])}" for name in own
    )
    return f"These rows are of the same runs, all factors at the scenario's own values: {rows}."


def _means_page(
    study: Study,
    table: pd.DataFrame,
    means: pd.DataFrame,
    column: str,
    folder: Path,
    failed: int,
    again: Section,
) -> Page:
    quantity, unit = workflow.words(column, table), unit_of(column)
    own = f" [{unit}]" if unit else ""
    rows = [
        (study.labels.get(row["factor"], "all runs"), number(row["value"]), number(row["runs"], 6),
         number(row["mean"], 4), span(row["low"], row["high"], number), number(row["std"]))
        for _, row in means.iterrows()
    ]
    head = ("Factor", "Level", "Runs", f"Mean{own}", f"95% interval{own}",
            f"Standard deviation{own}")
    sections = [
        Section("Summary", "summary",
                [Text(_means_answer(study, means, quantity, unit), "answer")]),
        Section("Tables", "tables", [
            Table(f"{quantity[0].upper()}{quantity[1:]}", head, rows, (), _shared(study))]),
    ]
    if study.factors:
        shown = means.replace({"factor": study.labels})
        units = {study.labels[name]: u for name, u in study.units.items()}
        axes = sweep.plot_means(shown, f"{quantity}{own}", units)
        style.save(axes[0], folder, "means")
        svg = (folder / "means.svg").read_text("utf-8")
        caption = f"Mean {quantity} at each level; bars are the intervals of the means."
        sections.append(Section("Figures", "figures", [Picture("means", svg, caption, caption)]))
    runs = int(np.isfinite(table[column]).sum())
    how: list[Block] = [
        Text("Means over the runs at each level, the other factors at the scenario's own values; "
             "the intervals are Student's."), Text(DEFINITIONS),
        Text(f"Settling time: {study.settling_time_s:g} s."),
    ]
    if study.factors:
        how.append(factorial.factor_table(study))
    sections += [Section("Method", "method", how), again]
    return Page(f"What the runs say: {study.name}", _lead(study, runs, failed), sections,
                f"sblcosim {artifacts.software()['sblcosim']}")

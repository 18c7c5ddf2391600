"""The folder of an answer: report, front, table of designs, and the named design's scenario."""

from __future__ import annotations

import shlex
from dataclasses import replace
from math import inf
from pathlib import Path

import pandas as pd

from .. import artifacts
from ..report.common import PLAY, as_toml, explore
from ..report.page import Block, Code, Page, PagePicture, PageTable, Section, Text, render
from ..report.parts import pictures
from ..style import ThemeName
from ..words.numbers import figure
from ..words.shares import percent
from .question import shipped
from .result import FIGURES, REPORT, SCENARIO, Requirement
from .tables import surely


def write(answer: Requirement, folder: Path, theme: ThemeName = "light") -> None:
    """Write the page, and the scenario of the design that surely suffices, into a folder.

    The figures exist already. They are drawn again for the page if their theme differs.
    """
    if answer.chosen is not None:
        (folder / SCENARIO).write_text(_scenario(answer, folder), "utf-8")
    page = _page(answer, folder if theme == "light" else None)
    (folder / REPORT).write_text(render(page), "utf-8")


def _scenario(answer: Requirement, folder: Path | None) -> str:
    worst = answer.of(answer.named)["condition"]
    lines = [
        f"# {answer.question.study.title or answer.question.study.name}",
        f"# The answer: {answer.priced(answer.named)}.",
        *([f"# Of the conditions, the one that is worst for it: {worst}."] if worst else []),
    ]
    return "\n".join([*lines, "", answer.scenario.dump_toml(folder)])


def _page(answer: Requirement, drawn_in: Path | None) -> Page:
    q, study = answer.question, answer.question.study
    first, *rest = answer.sentences()
    drawn = pictures(FIGURES, answer, drawn_in)
    summary: list[Block] = [Text(first, "answer"), *map(Text, rest)]
    met = len(q.conditions)
    return Page(
        study.title or f"Which design: {study.name}",
        f"Required: {q.requirement}{f' in each of {met} conditions' if met > 1 else ''}. Path: "
        f"{answer.scenario.target.trajectory}; duration: {_duration(answer)}; errors count from "
        f"{study.settling_time_s:g} s on.",
        [
            Section("Answer", "answer", summary),
            *([_front(answer, *drawn)] if drawn else []),
            *([_conditions(answer)] if study.conditions else []),
            Section("Designs", "designs",
                    [_table(answer, answer.worth, "Designs worth their cost" if q.costs
                            else "The most accurate designs")],
                    [Section("All designs", "all", [_table(answer, answer.designs, "All designs")],
                             folded=True)]),
            Section("Method", "method", [*map(Text, answer.notes()), Text(_METHOD)], folded=True),
            _again(answer),
        ],
        f"sblcosim {artifacts.software()['sblcosim']}",
    )  # fmt: skip


def _front(answer: Requirement, wide: PagePicture, narrow: PagePicture) -> Section:
    """The figure."""
    what = "Cost and accuracy" if answer.question.costs else "Accuracy"
    return Section(what, "front", [replace(wide, narrow=narrow)])


def _conditions(answer: Requirement) -> Section:
    """The conditions, and the results of the named designs in each."""
    q, study = answer.question, answer.question.study
    how = {
        "all": "a design must suffice in each of them",
        "average": "each run is in one of them, drawn at random",
    }
    rows = [
        [study.labels[name], ", ".join(q.quantity(name, level) for level in it.values),
         how[it.combine]]
        for name, it in study.conditions.items()
    ]
    head = ["Condition", "Levels", "How they count"]
    blocks: list[Block] = [PageTable("Conditions", head, rows, (1, 2))]
    named = answer.arms[answer.arms["design"].isin([answer.named, *answer.roles])]
    if len(q.conditions) > 1 and answer.spent:
        unit = f" [{q.unit}]" if q.unit else ""
        size = [] if q.flag else [f"{percent(q.terms.share)} within{unit}"]
        blocks.append(PageTable(
            "The designs that the answer names, in each condition",
            ["Design", "Condition", "Verdict", *size, "Surely", "Passed", "Runs"],
            [[answer.short(row["design"]), row["condition"], row["verdict"],
              *["lost" if row["estimate"] == inf else figure(row["estimate"]) for _ in size],
              surely(row, q.flag), f"{row['passed']:,}", f"{row['runs']:,}"]
             for row in named.to_dict(orient="records")],
            (1, 2),
        ))  # fmt: skip
    return Section("Conditions", "conditions", blocks)


def _table(answer: Requirement, designs: pd.DataFrame, caption: str) -> PageTable:
    head, rows = answer.table(designs)
    q = answer.question
    bound = f"share of runs that are not {q.flag}"
    if not q.flag:
        bound = f"value that {percent(q.terms.share)} are within"
    note = (
        f"Surely: bounds of the {bound}, which hold together for all designs; of a decided one, "
        "that of its claim. Runs and shares are those of the condition that is worst for a design; "
        "bounds hold in each condition."
    )
    titles = [word[:1].upper() + word[1:] for word in head]
    order = ", the cheapest first" if answer.question.costs else ""
    return PageTable(f"{caption}{order}", titles, rows, note=note)


_METHOD = (
    "A run passes or fails. Undecided designs go on together, from look to look, each a tenth "
    "more runs than the one before. A claim is made when a mixture of likelihood ratios against "
    "the required share exceeds the inverse of its share of the risk (Ville's inequality; Robbins "
    "1970, Howard et al. 2021): so it holds at all looks at once. The risk is shared over the "
    "designs, and for failing over the conditions, too; of undecided designs it is shared over the "
    "two bounds as well. What limits a design is found by runs on "
    "the same noise without each source of error, with a receiver that is told so; they are not "
    "of the budget."
)


def _duration(answer: Requirement) -> str:
    duration = answer.scenario.time.duration_s
    return "until the path's end" if duration == "path" else f"{duration:g} s"


def _again(answer: Requirement) -> Section:
    study = answer.question.study
    source = study.name if study.name in shipped() else shlex.quote(f"{study.name}.toml")
    blocks: list[Block] = [
        Code(f"sblcosim require {source} --most-runs {answer.question.terms.most_runs}"
             f"{' --until-sure' if answer.until_sure else ''}"),
        Text("Equal versions and seeds give equal results to the last bit, whatever the number of "
             "workers. Any run can be done again with its full record: sblcosim replay "
             "FOLDER/runs RUN_ID. The question:"),
        Code(as_toml(artifacts.plain(answer.question.tables))),
        Text("The scenario of the design that is named, scenario.toml beside this page:"),
        Code(answer.scenario.dump_toml()),
        Text(PLAY),
        Code(explore("scenario.toml")),
    ]  # fmt: skip
    return Section("How to reproduce", "reproduce", blocks, folded=True)

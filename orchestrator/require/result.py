"""The answer to a question: designs by cost and accuracy, and the sentences about them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from math import isfinite
from pathlib import Path
from string import ascii_uppercase
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
import pandas as pd

from .. import artifacts, layout
from ..analysis.common.bounds import share_interval
from ..answer import Answer
from ..catalogue import Figure, Job, by_name, jobs
from ..judge.definitions import LOST, MISLEADING
from ..lazy import Module
from ..results.responses import defined
from ..scenario.scenario import Scenario
from ..shown import folded, page, table, verbatim
from ..words.lists import doing, listed, plural
from ..words.numbers import PRACTICAL_RUNS, figure
from ..words.shares import percent
from . import limiting
from .limiting import Limiting
from .question import Question
from .sequential import FIRST, Decision, Rule
from .tables import CONDITIONS, DESIGNS, surely

if TYPE_CHECKING:
    from ..style import ThemeName

plots = Module("sblcosim.require.figures")
reports: Any = Module("sblcosim.require.report")

REPORT, SCENARIO = "report.html", "scenario.toml"
FRONT, NARROW = "front", "front_narrow"
"""The figures, for a wide page and for a narrow one."""

_WITHIN_A_RUN = " The same holds for the percentile of the estimates in a run."
VERDICTS: tuple[Decision, ...] = get_args(Decision)
"""Words for verdicts."""


@dataclass(frozen=True, eq=False, repr=False)
class Requirement(Answer):
    """Which designs meet a requirement, and which of them is the cheapest. Made by `decide`.

    Attributes
    ----------
    designs
        One row per design, the cheapest first: the choices' levels, ``cost``, ``verdict``, and for
        the design's worst condition its ``condition``, ``runs``, the number ``passed``, the
        ``estimate`` of the response's percentile that must be within the limit (the order statistic
        x₍⌈q n⌉₎); the ``lower`` and ``upper`` bound of the largest percentile over the conditions
        (infinite where none is claimed, as on the other side of a decided design's verdict);
        ``front``: by the estimates, no design is both cheaper and better.
    arms
        The same numbers for each design in each condition, with the ``verdict`` there. ``design``
        is the row in `designs`, ``condition`` the condition's name.
    spent
        Number of runs of all designs.
    chosen
        Row of the cheapest design that surely suffices; None if none does.
    cheaper
        Row of the next cheaper design on the front; None if nothing is cheaper.
    nearest
        Row of the tried design with the smallest estimate of the percentile. It surely fails only
        if all tried designs do.
    limits
        What limits the named design: the chosen one, or the nearest.
    scenario
        Scenario of the named design, in its worst condition.
    until_sure
        Whether designs that are dearer than one that suffices got no further runs.
    """

    document = "require"
    report = REPORT
    columns = MappingProxyType({"designs": DESIGNS, "conditions": CONDITIONS})

    question: Question
    designs: pd.DataFrame
    arms: pd.DataFrame
    spent: int
    chosen: int | None
    cheaper: int | None
    nearest: int
    limits: Limiting
    scenario: Scenario
    until_sure: bool = False

    @property
    def named(self) -> int:
        """Row of the design that the answer is about."""
        return self.nearest if self.chosen is None else self.chosen

    @property
    def untried(self) -> int:
        """Number of designs without runs: the budget did not reach them."""
        return int((self.designs["runs"] == 0).sum())

    @property
    def counts(self) -> dict[str, int]:
        """Number of designs by verdict."""
        return {v: int((self.designs["verdict"] == v).sum()) for v in VERDICTS}

    def levels(self, row: int) -> str:
        """The levels of a design, for people."""
        return self.question.named(self.row(row))

    def row(self, row: int) -> dict[str, Any]:
        """The levels of a design."""
        return {name: self.of(row)[name] for name in self.question.study.factors}

    def of(self, row: int) -> Any:
        """The numbers of a design."""
        return self.designs.loc[row]

    def priced(self, row: int) -> str:
        """The levels of a design and its cost."""
        cost = self.of(row)["cost"]
        if not self.question.costs:
            return self.levels(row)
        return f"{self.levels(row)}, for {self.question.price(cost)}"

    @property
    def title(self) -> str:
        """Of a page."""
        return f"Which design: {self.question.requirement}"

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """All designs, and if there are several conditions, all designs in each."""
        if len(self.question.conditions) < 2:
            return {"designs": self.designs}
        levels = self.designs[[*self.question.study.factors]]
        own = levels.loc[self.arms["design"]].reset_index(drop=True)
        return {"designs": self.designs, "conditions": own.join(self.arms.drop(columns="design"))}

    @property
    def figures(self) -> list[Job]:
        """Cost and accuracy, for a wide page and for a narrow one, if there are runs."""
        return jobs(FIGURES, self)

    @property
    def remarks(self) -> list[str]:
        """How to read the numbers, a line each."""
        return self.notes()

    def to_json(self) -> dict[str, Any]:
        """The designs by cost as plain data, the cheapest first."""
        terms, rows = self.question.terms, DESIGNS.rows(self.designs)
        plain: dict[str, Any] = artifacts.plain({
            "answer": self.answer, "response": self.question.response,
            "unit": self.question.unit, "limit": terms.limit, "share": terms.share,
            "confidence": terms.confidence, "most_runs": terms.most_runs, "runs": self.spent,
            "chosen": self.chosen, "cheaper": self.cheaper, "nearest": self.nearest,
            "limits": [{"name": n, "without": v} for n, v in self.limits.without.items()],
            "enough": self.limits.enough,
            "designs": [{"levels": self.row(n), **row} for n, row in enumerate(rows)],
        })  # fmt: skip
        return plain

    def located(self, folder: Path) -> dict[str, Any]:
        """Like `Answer.save`, with the scenario's file if a design surely suffices."""
        scenario = None if self.chosen is None else str(folder / SCENARIO)
        return {**super().located(folder), "scenario": scenario}

    def manifest(self) -> dict[str, Any]:
        """The question."""
        asked = self.question
        return {
            "question": asked.terms.model_dump() | {
                "name": asked.study.name, "until_sure": self.until_sure,
                "tables": artifacts.plain(asked.tables),
            }
        }  # fmt: skip

    def write(
        self, folder: Path, theme: ThemeName = "light", figures: bool = True
    ) -> None:
        """Like `Answer.save`, with the page and the scenario of the design that surely suffices."""
        super().write(folder, theme, figures)
        reports.write(self, folder, theme)

    @property
    def answer(self) -> str:
        """In a few sentences: the design, the next cheaper one, what limits it, and how sure it
        is."""
        return " ".join(self.sentences())

    def sentences(self) -> list[str]:
        """The sentences of the answer."""
        found = [self._found()]
        if self.chosen is not None:
            found += [self._cheaper()] if self.question.costs else []
        else:
            found += [self._nearest()]
        return [text for text in (*found, self.limited(), self.sure()) if text]

    def _found(self) -> str:
        counts, total = self.counts, len(self.designs)
        if self.chosen is not None:
            what = "The cheapest design" if self.question.costs else "The most accurate design"
            return f"{what} that suffices: {self.priced(self.chosen)}. {self._numbers(self.chosen)}"
        if not counts["undecided"]:
            return f"No design suffices: all {total} surely fail."
        if not counts["fails"]:
            which = f"all {total} are undecided{self._of_them_untried()}"
        else:
            which = (
                f"of {total}, {doing(counts['fails'], 'fail')} for sure, "
                f"{_undecided(counts['undecided'])}{self._of_them_untried()}"
            )
        return f"No design surely suffices: {which}.{self._too_few()}"

    def _of_them_untried(self) -> str:
        """How many of the undecided designs have no runs."""
        if not self.untried:
            return ""
        every = self.untried == self.counts["undecided"]
        return f", {'none' if every else self.untried} of them {'' if every else 'not '}tried"

    def _too_few(self) -> str:
        """The runs that a claim needs, if the budget is too small for any claim."""
        runs = self.designs["runs"][self.designs["verdict"] == "undecided"]
        least, few, most = self.question.rule.least, int(runs.min()), int(runs.max())
        if most >= least:
            return ""
        met = len(self.question.conditions)
        where = f" in each of {met} conditions" if met > 1 else ""
        return (
            f" At least {least} runs of a design{where}, all of them good, are needed to say that "
            f"it suffices; {self._are(few, most, least)}."
        )

    def _are(self, few: int, most: int, least: int) -> str:
        """How many runs the undecided designs have, and how many are missing."""
        if few < most:
            return f"the undecided ones have {few} to {most}"
        left = self.counts["undecided"]
        which = "the undecided one" if left == 1 else f"each of the {left} undecided ones"
        return f"{which} has {most} and needs {least - most} more"

    def _numbers(self, row: int) -> str:
        """How many runs of a design are within the limit, and its percentile."""
        q, of = self.question, self.of(row)
        if not of["runs"]:
            return "It has no runs yet."
        where = f" ({of['condition']})" if of["condition"] else ""
        if q.flag:
            return f"{self._share(row)} of {of['runs']:,} runs are not {q.flag}{where}."
        return (
            f"{self._share(row)} of {of['runs']:,} runs are within {self._size(q.terms.limit)}"
            f"{where}; {self._within(of['estimate'])}{self._bounds(row)}."
        )

    def _within(self, value: float) -> str:
        """The value that the required share of some runs is within; too few have a response if
        infinite."""
        share, flag = percent(self.question.terms.share), self.question.flag
        if not isfinite(value):
            return f"fewer than {share} end well"
        if flag:
            return f"{'fewer than ' if value > 0 else ''}{share} are not {flag}"
        return f"{share} are within {self._size(value)}"

    def _bounds(self, row: int) -> str:
        """The bounds of a percentile that belong to the verdict on a design."""
        of = self.of(row)
        low, high = (self._size(of[end]) if isfinite(of[end]) else "" for end in ("lower", "upper"))
        if low and not isfinite(of["estimate"]):
            share = percent(self.question.terms.share)
            return f", and {share} are surely not within less than {low}"
        if low and high:
            return f", surely between {low} and {high}"
        if low:
            return f", surely at least {low}"
        return f", surely at most {high}" if high else ""

    def _share(self, row: int) -> str:
        of = self.of(row)
        share = 100 * of["passed"] / of["runs"]
        near = abs(share - 100 * self.question.terms.share) < 0.1 or 99.9 < share < 100
        return f"{share:.2f} %" if near else f"{share:.1f} %".replace(".0 %", " %")

    def _cheaper(self) -> str:
        if self.cheaper is None:
            return "Nothing is cheaper."
        of = self.of(self.cheaper)
        fails = {
            "fails": f"fails{self._by(self.cheaper)}", "undecided": "is undecided",
            "suffices": "suffices, too",
        }[of["verdict"]]  # fmt: skip
        prices = [self.question.price(self.of(row)["cost"]) for row in (self.cheaper, self.named)]
        same = prices[0] == prices[1]
        which = "next one, at the same price," if same else "next cheaper one worth its cost"
        return (
            f"The {which} {fails}: {self.priced(self.cheaper)}. "
            f"{self._numbers(self.cheaper)}{self._more(self.cheaper)}{self._others_undecided()}"
        )

    def _others_undecided(self) -> str:
        """How many cheaper designs are undecided, besides the named one."""
        cheaper = self.designs["cost"] < self.of(self.named)["cost"]
        cheaper &= self.designs.index != self.cheaper
        count = int((cheaper & (self.designs["verdict"] == "undecided")).sum())
        if not count:
            return ""
        return f" Of the cheaper designs, {count} more {plural(count, 'is', 'are')} undecided."

    def _more(self, row: int) -> str:
        """How many runs would decide an undecided design."""
        of = self.of(row)
        if of["verdict"] != "undecided" or not of["runs"]:
            return ""
        return f" {missing(self.question.rule, int(of['passed']), int(of['runs']))}"

    def _by(self, row: int) -> str:
        """By how much a design fails."""
        of, limit = self.of(row), self.question.terms.limit
        if not isfinite(of["estimate"]):
            return ", too many of its runs being lost"
        if self.question.flag:
            return ""
        by = f" by {self._size(of['estimate'] - limit)}"
        if of["verdict"] == "fails":
            by += f", surely by {self._size(of['lower'] - limit)} or more"
        return by

    def _nearest(self) -> str:
        of = self.of(self.nearest)
        if not of["runs"]:
            return ""
        nearest = f"The nearest design{' that was tried' if self.untried else ''}"
        if of["verdict"] == "undecided":
            which = f"{nearest} is undecided: {self.priced(self.nearest)}."
            return f"{which} {self._numbers(self.nearest)}{self._more(self.nearest)}"
        return (
            f"{nearest}, {self.priced(self.nearest)}, fails{self._by(self.nearest)}. "
            f"{self._numbers(self.nearest)}"
        )

    def limited(self) -> str:
        """What limits the named design, and which change would suffice."""
        found, limit = self.limits, self.question.terms.limit
        if not found.without or (self.question.flag and found.everything <= limit):
            return ""
        share = percent(self.question.terms.share)
        flag = self.question.flag
        most = limit if flag else found.everything
        helping = [(n, v) for n, v in found.without.items() if v < found.everything and v <= most]
        of_all = f"in {limiting.RUNS} other runs, {self._within(found.everything)} with all errors"
        text = f"No error alone limits it: {of_all}, and no less without any one of them."
        if helping:
            (name, value), *rest = helping[:3]
            main = f"It is limited most by {name}: {of_all}, and {share} would"
            if flag:  # each of these is enough
                others = "".join(f" or without {name}" for name, _ in rest)
                return f"{main} not be {flag} without this one{others}."
            text = f"{main} be within {self._size(value)} without this one"
            text += "".join(f", {self._size(value)} without {name}" for name, value in rest) + "."
        if self.chosen is None and found.everything > limit:
            text += f" {enough(found, limit)}"
        return text

    def sure(self) -> str:
        """The confidence of these claims."""
        q, counts = self.question, self.counts
        met = len(q.conditions)
        what = f"{len(self.designs)} designs" + (f" in {met} conditions" if met > 1 else "")
        undecided = f", {_undecided(left)}" if (left := counts["undecided"]) else ""
        return (
            f"With {percent(q.terms.confidence)} confidence, every claim about the {what} "
            f"is right: {doing(counts['suffices'], 'suffice')}, "
            f"{doing(counts['fails'], 'fail')}{undecided}. {self._took()}"
            f"{self._left_alone()}{self._untried()}"
        )

    def _took(self) -> str:
        """How many runs were made, and how many were allowed."""
        most = self.question.terms.most_runs
        if self.spent <= most:
            return f"The answer took {self.spent:,} of {most:,} allowed runs."
        there = f"the budget of {most:,} does not include runs from before"
        return f"The answer took {self.spent:,} runs: {there}."

    def _left_alone(self) -> str:
        """How many designs were left undecided because the answer is sure without them."""
        if not self.until_sure or self.chosen is None:
            return ""
        if not self.question.costs:
            return " No design was skipped as dearer, because none has a cost."
        dearer = self.designs["cost"] > self.of(self.chosen)["cost"]
        count = int((dearer & (self.designs["verdict"] == "undecided")).sum())
        which = f"{count} dearer {plural(count, 'design was', 'designs were')}"
        return f" {which} left undecided." if count else ""

    def _untried(self) -> str:
        """How many designs the budget did not reach."""
        if not self.untried:
            return ""
        looks = FIRST * self.question.groups * len(self.question.conditions)
        return (
            f" {self.untried} {plural(self.untried, 'was', 'were')} not tried: a first look at "
            f"all designs takes a budget of {looks:,} runs."
        )

    def _size(self, value: float) -> str:
        """A value of the response, for people."""
        return f"{figure(value)}{self.question.unit and f' {self.question.unit}'}"

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The answer, then the designs worth their cost.

        Parameters
        ----------
        verbose
            Show all designs, and how to read the numbers.
        width
            Columns to fit into; None: sentences are not wrapped.
        """
        shown = self.designs if verbose else self.worth
        head, rows = self.table(shown)
        what = "cost and accuracy" if self.question.costs else "accuracy"
        others = "" if shown["front"].all() else ", and those named above"
        which = "All designs" if verbose else f"Designs that no other one beats in {what}{others}"
        right = [i for i, name in enumerate(head) if i and name != "verdict"]
        lines = [*self.sentences(), "", f"{which}:", *layout.table(rows, width, head, right)]
        terms = [LOST] if (shown["estimate"] == np.inf).any() else []
        terms += [it for it in defined(self.question.response) if it == MISLEADING]
        lines += ["", *(self.notes() if verbose else (*self._percentile(), *terms))]
        return layout.fitted("\n".join(lines), width)

    @property
    def letters(self) -> dict[int, str]:
        """Letters for the designs that the answer names, by row, for figure and table."""
        return dict(zip(self.roles, ascii_uppercase, strict=False))

    @property
    def roles(self) -> dict[int, str]:
        """The roles of the designs that the answer names, by row."""
        if self.chosen is None:
            return {self.nearest: "the nearest"} if self.of(self.nearest)["runs"] else {}
        found = {self.chosen: "the answer"}
        if self.cheaper is not None and self.question.costs:
            found[self.cheaper] = "the next cheaper"
        return found

    def short(self, row: int) -> str:
        """The levels of a design without the choices' names."""
        return " · ".join(self.question.quantity(n, v) for n, v in self.row(row).items())

    @property
    def worth(self) -> pd.DataFrame:
        """The designs on the front of cost and accuracy, and those that are named."""
        named = self.designs.index.isin([self.named, *self.roles])
        return self.designs[self.designs["front"].to_numpy(bool) | named]

    def table(self, designs: pd.DataFrame) -> tuple[list[str], list[list[str]]]:
        """Heading and rows of a table of designs, for people; the deciding columns are first."""
        q, study = self.question, self.question.study
        unit, letters = f" [{q.unit}]" if q.unit else "", self.letters
        size = [] if q.flag else [f"{percent(q.terms.share)} within{unit}"]
        within = f"within {q.terms.limit:g}{q.unit and f' {q.unit}'}"
        head = [
            " · ".join(study.labels[name] for name in study.factors), DESIGNS.head("verdict"),
            *size, *([DESIGNS.head("cost")] if q.costs else []),
            f"not {q.flag}" if q.flag else within, f"surely{unit}", DESIGNS.head("runs"),
        ]  # fmt: skip
        rows = [
            [
                f"{letters.get(number, ' '):{3 if letters else 0}}{self.short(number)}",
                row["verdict"],
                *["lost" if row["estimate"] == np.inf else figure(row["estimate"]) for _ in size],
                *([q.price(row["cost"])] if q.costs else []),
                self._share(number) if row["runs"] else "–",
                surely(row, q.flag), f"{row['runs']:,}",
            ]
            for number, row in zip(designs.index, designs.to_dict(orient="records"), strict=True)
        ]  # fmt: skip
        return head, rows

    def _percentile(self) -> list[str]:
        """How a percentile is defined, if there is one."""
        q = self.question
        return [] if q.flag else [
            f"What {percent(q.terms.share)} are within is an order statistic: of n runs, the one "
            f"of rank {q.terms.share:g} n, rounded up."
            f"{_WITHIN_A_RUN if 'percentile' in q.words else ''}"
        ]

    def notes(self) -> list[str]:
        """How to read the numbers."""
        q = self.question
        settled, share = q.study.settling_time_s, percent(q.terms.share)
        fails, suffices = ("upper", "lower") if q.flag else ("lower", "upper")
        return [
            f"A run passes if {q.passes}; errors count from {settled:g} s on. A run that "
            f"fails or is lost does not pass. {LOST}",
            *(it for it in defined(q.response) if it == MISLEADING),
            f"A design suffices if at least {share} of all runs that there could be pass"
            + (" in each condition." if len(q.conditions) > 1 else "."),
            *self._percentile(),
            "The bounds assume nothing about the distribution of the errors, and hold whenever one "
            f"looks. The {fails} bounds of all designs that fail hold together, and so do the "
            f"{suffices} ones of all that suffice. Of undecided designs both hold, of all of them "
            f"together: with a confidence of {percent(q.terms.confidence)} no interval is wrong.",
            "A design is left alone as soon as it is decided, so the runs of designs differ.",
        ]

    def _gist(self) -> str:
        chosen = "none" if self.chosen is None else self.levels(self.chosen)
        return f"to {self.question.study.name}, on {len(self.designs)} designs; {chosen}"

    def _repr_html_(self) -> str:
        return page(
            self.title,
            f"<p>{escape(self.answer)}</p>",
            table(*self.table(self.designs)),
            folded("How to read the numbers", verbatim("\n".join(self.remarks))),
        )


def _undecided(count: int) -> str:
    return f"{count} {plural(count, 'is', 'are')} undecided"


def missing(rule: Rule, passed: int, runs: int) -> str:
    """How many runs would decide an arm, given that `passed` of `runs` passed.

    Beyond `PRACTICAL_RUNS`, it says in words that no practical number would.
    """
    needed = rule.runs_to_decide(passed, runs, PRACTICAL_RUNS)
    if needed is not None:
        return f"At this share, {needed:,} runs of it would decide."
    text = (
        "This share is too close to the required one to decide with any practical number of runs "
        f"({PRACTICAL_RUNS:,})."
    )
    ends = share_interval(passed, runs)
    at_ends = [rule.runs_to_decide(end * runs, runs, PRACTICAL_RUNS) for end in ends]
    if None in at_ends:
        return text
    low, high = (percent(end, ".4g") for end in ends)
    return (
        f"{text} But after {runs:,} runs, the share may be anything from {low} to {high} (95 % "
        f"interval). At these ends, {at_ends[0]:,} or {at_ends[1]:,} runs would decide."
    )


def enough(limits: Limiting, limit: float) -> str:
    """The errors without which a failing design would suffice."""
    if not limits.enough:
        return "It would not suffice even without all of them."
    alone = [name for name, value in limits.without.items() if value <= limit]
    if len(alone) > 1:
        return f"It would suffice without any one of {listed(alone)}."
    if alone:
        return f"It would suffice without {alone[0]} alone."
    few = listed(limits.enough)
    return f"It would suffice without {few} together, but not without one of them alone."


def _data(answer: Requirement) -> tuple[Requirement]:
    return (answer,)


def _alt(answer: Requirement) -> str:
    return f"{_what(answer)} of {len(answer.designs)} designs. {answer.sentences()[0]}"


def _what(answer: Requirement) -> str:
    return "Cost and accuracy" if answer.question.costs else "Accuracy"


def _caption(answer: Requirement) -> str:
    return (
        f"{_what(answer)} of all designs: the value that "
        f"{percent(answer.question.terms.share)} of the runs are within; bars reach to the bounds "
        "that are claimed. Letters: the designs that the answer names."
    )


def _has_runs(answer: Requirement) -> bool:
    return answer.spent > 0 and not answer.question.flag


FIGURES: Mapping[str, Figure[Requirement]] = by_name(
    Figure(FRONT, plots.later("plot_front"), _data, _caption, _alt, _has_runs),
    Figure(NARROW, plots.later("plot_narrow"), _data, _caption, _alt, _has_runs),
)
"""The figures in the folder of an answer."""

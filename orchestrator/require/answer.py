"""The answer to a question: designs by cost and accuracy, and what there is to say of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from math import isfinite
from string import ascii_uppercase
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sblcosim.models import RECEIVERS

from .. import layout
from ..scenario.scenario import Scenario, Source
from ..scenario.sources import choose
from ..shown import Shown, folded, page, verbatim
from .limiting import Limiting, limiting
from .question import Question, passable
from .sequential import Elimination, percentile

Floats = NDArray[np.float64]
VERDICTS = {"good": "suffices", "not": "fails", "open": "open"}
"""Words for verdicts."""


@dataclass(frozen=True, eq=False, repr=False)
class Answer(Shown):
    """An answer.

    Attributes
    ----------
    designs
        One row per design, the cheapest first: the choices' levels, ``cost``, ``verdict``, and of
        the condition that is worst for it ``condition``, ``runs`` and ``passed`` of them,
        ``estimate`` of the percentile of the response that is to be within the limit, ``lower`` and
        ``upper`` bound of it; ``front``: no design is both cheaper and better, by the estimates.
    spent
        Runs that were done, of all designs.
    chosen
        Row of the cheapest design that surely suffices; None if none does.
    cheaper
        Row of the next cheaper one that is on the front; None if nothing is cheaper.
    nearest
        Row of the design with the smallest percentile, by its estimate.
    limits
        What limits the design that is named: the chosen one, or the nearest.
    scenario
        Of the design that is named, in the condition that is worst for it.
    """

    question: Question
    designs: pd.DataFrame
    spent: int
    chosen: int | None
    cheaper: int | None
    nearest: int
    limits: Limiting
    scenario: Scenario

    @property
    def named(self) -> int:
        """Row of the design that the answer is about."""
        return self.nearest if self.chosen is None else self.chosen

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
        """All that is known of a design."""
        return self.designs.loc[row]

    def priced(self, row: int) -> str:
        """The levels of a design and its cost."""
        cost = self.of(row)["cost"]
        if not self.question.costs:
            return self.levels(row)
        return f"{self.levels(row)}, for {self.question.price(cost)}"

    def answer(self) -> str:
        """In a few sentences: which, what of the next cheaper one, what limits it, how sure."""
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
        if not counts["open"]:
            return f"No design suffices: all {total} surely fail."
        if not counts["not"]:
            return f"No design surely suffices: all {total} are open.{self._too_few()}"
        return (
            f"No design surely suffices: {counts['not']} of {total} surely fail, "
            f"{counts['open']} are open.{self._too_few()}"
        )

    def _too_few(self) -> str:
        """What a claim takes, where the budget is too small for any."""
        least, most = self.question.rule.least, int(self.designs["runs"].max())
        if most >= least:
            return ""
        arms = len(self.designs) * len(self.question.conditions)
        return (
            f" To say that one suffices takes at least {least} runs of it, all of them good ones; "
            f"there are {most}, {least - most} more are needed at each of the {arms}."
        )

    def _numbers(self, row: int) -> str:
        """How many runs of a design are within the limit, and its percentile."""
        q, of = self.question, self.of(row)
        if not of["runs"]:
            return "It has no runs yet."
        where = f" ({of['condition']})" if of["condition"] else ""
        return (
            f"{self._share(row)} of {of['runs']:,} runs are within {self._size(q.terms.limit)}"
            f"{where}; {100 * q.terms.share:g} % are within "
            f"{self._size(of['estimate'])}{self._bounds(row)}."
        )

    def _bounds(self, row: int) -> str:
        """The bounds of a percentile that belong to what is said of a design."""
        of = self.of(row)
        low, high = isfinite(of["lower"]), isfinite(of["upper"])
        if of["verdict"] == "open" and low and high:
            return f", surely between {self._size(of['lower'])} and {self._size(of['upper'])}"
        if low and of["verdict"] != "good":
            return f", surely at least {self._size(of['lower'])}"
        if high and of["verdict"] != "not":
            return f", surely at most {self._size(of['upper'])}"
        return ""

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
            "not": f"fails{self._by(self.cheaper)}", "open": "is open",
            "good": "suffices, too",
        }[of["verdict"]]  # fmt: skip
        return (
            f"The next cheaper one worth its cost {fails}: {self.priced(self.cheaper)}. "
            f"{self._numbers(self.cheaper)}{self._more(self.cheaper)}"
        )

    def _more(self, row: int) -> str:
        """How many runs would decide a design that is open."""
        of = self.of(row)
        if of["verdict"] != "open" or not of["runs"]:
            return ""
        runs = self.question.rule.runs_to_decide(int(of["passed"]), int(of["runs"]))
        if runs is None:
            return " It is so near the limit that no number of runs is likely to decide it."
        return f" If its share stayed so, {runs:,} runs of it would decide it."

    def _by(self, row: int) -> str:
        """By how much a design fails."""
        of, limit = self.of(row), self.question.terms.limit
        if not isfinite(of["estimate"]):
            return ", too many of its runs being lost"
        by = f" by {self._size(of['estimate'] - limit)}"
        if of["verdict"] == "not":
            by += f", surely by {self._size(of['lower'] - limit)} or more"
        return by

    def _nearest(self) -> str:
        of = self.of(self.nearest)
        if of["verdict"] == "open":
            is_open = f"The nearest is open: {self.priced(self.nearest)}."
            return f"{is_open} {self._numbers(self.nearest)}{self._more(self.nearest)}"
        return (
            f"The nearest, {self.priced(self.nearest)}, fails{self._by(self.nearest)}. "
            f"{self._numbers(self.nearest)}"
        )

    def limited(self) -> str:
        """What limits the design that is named, and which change would do."""
        found, limit = self.limits, self.question.terms.limit
        if not found.without:
            return ""
        first, *rest = [*found.without.items()][:3]
        text = (
            f"What limits it is {first[0]}: without its error "
            f"{100 * self.question.terms.share:g} % would be within {self._size(first[1])}"
        )
        helping = [(n, v) for n, v in rest if v < found.everything]
        text += "".join(f"; without {name} {self._size(value)}" for name, value in helping) + "."
        if self.chosen is None and found.everything > limit:
            if found.enough:
                text += f" It would do without {_joined(found.enough)}."
            else:
                text += " Not even without all of them would it do."
        return text

    def sure(self) -> str:
        """How sure all this is."""
        q, counts = self.question, self.counts
        met = len(q.conditions)
        what = f"{len(self.designs)} designs" + (f" in {met} conditions" if met > 1 else "")
        open_ = f", {_counted(counts['open'], 'stay')} open" if counts["open"] else ""
        return (
            f"With a confidence of {100 * q.terms.confidence:g} % no claim about any of the {what} "
            f"is wrong: {_counted(counts['good'], 'suffice')}, {_counted(counts['not'], 'fail')}"
            f"{open_}. That took {self.spent:,} of at most {q.terms.most_runs:,} runs."
        )

    def _size(self, value: float) -> str:
        """A value of the response, for people."""
        if not isfinite(value):
            return "a loss"
        return f"{_figure(value)}{self.question.unit and f' {self.question.unit}'}"

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The answer, then the designs worth their cost.

        Parameters
        ----------
        verbose
            With all designs, and how to read the numbers.
        width
            Columns to fit into; None: sentences are not wrapped.
        """
        shown = self.designs if verbose else self.designs[self._worth()]
        head, rows = self.table(shown)
        which = "All designs" if verbose else "Designs that no other one beats in cost and accuracy"
        right = [i for i, name in enumerate(head) if i and name != "verdict"]
        lines = [*self.sentences(), "", f"{which}:", *layout.table(rows, width, head, right)]
        if verbose:
            lines += ["", *self.notes()]
        return layout.fitted("\n".join(lines), width)

    @property
    def letters(self) -> dict[int, str]:
        """Letters for the designs that are named in figure and table, by row: A, B, …, Z, AA, …"""
        rows = self.designs.index[self._worth()].tolist()
        return {
            row: (ascii_uppercase[n // 26 - 1] if n >= 26 else "") + ascii_uppercase[n % 26]
            for n, row in enumerate(rows[: 26 * 27])
        }

    def short(self, row: int) -> str:
        """The levels of a design without the choices' names."""
        return " · ".join(self.question.quantity(n, v) for n, v in self.row(row).items())

    def _worth(self) -> NDArray[np.bool_]:
        kept = {self.named, self.cheaper}
        worth: NDArray[np.bool_] = (
            self.designs["front"].to_numpy(bool) | self.designs.index.isin([*kept])
        )
        return worth

    def table(self, designs: pd.DataFrame) -> tuple[list[str], list[list[str]]]:
        """Head and rows of a table of designs, for people: letter and levels first."""
        q, study = self.question, self.question.study
        unit = f" [{q.unit}]" if q.unit else ""
        letters = self.letters
        head = [
            " · ".join(study.labels[name] for name in study.factors),
            *(["cost"] if q.costs else []), "verdict", "runs", "within",
            f"{100 * q.terms.share:g} % within{unit}", "surely",
        ]  # fmt: skip
        rows = [
            [
                f"{letters[number]}  {self.short(number)}" if number in letters
                else self.short(number),
                *([q.price(row["cost"])] if q.costs else []),
                VERDICTS[row["verdict"]], f"{row['runs']:,}",
                self._share(number) if row["runs"] else "–",
                "lost" if row["estimate"] == np.inf else _figure(row["estimate"]),
                _span(row["verdict"], row["lower"], row["upper"]),
            ]
            for number, row in zip(designs.index, designs.to_dict(orient="records"), strict=True)
        ]  # fmt: skip
        return head, rows

    def notes(self) -> list[str]:
        """How to read the numbers."""
        q = self.question
        settled, share = q.study.settling_time_s, f"{100 * q.terms.share:g} %"
        return [
            f"A run passes if its {q.words} is at most {q.terms.limit:g}"
            f"{q.unit and f' {q.unit}'}; errors count from {settled:g} s on. A run that fails or "
            "is lost does not pass.",
            f"A design suffices if at least {share} of all runs that there could be pass"
            + (" in each condition" if len(q.conditions) > 1 else "")
            + ". The bounds assume nothing about the distribution of the errors, and hold whenever "
            "one looks. The lower bounds of all designs hold together, and so do the upper ones.",
            "A design is left alone as soon as it is decided, so the runs of designs differ.",
        ]

    def _gist(self) -> str:
        chosen = "none" if self.chosen is None else self.levels(self.chosen)
        return f"to {self.question.study.name}, on {len(self.designs)} designs; {chosen}"

    def __str__(self) -> str:
        return self.text()

    def _repr_html_(self) -> str:
        head, rows = self.table(self.designs)
        cells = "".join(
            f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows
        )
        return page(
            f"Which design: {self.question.requirement}",
            f"<p>{escape(self.answer())}</p>",
            f"<table><tr>{''.join(f'<th>{escape(h)}</th>' for h in head)}</tr>{cells}</table>",
            folded("How to read the numbers", verbatim("\n".join(self.notes()))),
        )


def _figure(value: float) -> str:
    return f"{value:.3g}" if isfinite(value) else "–"


def _span(verdict: str, low: float, high: float) -> str:
    """The bounds of a percentile that belong to a verdict."""
    ends = [(low, "≥"), (high, "≤")]
    shown = [f"{sign} {_figure(end)}" for (end, sign), other in zip(ends, ("good", "not"),
             strict=True) if isfinite(end) and verdict != other]  # fmt: skip
    return ", ".join(shown) or "–"


def _counted(number: int, verb: str) -> str:
    """How many do something."""
    return f"{number} {verb}{'s' if number == 1 else ''}"


def _joined(names: tuple[str, ...]) -> str:
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


def answered(
    question: Question,
    elimination: Elimination,
    values: Mapping[tuple[int, int], Floats],
    workers: int | None = None,
) -> Answer:
    """The answer that follows from the runs.

    Parameters
    ----------
    values
        Responses of the runs that count, by design and condition.
    workers
        For the runs that tell what limits a design.
    """
    designs = _table(question, elimination, values)
    good = designs[designs["verdict"] == "good"]
    # Of equal cost, the more accurate one; a missing estimate is the worst.
    order = ["cost", "estimate"] if question.costs else ["estimate"]
    chosen = None if good.empty else int(good.sort_values(order, kind="stable").index[0])
    cheaper = None
    if chosen is not None:
        below = designs[designs["cost"] < designs.loc[chosen, "cost"]]
        worth = below[below["front"]] if below["front"].any() else below
        cheaper = int(worth.index[-1]) if len(worth) else None  # the cheapest are first
    nearest = _nearest(designs)
    named = nearest if chosen is None else chosen
    scenario, receiver = _scenario(question, named, int(designs["worst"].to_numpy()[named]))

    def rank(runs: pd.DataFrame, label: str) -> float:
        ordered = np.sort(passable(runs, question.response, label))
        return float(ordered[int(np.ceil(question.terms.share * len(ordered) - 1e-9)) - 1])

    about = {
        "name": question.study.name, "settling_time_s": question.study.settling_time_s,
        "seed": question.study.seed, "responses": list(question.study.responses),
    }  # fmt: skip
    limits = Limiting(float("nan"), {}, ())
    if elimination.spent:
        limits = limiting(scenario, receiver, about, rank, question.terms.limit, workers)
    return Answer(
        question, designs.drop(columns="worst"), elimination.spent, chosen, cheaper, nearest,
        limits, scenario,
    )  # fmt: skip


def _table(
    question: Question, elimination: Elimination, values: Mapping[tuple[int, int], Floats]
) -> pd.DataFrame:
    """One row per design, as `Answer.designs`, and ``worst``: the number of its condition."""
    rows, arms = [], [*question.conditions]
    for number, design in enumerate(question.designs):
        verdict = elimination.verdict(number)
        found = [
            (percentile(values.get((number, c), np.empty(0)), question.rule), c)
            for c in range(len(arms))
        ]
        worst = max(found, key=lambda one: _badness(elimination, number, *one))
        (estimate, lower, upper), at = worst
        rows.append({
            **design.levels, "cost": design.cost, "verdict": verdict,
            "condition": question.named(dict(arms[at])),
            "runs": int(elimination.seen[number, at]),
            "passed": int(elimination.passed[number, at]),
            "estimate": estimate, "lower": lower, "upper": upper, "worst": at,
        })  # fmt: skip
    designs = pd.DataFrame(rows)
    rank = designs["estimate"].fillna(np.inf)
    by = designs.assign(rank=rank).sort_values(["cost", "rank"], kind="stable")["rank"]
    designs["front"] = by < by.cummin().shift(fill_value=np.inf)
    return designs


def _badness(
    elimination: Elimination, number: int, numbers: tuple[float, float, float], condition: int
) -> tuple[int, float, float]:
    """What makes a condition the worst one for a design."""
    verdict = elimination.arm(number, condition)
    seen, passed = (int(a[number, condition]) for a in (elimination.seen, elimination.passed))
    estimate = numbers[0] if seen else -np.inf
    return ["good", "open", "not"].index(verdict), estimate, (seen - passed) / max(seen, 1)


def _nearest(designs: pd.DataFrame) -> int:
    """Row of the design that is nearest to what is required."""
    failing = 1 - designs["passed"] / designs["runs"].clip(lower=1)
    ranked = designs.assign(estimate=designs["estimate"].fillna(np.inf), failing=failing)
    return int(ranked.sort_values(["estimate", "failing", "cost"], kind="stable").index[0])


def _scenario(question: Question, named: int, condition: int) -> tuple[Scenario, Source]:
    """The scenario of a design in a condition, and its receiver."""
    design, study = question.designs[named], question.study
    row = [*question.conditions.values()][condition][0]
    point = row * question.groups + design.group + 1
    scenario = study.base.override(study.overrides(point).items())
    receiver = choose(study.base, list(study.receivers))[design.receiver]
    changes: dict[str, Any] = {
        "name": f"{study.name}-answer", "title": f"The answer to {study.title or study.name}",
    }  # fmt: skip
    if study.receiver_factor is not None and receiver in RECEIVERS:
        changes["receiver.type"] = receiver
    return scenario.override(changes.items()), receiver

"""From the runs of a question to its answer: designs are compared, and one of them is named."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sblcosim.models import RECEIVERS

from ..scenario.scenario import Scenario, Source, load
from ..scenario.sources import choose
from .limiting import Limiting, limiting
from .question import Question, passable
from .result import Requirement
from .sequential import Decision, Elimination, percentile
from .tables import claimed_share

Floats = NDArray[np.float64]


def answered(
    question: Question,
    elimination: Elimination,
    values: Mapping[tuple[int, int], Floats],
    workers: int | None = None,
) -> Requirement:
    """The answer that follows from the runs.

    Parameters
    ----------
    values
        Responses of the runs that count, by design and condition.
    workers
        Workers for the runs that show what limits a design.
    """
    arms = _arms(question, elimination, values)
    designs = _table(question, elimination, arms)
    good = designs[designs["verdict"] == "suffices"]
    # With equal costs, the more accurate design; a missing estimate is worst.
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
    return Requirement(
        question, designs.drop(columns="worst"), arms, elimination.spent, chosen, cheaper, nearest,
        limits, scenario, elimination.prices is not None,
    )  # fmt: skip


def _arms(
    question: Question, elimination: Elimination, values: Mapping[tuple[int, int], Floats]
) -> pd.DataFrame:
    """One row per design and condition, as in `Requirement.arms`."""
    rows = []
    for number in range(len(question.designs)):
        for at, condition in enumerate(question.conditions):
            verdict = elimination.arm(number, at)
            mine = values.get((number, at), np.empty(0))
            estimate, lower, upper = percentile(mine, question.rule, verdict != "undecided")
            # A decided arm has its whole risk on the side of its claim, so the other bound does not
            # exist.
            lower = -np.inf if verdict == "suffices" else lower
            upper = np.inf if verdict == "fails" else upper
            runs, passed = (int(it[number, at]) for it in (elimination.seen, elimination.passed))
            least, most = np.nan, np.nan
            if question.flag:
                least, most = claimed_share(passed, runs, question.rule, verdict)
            rows.append({
                "design": number, "condition": question.named(dict(condition)), "verdict": verdict,
                "runs": runs, "passed": passed, "estimate": estimate, "lower": lower,
                "upper": upper, "share_lower": least, "share_upper": most,
            })  # fmt: skip
    return pd.DataFrame(rows)


def _table(question: Question, elimination: Elimination, arms: pd.DataFrame) -> pd.DataFrame:
    """One row per design, as in `Requirement.designs`, with ``worst``: its condition's number."""
    rows, met = [], len(question.conditions)
    every: list[Any] = arms.to_dict(orient="records")
    for number, design in enumerate(question.designs):
        mine = every[met * number : met * (number + 1)]
        worst = max(range(met), key=[_badness(**arm) for arm in mine].__getitem__)
        kept = {k: v for k, v in mine[worst].items() if k not in ("design", "verdict")}
        rows.append({
            **design.levels, "cost": design.cost, "verdict": elimination.verdict(number), **kept,
            **_bounded(pd.DataFrame(mine)), "worst": worst,
        })  # fmt: skip
    designs = pd.DataFrame(rows)
    rank = designs["estimate"].fillna(np.inf)
    by = designs.assign(rank=rank).sort_values(["cost", "rank"], kind="stable")["rank"]
    designs["front"] = by < by.cummin().shift(fill_value=np.inf)
    return designs


def _bounded(arms: pd.DataFrame) -> dict[str, float]:
    """Bounds of a design's largest percentile and smallest share over its conditions.

    The condition with the largest estimate need not have the largest bound.
    """
    low, high = arms["share_lower"].fillna(0.0).min(), arms["share_upper"].fillna(1.0).min()
    return {
        "lower": arms["lower"].max(), "upper": arms["upper"].max(),
        "share_lower": low if low > 0 else np.nan, "share_upper": high if high < 1 else np.nan,
    }  # fmt: skip


def _badness(
    *, verdict: Decision, runs: int, passed: int, estimate: float, **_: object
) -> tuple[int, float, float]:
    """Order of conditions, the worst first: failing, undecided, or farthest from the limit."""
    known = estimate if runs else -np.inf
    return ["suffices", "undecided", "fails"].index(verdict), known, (runs - passed) / max(runs, 1)


def _nearest(designs: pd.DataFrame) -> int:
    """Row of the design that is closest to the requirement: one that does not surely fail, if any.

    Designs without runs come last, because nothing is known about them.
    """
    ranked = designs.assign(
        estimate=designs["estimate"].fillna(np.inf), untried=designs["runs"] == 0,
        fails=designs["verdict"] == "fails",
        failing=1 - designs["passed"] / designs["runs"].clip(lower=1),
    )  # fmt: skip
    order = ["untried", "fails", "estimate", "failing", "cost"]
    return int(ranked.sort_values(order, kind="stable").index[0])


def _scenario(question: Question, named: int, condition: int) -> tuple[Scenario, Source]:
    """The scenario of a design in a condition, and its receiver."""
    design, study = question.designs[named], question.study
    row = [*question.conditions.values()][condition][0]
    point = row * question.groups + design.group + 1
    scenario = study.base.override(study.overrides(point).items())
    receiver = choose(study.base, list(study.receivers))[design.receiver]
    if study.receiver_factor is not None and isinstance(receiver, str) and receiver in RECEIVERS:
        scenario = _with_receiver(scenario, receiver)
    names = {
        "name": f"{study.name}-answer", "title": f"The answer to {study.title or study.name}",
    }
    return scenario.override(names.items()), receiver


def _with_receiver(scenario: Scenario, receiver: str) -> Scenario:
    """The scenario with one of our receivers, without the keys that only others have."""
    tables = scenario.given()
    known = {variable.key for variable in RECEIVERS[receiver].of("parameter")}
    of_others = scenario.receiver.variables.keys() - known
    own = {k: v for k, v in tables.get("receiver", {}).items() if k not in of_others}
    return load({**tables, "receiver": {**own, "type": receiver}})

"""The points of an advice, by a second calculation from the runs of each."""

from __future__ import annotations

from math import ceil, inf, nan
from typing import Any

import numpy as np
import pandas as pd
import pytest
from sblcosim.analysis.advice.advice import Advice, advise
from sblcosim.analysis.common.bounds import LEAST_RUNS, mean_bound
from sblcosim.errors import ConfigurationError
from scipy import stats

COSTS: dict[str, dict[Any, float]] = {
    "gps": {"good": 90.0, "fair": 40.0, "bad": 10.0}, "arm": {1: 0.0, 2: 30.0, 3: 50.0},
}


def drawn(random: np.random.Generator) -> pd.DataFrame:
    """Runs of some of the points, of different numbers, with equal values and lost runs."""
    parts = []
    for gps in COSTS["gps"]:
        for arm in COSTS["arm"]:
            n = int(random.choice([1, 2, 3, 8, 12, 16, 20, 24, 40]))
            if random.random() < 0.2:
                continue
            level = random.choice([0.5, 1.0, 2.0])
            y = np.round(2 * random.gamma(6.0, level / 6, n)) / 2
            y[random.random(n) < random.choice([0.0, 0.0, 0.1, 0.25])] = random.choice([nan, inf])
            lost = (random.random(n) < random.choice([0.0, 0.0, 0.25])) * 1.0
            parts.append(pd.DataFrame({"gps": gps, "arm": arm, "y": y, "lost": lost}))
    return pd.concat(parts).sample(frac=1.0, random_state=int(random.integers(99)))


def weighed(
    table: pd.DataFrame, limit: float | None, percentile: float | None, contamination: float,
    confidence: float,
) -> tuple[list[dict[str, Any]], int]:
    """The points in order, and the runs that a bound needs."""
    met = sorted({(str(g), int(a)) for g, a in zip(table["gps"], table["arm"], strict=True)})
    risk = (1 - confidence) / len(met)
    share = 1 - contamination if percentile is None else percentile / 100
    needed = next(n for n in range(9999) if share**n <= risk * (1 + 1e-9))
    if percentile is None:
        needed = max(needed, LEAST_RUNS)
    rows: list[dict[str, Any]] = []
    for gps, arm in met:
        own = table[(table["gps"] == gps) & (table["arm"] == arm)]
        good = sorted(own["y"][np.isfinite(own["y"]) & (own["lost"] == 0)])
        n, lost = len(own), len(own) - len(good)
        ranked = [*good, *[inf] * lost]
        if percentile is None:
            estimate, upper = mean_bound(np.array(good), risk)
        else:
            estimate = ranked[ceil(share * n - 1e-9) - 1]
            upper = next((y for k, y in enumerate(ranked, 1)
                          if stats.binom.sf(k - 1, n, share) <= risk), inf)  # fmt: skip
        rows.append({
            "gps": gps, "arm": arm, "cost": COSTS["gps"][gps] + COSTS["arm"][arm], "runs": n,
            "lost": lost, "estimate": estimate, "upper": upper if n >= needed else inf,
            "lost_upper": 1.0 if lost == n else stats.beta.ppf(1 - risk, lost + 1, n - lost),
        })  # fmt: skip
    rows.sort(key=lambda it: (it["cost"], np.nan_to_num(it["estimate"], nan=inf)))
    best = inf
    for it in rows:
        counts = percentile is not None or it["lost"] <= contamination * it["runs"]
        it["front"] = counts and bool(it["estimate"] < best)
        best = it["estimate"] if it["front"] else best
        it["tolerable"] = counts
        it["meets"] = limit is not None and it["upper"] <= limit and (
            percentile is not None or it["lost_upper"] <= contamination
        )  # fmt: skip
    return rows, needed


def told(rows: list[dict[str, Any]], needed: int, limit: float) -> str:
    """What the answer must contain."""
    def levels(it: dict[str, Any]) -> str:
        return f"gps {it['gps']}, arm {it['arm']}"

    chosen = [it for it in rows if it["meets"]]
    if chosen:
        it = chosen[0]
        return (f"{levels(it)}, at a cost of {it['cost']:g}. It has {it['estimate']:.4g} m, at "
                f"most {it['upper']:.4g} m.")  # fmt: skip
    fewest, most = min(it["runs"] for it in rows), max(it["runs"] for it in rows)
    have = f"{fewest}" if fewest == most else f"{fewest} or more"
    missing = (f"Each of the {len(rows)} points needs {needed} runs. There are {have}, so "
               f"{needed - fewest} are missing.")  # fmt: skip
    if most < needed:
        return missing
    possible = [it for it in rows if it["tolerable"]]
    hopeful = [it for it in possible if it["estimate"] <= limit]
    if hopeful:
        more = f" {missing}" if fewest < needed else ""
        return f"By its estimate, {levels(hopeful[0])} has. More replicates may decide it.{more}"
    if not possible:
        return "of the runs are lost."
    it = min(possible, key=lambda it: (it["upper"], it["estimate"]))
    bound = f", at most {it['upper']:.4g} m" if it["upper"] < inf else ""
    return f"The best point has {it['estimate']:.4g} m{bound}."


def test_points_bounds_front_choice_and_answer_are_those_of_a_second_calculation() -> None:
    random = np.random.default_rng(73)
    kinds: set[str] = set()
    for _ in range(24):
        table = drawn(random)
        percentile = (None, 50.0, 80.0, 90.0)[random.integers(4)]
        limit = (None, 0.5, 1.0, 1.5, 2.5)[random.integers(5)]
        given = float(random.choice([0.25, 0.5])), float(random.choice([0.9, 0.6]))
        found: Advice = advise(
            table, ["gps", "arm"], "y", COSTS, limit=limit, percentile=percentile, unit="m",
            contamination=given[0], confidence=given[1], lost="lost",
        )  # fmt: skip
        rows, needed = weighed(table, limit, percentile, *given)
        again = pd.DataFrame(rows).drop(columns="tolerable")
        pd.testing.assert_frame_equal(
            found.points[[*again]], again, check_dtype=False, rtol=1e-9, check_exact=False
        )
        assert found.runs_needed == needed
        assert found.missing == max(0, needed - min(it["runs"] for it in rows))
        chosen = [n for n, it in enumerate(rows) if it["meets"]]
        assert found.chosen == (chosen[0] if chosen else None)
        if limit is not None:
            expected = told(rows, needed, limit)
            assert expected in found.own_answer(), expected
            kinds.add(" ".join(expected.split()[:2]) if not chosen else "chosen")
            assert found.beside is not None
            assert found.beside.percentile == (90.0 if percentile is None else None)
        else:
            assert f"{again['front'].sum()} of {len(rows)} points" in found.own_answer()
    assert {"chosen", "By its", "The best", "Each of"} <= kinds


@pytest.mark.parametrize(("name", "good", "bad"), [
    ("percentile", (1, 1.5, 99.5), (0.99, 100, 100.5)),
    ("confidence", (0.001, 0.5, 0.999), (0.0, 1.0, 1.5)),
    ("contamination", (0.001, 0.5, 0.999), (0.0, 1.0, -0.5)),
    ("limit", (0.5, 1e9), (inf, nan, -inf)),
])  # fmt: skip
def test_numbers_of_a_question_are_inside_their_ranges(
    name: str, good: tuple[float, ...], bad: tuple[float, ...]
) -> None:
    table = drawn(np.random.default_rng(72))
    for value in good:
        options: dict[str, Any] = {name: value}
        advise(table, ["gps", "arm"], "y", COSTS, **options)
    for value in bad:
        with pytest.raises(ConfigurationError, match=f"{name}: must be .*, got {value}"):
            advise(table, ["gps", "arm"], "y", COSTS, **(options | {name: value}))


@pytest.mark.parametrize(("percentile", "contamination", "confidence", "needed"), [
    (None, 0.5, 0.6, 3), (50.0, 0.5, 0.6, 2), (None, 0.2, 0.9, 11), (80.0, 0.5, 0.9, 11),
])  # fmt: skip
def test_a_point_has_a_bound_from_the_number_of_runs_that_is_needed(
    percentile: float | None, contamination: float, confidence: float, needed: int
) -> None:
    for n in (needed - 1, needed):
        table = pd.DataFrame({"gps": "bad", "y": np.linspace(1.0, 2.0, n)})
        found = advise(table, ["gps"], "y", {}, percentile=percentile, confidence=confidence,
                       contamination=contamination, limit=9.0)  # fmt: skip
        assert found.runs_needed == needed
        assert np.isfinite(found.points["upper"][0]) == (n == needed)
        few = "too few runs" if percentile is not None else "some point may have shown none"
        assert (few in found.own_answer()) == (n < needed)
        assert found.free == ("gps",)
    assert advise(table, ["gps"], "y", {"gps": {"bad": 1.0}}).free == ()

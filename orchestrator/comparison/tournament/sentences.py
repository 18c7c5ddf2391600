"""A tournament in words: which receiver is better, the tables, and what the numbers mean."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from math import isfinite, isnan
from typing import TYPE_CHECKING, Any

import pandas as pd

from ...judge.consistency import COVARIANCES
from ...judge.definitions import LOST, MISLEADING
from ...judge.over_runs import SUFFIX
from ...layout import fitted, table
from ...results.responses import RESPONSES, readable, unit_of
from ...words.lists import listed
from ...words.numbers import PRACTICAL_RUNS, interval, measured, rounded
from ...words.shares import (
    interval_percent,
    percent,
    percent_at_least,
    percent_at_most,
    rough_percent,
)
from ..common.evaluation import ALL, PERCENTILE
from ..common.statistics import ALPHA, SHARE, least_runs
from . import starts

if TYPE_CHECKING:
    from .result import Tournament

_NAMED = 4
"""A list with more receivers or scenarios than this is replaced by their number."""
WITHIN = (
    "95 % in a run: an order statistic, of a run's n errors the one of rank 0.95 n, rounded up; "
    "averaged over the runs. 95 % of runs: upper confidence bound of the 95th "
    "percentile over the runs, by order statistics."
)
"""Definition of the columns with percentages, for people."""
_NOTES = (
    "All receivers of a scenario had the same noise, seed by seed. A seed is one observation. An "
    "RMS over runs is the root of the mean of their mean squares, including lost runs. Over all "
    "scenarios it is the mean of theirs. Differences are between the values of single runs or, "
    "over all scenarios, between a seed's means over them.",
    "A difference is the first receiver minus the second: below 0 the first one is better. The "
    "sign test, which assumes nothing, decides which is better. The table has an interval of the "
    "mean only with enough runs, without failed runs, and unless a few runs dominate the mean.",
    WITHIN,
    f"{LOST} {MISLEADING} Its share is of the runs with a NEES, with its 95 % interval. "
    "Update: time of an update, of our receivers in their engine for one simulation; only "
    "roughly so.",
)


def words_of(response: str) -> str:
    """A response for sentences."""
    return RESPONSES[response].words if response in RESPONSES else readable(response)


def _some(names: Sequence[str]) -> str:
    """Names for a sentence; a long list is replaced by its length."""
    return listed(names, most=_NAMED, shown=_NAMED - 1)


def in_place(it: Tournament, place: str) -> list[str]:
    """The receivers that were in a place, beginning with the smallest median."""
    there = set(it.levels.loc[it.levels["scenario"] == place, "receiver"])
    return [receiver for receiver in it.receivers if receiver in there]


def rows_of(it: Tournament, place: str, response: str) -> list[Any]:
    """The differences of a place."""
    mine = (it.differences["scenario"] == place) & (it.differences["response"] == response)
    return list(it.differences[mine].itertuples(index=False))


# --- The answer ----------------------------------------------------------------------------------


def answer(it: Tournament) -> str:
    """Which receiver is best, and where it is not."""
    place = it.places[-1]
    names = in_place(it, place)
    if len(names) < 2:
        return (_reached(it, place, names) if names else
                "No receiver was in all scenarios, so none is best over all.")  # fmt: skip
    return " ".join([
        *_best(it, place, names[0]), _reached(it, place, names), *_exceptions(it)
    ])  # fmt: skip


def _reached(it: Tournament, place: str, names: Sequence[str]) -> str:
    """The receivers' values over all runs."""
    unit = unit_of(it.response)
    values = ", ".join(f"{name} {measured(reached(it.level(place, name)), unit)}" for name in names)
    runs = it.level(place, names[0])["runs"]
    where = f", mean of {len(it.places) - 1} scenarios" if place == ALL else f" in {place}"
    over = " over" if it.response.endswith(SUFFIX) else ", mean of"
    what = words_of(it.response)
    return f"{what[0].upper()}{what[1:]}{over} {runs} runs{where}: {values}."


def reached(row: Any) -> float:
    """A receiver's value over all runs: for an RMS the RMS over the runs, else the mean."""
    return float(row["mean"] if isnan(row["rms_over_runs"]) else row["rms_over_runs"])


def _best(it: Tournament, place: str, best: str) -> Iterator[str]:
    """Sentences on the best receiver and the others, beginning with those that assume nothing.

    Receivers that are surely better than the one with the smallest median come first.
    """
    rows = [row for row in rows_of(it, place, it.response) if row.one == best]
    better, equal, open_, worse = (
        [row for row in rows if row.verdict == word]
        for word in ("better", "equal", "undecided", "worse")
    )
    for row in map(_turned, worse):
        yield f"{row.one} is better than {best}."
        yield _sure(it, row, "")
        yield from _though(it, place, row.one, [best])
    if better:
        names = [row.other for row in better]
        yield f"{best} is better than {_all_or(names, rows)}."
        closest = min(better, key=lambda row: row.share_low)
        yield _sure(it, closest, f"than {closest.other}, the closest, " if len(better) > 1 else "")
        yield from _though(it, place, best, names)
    if equal:
        within = measured(float(it.settings["practical"]), unit_of(it.response))
        names = [row.other for row in equal]
        yield f"{best} and {_some(names)} are equal within {within} in the median."
    if open_:
        needed = [row.runs_needed for row in open_]
        about = (
            f"; {would_decide(max(needed))}{' all of it' if len(open_) > 1 else ''}"
            if all(map(pd.notna, needed)) else ""
        )
        yield (
            f"Whether {best} is better than {_some([row.other for row in open_])} is undecided "
            f"after {open_[0].runs} runs{about}."
        )


def _turned(row: Any) -> Any:
    """The difference of the second receiver minus the first, which is worse."""
    return row._replace(
        one=row.other, other=row.one, wins=row.losses, losses=row.wins, verdict="better",
        median=-row.median, low=-row.high, high=-row.low,
        mean=-row.mean, mean_low=-row.mean_high, mean_high=-row.mean_low,
    )  # fmt: skip


def _all_or(names: Sequence[str], rows: Sequence[Any]) -> str:
    return "all others" if len(names) == len(rows) > 1 else _some(names)


def _sure(it: Tournament, row: Any, whom: str) -> str:
    """The share of dives in which it is better, then the median and the mean."""
    unit = unit_of(it.response)
    several = (it.differences["response"] == it.response).sum() > 1
    level, at_once = 100 * (1 - ALPHA), ", all pairs at once" if several else ""
    alike = f" (worse in {row.losses})" if row.runs > row.wins + row.losses else ""
    text = (
        f"It is better {whom}in {row.wins} of {row.runs} runs{alike}: in at least "
        f"{percent_at_least(row.share_low)} of dives ({level:.0f} % confidence{at_once})"
    )
    if isfinite(row.median):
        within = "" if isnan(row.low) or row.low == row.high == 0 else (
            f" ({interval(-row.high, -row.low, unit=unit)})")
        less = f"{measured(-row.median, unit)} less" if row.median else "no difference"
        text += f"; {less} in the median{within}"
    if isfinite(row.mean_low):
        text += (
            f", but {measured(row.mean, unit)} more on average "
            f"({interval(row.mean_low, row.mean_high, unit=unit)})" if row.mean > 0 else
            f", {measured(-row.mean, unit)} {'on' if row.median else 'less on'} average "
            f"({interval(-row.mean_high, -row.mean_low, unit=unit)})"
        )
    return f"{text}."


def _dives(row: Any) -> str:
    """Bound of the share of dives in which the first one is better."""
    if isnan(row.share_low):
        return "–"
    return f"≥ {percent_at_least(row.share_low)}" if row.wins > row.losses else (
        f"≤ {percent_at_most(1 - row.share_low)}")


def _though(it: Tournament, place: str, best: str, others: Sequence[str]) -> Iterator[str]:
    """What the share of dives hides: the better receiver is lost, or misleading, or fails, more
    often."""
    mine = it.level(place, best)
    scenarios = len(it.places) - 1 if place == ALL else 1
    for what, said, runs in (("lost", "it was lost", scenarios * mine["runs"]),
                             ("misleading", "it was misleading", mine["misleading_known"]),
                             ("failed", "it failed", mine["runs"])):  # fmt: skip
        counts = [n for name in others if pd.notna(n := it.level(place, name)[what])]
        if pd.notna(mine[what]) and counts and mine[what] > min(counts):
            yield f"But {said} in {mine[what]} of {runs} runs."


def _exceptions(it: Tournament) -> Iterator[str]:
    """Places where a receiver is surely better than one with a smaller median over all."""
    for place in it.places:
        found = [
            row for row in rows_of(it, place, it.response)
            if row.verdict == "worse" and (len(it.places) > 1 or row.one != it.receivers[0])
        ]  # fmt: skip
        if found and place != ALL:
            pairs = [f"{row.other} is better than {row.one}" for row in found]
            yield f"In {place}, {_some(pairs)}."


# --- Remarks -------------------------------------------------------------------------------------


def notes(it: Tournament, verbose: bool = True) -> Iterator[str]:
    """Remarks beside the answer: lost and failed runs, tails, too few runs.

    Parameters
    ----------
    verbose
        Whether to include those on means and intervals, which only a verbose text prints.
    """
    for place in (place for place in it.places if place != ALL):
        for receiver in in_place(it, place):
            yield from beside(it, place, receiver)
            if verbose:
                yield from lost(it, place, receiver)
        for row in rows_of(it, place, it.response):
            pair = (row.one, row.other) if row.verdict == "better" else (row.other, row.one)
            sign = {"better": 1, "worse": -1}.get(row.verdict, 0)
            if sign * row.mean > 0:
                yield (
                    f"{place}: {pair[0]} is better than {pair[1]} in most runs, but its mean over "
                    f"the runs is {measured(abs(row.mean), unit_of(it.response))} more"
                )
    yield from start(it)
    yield from _too_few(it)
    if verbose:
        yield from _too_few_for_differences(it)
        yield from unbounded_means(it)
        yield from unbounded(it)


def start(it: Tournament) -> Iterator[str]:
    """Where receivers begin with different knowledge."""
    there = {place: in_place(it, place) for place in it.places if place != ALL}
    yield from starts.sentences(it.settings.get("knowing_start", {}), there)
    if it.settings.get("same_start"):
        yield "same start: no receiver is told where the diver is; all begin with what they receive"


def beside(it: Tournament, place: str, receiver: str) -> Iterator[str]:
    """Remarks on the RMS or the mean of a receiver: failed runs, a heavy tail."""
    row = it.level(place, receiver)
    if row["failed"]:
        yield (
            f"{place}: {receiver} failed in {row['failed']} of {row['runs']} runs, which "
            f"count as worse than any other{_example(it, place, receiver)}"
        )
    if row["heavy_tailed"]:
        yield _tail(place, receiver, row, unit_of(it.response))


def lost(it: Tournament, place: str, receiver: str) -> Iterator[str]:
    """How often a receiver was lost, with the interval of the share."""
    row = it.level(place, receiver)
    if row["lost"]:
        low, high = (rough_percent(row[f"lost_{end}"]) for end in ("low", "high"))
        yield (
            f"{place}: {receiver} was lost in {row['lost']} of {row['runs']} runs, "
            f"{low.removesuffix(' %')} to {high} of "
            "all with 95 % confidence"
        )


def _example(it: Tournament, place: str, receiver: str) -> str:
    """A run in which a receiver failed, with its own message if that was kept."""
    mine = it.table[(it.table["scenario"] == place) & it.table[f"{receiver}.{it.response}"].isna()]
    own = mine[mine["error"].astype(str).str.contains(rf"\b{re.escape(receiver)}\b")]
    first = (own if len(own) else mine).iloc[0]
    return f", e.g. with seed {first['seed']}" + (f": {first['error']}" if len(own) else "")


def _tail(place: str, receiver: str, row: Any, unit: str) -> str:
    median, mean = measured(row["median"], unit), measured(row["mean"], unit)
    return (
        f"{place}: {receiver} is heavy-tailed: the worst {row['tail_runs']} of {row['runs']} runs "
        f"make {percent(row['tail'], '.0f')} of the spread about the median, {median}; the mean is "
        f"{mean}"
    )


def _too_few(it: Tournament) -> Iterator[str]:
    runs = int(it.settings["runs"])
    if len(it.differences):
        least = int(it.differences["least"].max())
        if runs < least:
            yield f"no verdict from {runs} runs: {least} are needed, {least - runs} more"


def _too_few_for_differences(it: Tournament) -> Iterator[str]:
    runs = int(it.settings["runs"])
    if len(it.differences):
        least = int(it.differences["mean_least"].max())
        if runs < least:
            yield (
                f"no interval of a mean difference from {runs} runs: {least} are needed, "
                f"{least - runs} more"
            )


def unbounded_means(it: Tournament) -> Iterator[str]:
    """Missing intervals of means, for which each receiver has too few runs."""
    runs = int(it.settings["runs"])
    least = least_runs(it.settings["contamination"], ALPHA / 2)
    if runs < least:
        yield f"no interval of a mean from {runs} runs: {least} are needed, {least - runs} more"


def unbounded(it: Tournament) -> Iterator[str]:
    """A missing bound over the runs, for which each receiver has too few."""
    runs = int(it.settings["runs"])
    least = least_runs(1 - SHARE, ALPHA)
    if runs < least:
        yield (
            f"no bound for {percent(SHARE)} of the runs from {runs}: {least} are needed, "
            f"{least - runs} more"
        )


# --- Tables --------------------------------------------------------------------------------------


def text(it: Tournament, verbose: bool = False, width: int | None = None) -> str:
    """The answer, the remarks, a table of the receivers, and one of the differences.

    Parameters
    ----------
    verbose
        Add the spread and a bound over the runs, verdicts on covariances, times of an update,
        intervals of shares, mean differences, both tables for each of several scenarios, and
        explanations.
    width
        Columns of the terminal; None: sentences are not wrapped.
    """
    lines = [it.answer, *notes(it, verbose)]
    places = sorted(it.places, key=lambda place: place != ALL)
    for place in places if verbose else places[:1]:
        lines += ["", f"{place}: {it.settings['runs']} runs"]
        lines += levels(it, place, width, verbose=verbose)
        if verbose:
            lines += ["", *spreads(it, place, width)]
            lines += [
                f"  {name}: {COVARIANCES[_frame(it)]} "
                f"{it.level(place, name)['covariance_words']}"
                for name in in_place(it, place) if it.level(place, name)["nees_runs"]
            ]  # fmt: skip
        responses = dict.fromkeys((it.response, PERCENTILE)) if verbose else (it.response,)
        if not verbose and len(places) > 1:
            lines += ["", *_by_scenario(it, places[1:], width)]
        for response in responses:
            rows = [*_differences(it, place, response, verbose)]
            if rows:
                unit = f" [{unit_of(response)}]" if unit_of(response) else ""
                of = f" of {words_of(response)}" if verbose else ""
                head = (
                    f"difference{of}{unit}", "better in", "of dives", "median", "95 %, all at once",
                    "mean", "95 %, all at once", "the first is",
                )  # fmt: skip
                without = () if verbose else (5, 6)
                lines += ["", *_table(rows, width, head, range(1, 7), (2, 4, 6), without)]
    explained = _NOTES if verbose else (LOST,) if it.levels["lost"].any() else ()
    lines += ["", *explained] if explained else []
    return fitted("\n".join(lines), width)


def _frame(it: Tournament) -> str:
    return "own_relative" if it.response.startswith("own_relative") else "absolute"


def _heads(it: Tournament) -> tuple[str, ...]:
    unit = f" [{unit_of(it.response)}]" if unit_of(it.response) else ""
    update = ("update",) if it.update_s else ()
    return ("", _first(it), "95 % in a run [m]", f"95 % of runs{unit}", "lost", "misleading",
            "covariance", *update)  # fmt: skip


def _first(it: Tournament) -> str:
    """The receivers' value, for the heading of a column."""
    unit = f" [{unit_of(it.response)}]" if unit_of(it.response) else ""
    return f"{words_of(it.response).removesuffix(' total error')}{unit}"


_BOUND_COLUMN, MISLEADING_COLUMN, _UPDATE_COLUMN = 3, 5, 7
"""Indices of columns in the table of receivers: bound, misleading runs, time of an update."""


def levels(
    it: Tournament, place: str, width: int | None, without: Sequence[int] = (), *,
    verbose: bool = True,
) -> Iterator[str]:
    """The lines of the table of receivers.

    Parameters
    ----------
    without
        Indices of columns to leave out.
    verbose
        Whether to include the bound over the runs, times of an update, and intervals of shares.
    """
    optional = (_BOUND_COLUMN, MISLEADING_COLUMN)
    without = without if verbose else (*without, _BOUND_COLUMN, _UPDATE_COLUMN)
    rows = [*_levels(it, place, verbose)]
    return _table(rows, width, _heads(it), range(1, 5), optional, without)


def _by_scenario(it: Tournament, places: Sequence[str], width: int | None) -> Iterator[str]:
    """The receivers' values in each scenario."""
    rows = [
        [receiver, *(
            rounded(reached(it.level(place, receiver))) if receiver in in_place(it, place) else "–"
            for place in places
        )]
        for receiver in it.receivers
    ]  # fmt: skip
    return table(rows, width, [_first(it), *places], range(1, len(places) + 1))


def spreads(it: Tournament, place: str, width: int | None) -> Iterator[str]:
    """The lines of the table of the spread over the runs."""
    head = (f"{_first(it)} of each run", *_SPREADS)
    return _table([*_spreads(it, place)], width, head, range(1, 7), (5, 6))


def _table(
    rows: Sequence[Sequence[str]],
    width: int | None,
    head: Sequence[str],
    right: Sequence[int],
    optional: Sequence[int],
    without: Sequence[int] = (),
) -> Iterator[str]:
    """A table without some columns and without empty optional ones."""
    empty = [i for i in optional if all(row[i] == "–" for row in rows)]
    kept = [i for i in range(len(head)) if i not in (*without, *empty)]
    return table(
        [[row[i] for i in kept] for row in rows], width, [head[i] for i in kept],
        [n for n, i in enumerate(kept) if i in right],
    )  # fmt: skip


def _levels(it: Tournament, place: str, verbose: bool) -> Iterator[tuple[str, ...]]:
    for receiver in in_place(it, place):
        row, beside = it.level(place, receiver), it.level(place, receiver, PERCENTILE)
        upper = row["within_upper"]
        whole = row["runs"] * (len(it.places) - 1 if place == ALL else 1)
        yield (
            receiver,
            rounded(reached(row)),
            rounded(beside["mean"]),
            f"≤ {rounded(upper)}" if isfinite(upper) else "–",
            rough_percent(row["lost"] / whole),
            _misleading(row, verbose),
            _covariance(row),
            *((_update(it, place, receiver),) if it.update_s else ()),
        )


def _misleading(row: Any, verbose: bool) -> str:
    """The share of misleading runs; verbose and within a scenario its interval, whole per cents."""
    if not row["misleading_known"]:
        return "–"
    said = rough_percent(row["misleading"] / row["misleading_known"])
    told = verbose and not isnan(row["misleading_low"])
    return f"{said} ({share_of_misleading(row)})" if told else said


def share_of_misleading(row: Any) -> str:
    """The interval of the share of misleading runs in a scenario, in whole per cents."""
    return interval_percent(row["misleading_low"], row["misleading_high"])


def _covariance(row: Any) -> str:
    if not row["nees_runs"]:
        return "none"
    if row["covariance"] in ("optimistic", "pessimistic"):
        factor = row["covariance_factor"]
        return f"{row['covariance']} ×{max(factor, 1 / factor):.3g}"
    if row["covariance"] == "unknown" and str(row["covariance_words"]).startswith("not judged"):
        return "not judged"
    return str(row["covariance"])


_TIMES = ((1.0, "s"), (1e3, "ms"), (1e6, "µs"), (1e9, "ns"))


def _update(it: Tournament, place: str, receiver: str) -> str:
    told = [
        mine.get(receiver) for name, mine in it.update_s.items() if place in (name, ALL)
    ]
    known = [seconds for seconds in told if seconds is not None]
    if not known or len(known) < len(told):
        return "–"
    mean = sum(known) / len(known)
    factor, unit = next((f, u) for f, u in _TIMES if mean * f >= 1 or u == "ns")
    return f"~ {rounded(mean * factor, 2)} {unit}"


_SPREADS = ("std", "least", "median", "most", "mean, 95 % interval", "lost, 95 % interval")


def _spreads(it: Tournament, place: str) -> Iterator[tuple[str, ...]]:
    for receiver in in_place(it, place):
        row = it.level(place, receiver)
        yield (
            receiver,
            *(rounded(row[name]) for name in ("std", "least", "median", "most")),
            interval(row["low"], row["high"]),
            interval(100 * row["lost_low"], 100 * row["lost_high"], unit="%"),
        )


def would_decide(runs: int) -> str:
    """How many runs would decide, if it is worth saying."""
    if runs > PRACTICAL_RUNS:
        return f"no practical number of runs ({PRACTICAL_RUNS:,}) would decide"
    return f"about {runs:,} runs would decide"


def _differences(
    it: Tournament, place: str, response: str, verbose: bool
) -> Iterator[tuple[str, ...]]:
    for row in rows_of(it, place, response):
        said = row.verdict
        # The runs that any verdict needs are given once, for all pairs.
        own = pd.notna(row.runs_needed) and (row.runs >= row.least or row.runs_needed > row.least)
        if verbose and said == "undecided" and own:
            said += f"; {would_decide(row.runs_needed)}"
        yield (
            f"{row.one} − {row.other}", f"{row.wins} of {row.runs}", _dives(row),
            rounded(row.median), interval(row.low, row.high),
            rounded(row.mean), interval(row.mean_low, row.mean_high), said,
        )  # fmt: skip

"""The paper's numbers beside ours, as tables for the report and for the gallery (`beside`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import pandas as pd
from sblcosim.models.platform.beaufort import LEVELS

from ...analysis.two_level.analysis import Factorial
from ...analysis.two_level.ranking import ranking
from ...errors import ConfigurationError, check_choice
from ...judge.definitions import AXES
from ...scenario.scenario import load as load_scenario
from ...study.design import INTERACTION_SIGN
from ...words.numbers import interval, number, rounded, signed
from ...words.shares import percent
from ..page import PageTable
from .campaigns import SEAS
from .numbers import (
    TOTAL,
    average,
    facts,
    facts_of_errors,
    facts_of_figure,
    overall,
    pooled,
    pooled_intervals,
)

NEAR = 0.10
"""Relative difference up to which numbers agree."""
HEAD = ("Quantity", "Paper", "Ours", "95 % interval", "Ratio", "Ours is")
Row = tuple[str, ...]


def verdict(ratio: float) -> str:
    """Whether two numbers agree, in a word or two."""
    if abs(ratio - 1) < 1e-9:
        return "equal"
    if abs(ratio - 1) <= NEAR:
        return f"within {percent(NEAR, '.0f')}"
    if ratio > 2:
        return f"{ratio:.2g} times the paper's"
    return f"{percent(abs(ratio - 1), '.0f')} {'above' if ratio > 1 else 'below'}"


def row(what: str, theirs: float, ours: float, interval: str = "–") -> Row:
    """A row of `compared`: a number of the paper and ours."""
    ratio = ours / theirs
    agrees = verdict(ratio)
    shown = number(ours) if agrees == "equal" else rounded(ours)
    return what, number(theirs), shown, interval, f"{ratio:.2f}", agrees


def row_with_interval(what: str, theirs: float, ours: tuple[float, float, float]) -> Row:
    """Like `row`, with an interval; ours is a mean and its interval."""
    mean, low, high = ours
    return row(what, theirs, mean, interval(low, high))


def compared(caption: str, rows: Sequence[Row], note: str = "") -> PageTable:
    """A table of the paper's numbers and ours, without intervals if there are none."""
    head: Sequence[str] = HEAD
    if all(cells[3] == "–" for cells in rows):
        rows, head = [(*cells[:3], *cells[4:]) for cells in rows], (*HEAD[:3], *HEAD[4:])
    return PageTable(caption, head, rows, (len(head) - 1,), note)


# --- Settings ------------------------------------------------------------------------------------


def _of_seas() -> dict[str, float]:
    named = dict(zip("ab", SEAS, strict=True))
    heights = {f"wave height of ({word}) [m]": LEVELS[b].wave_height for word, b in named.items()}
    return heights | {f"Beaufort number of ({word})": b for word, b in named.items()}


def _of_session() -> dict[str, float]:
    scenario = load_scenario("harbour-square")
    return {
        "depth of the receiver [m]": scenario.target.depth_start_m,
        "packet loss [%]": 100 * scenario.acoustics.loss_probability,
        "speed of sound [m/s]": scenario.acoustics.sound_speed_m_s,
    }


def _of_path() -> dict[str, float]:
    return {"radius [m]": load_scenario("paper-scenario-1").target.radius_m}


_SETTINGS: Mapping[int, Callable[[], Mapping[str, float]]] = {
    9: _of_seas, 11: _of_session, 12: _of_path,
}  # fmt: skip
"""Our values of the settings that the paper states, by the number of the figure."""


def stated(number: int) -> list[Row]:
    """A row for each setting that the paper states with a figure."""
    states = facts_of_figure(number).get("states", {})
    ours = _SETTINGS[number]() if states else {}
    return [row(what, float(theirs), ours[what]) for what, theirs in states.items()]


def _settings(number: int) -> PageTable:
    return compared(f"Figure {number}: settings", stated(number))


# --- Errors --------------------------------------------------------------------------------------


def session_rows(
    table: pd.DataFrame, receiver: str, theirs: Sequence[float], what: str, unit: str = ""
) -> list[Row]:
    """Rows of Table 2 for a receiver on a path: mean and standard deviation."""
    return [
        row(f"{what}: {word}{unit}", known, ours, interval(*ends))
        for word, known, ours, ends in zip(
            ("mean", "standard deviation"), theirs, pooled(table, receiver),
            pooled_intervals(table, receiver), strict=True,
        )
    ]


def sessions(tables: Mapping[str, pd.DataFrame]) -> PageTable:
    """The paper's Table 2 and ours, from the runs of each path."""
    rows = []
    for name, runs in tables.items():
        theirs = facts()["table2"][name]
        for label, key, receiver in (("raw fix (j = 1)", "instrument", "multilateration"),
                                     ("EKF (j = 2)", "ekf", "ekf")):
            rows += session_rows(runs, receiver, theirs[key], f"{name}, {label}")
    count = min(map(len, tables.values()))
    return compared(
        "Table 2: total error [m]", rows,
        f"Ours: mean and standard deviation over all samples of {count} sessions each. The "
        "intervals follow from the scatter between sessions. The paper does not say whether the "
        "row j = 1 is the track of its real receiver in the water or a raw fix. Ours is the raw "
        "fix of a simulation. It is smaller, because a simulation lacks what a real channel adds.")


def point_errors(n: int, runs: pd.DataFrame) -> PageTable:
    """A scenario's table of errors and the runs at the favourable point."""
    table, theirs = facts_of_errors(n)
    rows = [
        row_with_interval(f"{_error(axis)} [m]", theirs[axis], average(runs, _column(axis)))
        for axis in (*AXES, "total")
    ]
    relative = average(runs, "ekf.relative_total_rms_m")
    rows.append(row_with_interval(
        "e_tot [m], relative to the platform as it reports itself", theirs["total"], relative))
    ratio = average(runs, f"ekf.{TOTAL}")[0] / theirs["total"]
    note = (
        "This is a consistent reading of the table for Scenario 1, not a proof: the paper does not "
        "say which runs it averages."
    ) if n == 1 else (
        f"The point was chosen for Scenario 1. Here its total error is {ratio:.2f} times that of "
        f"Table {table}: the paper does not give path, speed and filter tuning of this scenario, "
        "and nothing was tuned to the table."
    )  # fmt: skip
    return compared(f"Table {table} and the favourable point, mean of {len(runs)} runs", rows, note)


def errors_of_all(n: int, runs: pd.DataFrame) -> PageTable:
    """A scenario's table of errors and the runs of the whole study."""
    table, theirs = facts_of_errors(n)
    rows = [
        row_with_interval(f"{_error(axis)} [m]", theirs[axis], overall(runs, _column(axis)))
        for axis in (*AXES, "total")
    ]
    fine = runs[runs["gps"] == runs["gps"].min()]
    total = overall(runs, _column("total"))[0]
    return compared(
        f"Table {table} and the mean over all {runs['point'].nunique()} points", rows,
        f"The table is no average over all levels: ours is {total / theirs['total']:.2g} times as "
        f"large, and {overall(fine, _column('total'))[0]:.2g} m even over the half of the points "
        "with the small GPS error. The paper leaves much open. No reading of it that we tried "
        "gives such a small average.")


def _error(axis: str) -> str:
    """The paper's symbol."""
    return "e_tot" if axis == "total" else f"e_{axis}"


def _column(axis: str) -> str:
    return f"ekf.absolute_{axis}_rms_m"


# --- Factors -------------------------------------------------------------------------------------


def order_row(n: int, analysis: Factorial) -> Row:
    """The most influential factors in the paper and in our runs, in words."""
    named = _named(n, analysis)
    ranks = ranking(analysis.readable)
    groups: dict[str, list[str]] = {}
    for name, rank in ranks.items():
        groups.setdefault(rank, []).append(name)
    shown, count = [], 0
    for same in groups.values():
        if count >= len(named):
            break
        shown.append(same[0] if len(same) == 1 else f"({', '.join(same)})")
        count += len(same)
    first = list(ranks)[:count]
    if not set(named) <= set(first):
        missing = ", ".join(name for name in named if name not in first)
        return f"{n}", ", ".join(named), ", ".join(shown), f"differs: {missing} is further down"
    text = "agrees"
    if extra := [name for name in first if name not in named]:
        text += f"; {', '.join(extra)} cannot be told apart from the last of them"
    return f"{n}", ", ".join(named), ", ".join(shown), text


def _named(n: int, analysis: Factorial) -> list[str]:
    """The labels of the factors that the paper names as the most influential."""
    return [analysis.labels[name] for name in facts()["order"][str(n)]["named"]]


def factors(n: int, analysis: Factorial) -> PageTable:
    """The factors that the paper names as the most influential, and our effects."""
    a, named = analysis.readable, _named(n, analysis)
    rows = []
    for name, rank in ranking(a).items():
        effect: Any = a.effects.loc[name]
        rows.append((name, "named" if name in named else "–", rank, signed(effect["effect"]),
                     interval(effect["low"], effect["high"], signed), rounded(abs(effect["t"]))))
    return PageTable(
        "Main effects: factors that the paper names as the most influential, and our effects",
        ("Factor", "Paper", "Our place", "Effect [m]", "95 % interval [m]", "|t|"), rows, (1,),
        f"Verdict: {order_row(n, analysis)[3]}. Where several factors share places, the sizes of "
        "their effects cannot be told apart. The paper prints no sizes.")


def interactions(analysis: Factorial) -> PageTable:
    """The interactions that the paper names in Scenario 3, those of the GPS, and ours."""
    a, gps = analysis.readable, analysis.labels["gps"]
    rows = []
    for name, given in a.ranked().iterrows():
        effect: Any = given
        if effect["order"] == 2 and gps in str(name).split(INTERACTION_SIGN):
            rows.append((str(name), "named", signed(effect["effect"]),
                         interval(effect["low"], effect["high"], signed), rounded(abs(effect["t"])),
                         "significant" if effect["significant"] else "not significant"))
    return PageTable(
        f"Interactions of {gps} with the other factors",
        ("Interaction", "Paper", "Effect [m]", "95 % interval [m]", "|t|", "Ours is"), rows, (1, 5),
        "The paper says that the GPS interacts with the other parameters. It prints no sizes.")


# --- Any of them ---------------------------------------------------------------------------------

_OF_RUNS: Mapping[int, Callable[[pd.DataFrame], PageTable]] = {
    11: lambda runs: sessions({"square": runs}),
    **{figure: partial(point_errors, n) for n, figure in ((1, 14), (2, 21), (3, 27))},
}
_OF_STUDIES: Mapping[int, Callable[[pd.DataFrame], PageTable]] = {
    figure: partial(errors_of_all, n) for n, figure in ((1, 17), (2, 24), (3, 30))
}
_OF_ANALYSES: Mapping[int, Callable[[Factorial], PageTable]] = {
    **{figure: partial(factors, n) for n, figure in ((1, 15), (2, 22), (3, 28))},
    29: interactions,
}
_WAYS: Mapping[str, tuple[Mapping[int, Callable[..., PageTable]], type]] = {
    "left out": (
        {number: partial(_settings, number) for number in _SETTINGS}, type(None)
    ),
    "a table of runs, such as run_many(…).tables['runs']": (_OF_RUNS, pd.DataFrame),
    "a study's table, such as sblcosim.study.table(FOLDER)": (_OF_STUDIES, pd.DataFrame),
    "an analysis, such as sblcosim.analysis.of_study(FOLDER)": (_OF_ANALYSES, Factorial),
}
"""What `beside` takes: in words, for which figures, and its type."""


def beside(number: int, ours: pd.DataFrame | Factorial | None = None) -> PageTable:
    """The paper's numbers at one of its figures beside ours. It prints as a table.

    Parameters
    ----------
    number
        Of the paper's figure.
    ours
        None: the settings that the paper states with Figure 9, 11 or 12. Figures 11, 14, 21 and 27:
        the table of runs, such as ``run_many(…).tables["runs"]``. Figures 15, 22, 28 and 29: the
        analysis of the study. Figures 17, 24 and 30: the table of its runs.

    Raises
    ------
    ConfigurationError
        The paper has no number with the figure, or this is not what is compared with it.
    """
    check_choice("figure", number, sorted({n for figures, _ in _WAYS.values() for n in figures}))
    ways = {words: way for words, way in _WAYS.items() if number in way[0]}
    missing = ""
    for figures, kind in ways.values():
        if isinstance(ours, kind):
            try:
                return figures[number](*([] if ours is None else [ours]))
            except KeyError as error:
                missing = f" without {error}"
    raise ConfigurationError(
        f"ours: must be {' or '.join(ways)}, for Figure {number}, got "
        f"{'nothing' if ours is None else f'a {type(ours).__name__}'}{missing}"
    )

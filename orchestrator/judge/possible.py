"""What was possible in a run, next to what its receivers achieved: in lines and in figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..data.description import RunDescription
    from ..data.estimates import Integers
    from ..data.record import Record
    from ..limits.verdict import Limits, Possible
    from ..style import Theme

_NOTES = {
    "bound": (
        "Bound: the posterior Cramér-Rao bound for what had been received by then. No filter can "
        "be better on average over runs, given the stated priors; a single run may be lucky."
    ),
    "reference": (
        "Reference: the posterior Cramér-Rao recursion for what had been received by then, with "
        "q = {q:.2g} m²/s³ from this path. A given path is not drawn from a model, so this is a "
        "yardstick, not a bound."
    ),
}
_WITHOUT = (
    "Without: nonzero keys of [platform] whose errors neither bound nor reference includes; with "
    "them less is possible."
)
_COVARIANCE = {"absolute": "absolute", "own_relative": "relative"}
"""Frames of errors, and the matching covariance of `Limits`."""
FILL_ALPHA = 0.1


def limits_of(
    description: RunDescription, record: Record, epochs_ns: Mapping[str, Integers]
) -> Limits | None:
    """What was possible in a run; None unless all its surroundings are our own.

    Parameters
    ----------
    epochs_ns
        Epochs of each receiver's estimates [ns].
    """
    from ..limits.run import of_run  # slow to import, and drawing alone does not need it

    at = np.concatenate([np.zeros(0, np.int64), *epochs_ns.values()])
    return of_run(record, description.scenario, description.fmus, at)


def verdicts(
    limits: Limits | None, epochs_ns: Mapping[str, Integers]
) -> dict[str, Possible]:
    """What was possible at the epochs of each receiver's estimates."""
    if limits is None:
        return {}
    every = {name: limits.verdict(epochs) for name, epochs in epochs_ns.items()}
    return {name: verdict for name, verdict in every.items() if verdict is not None}


def lines(possible: Mapping[str, Possible]) -> Iterator[str]:
    """What was possible, with receivers grouped if it is the same for them."""
    whose: dict[str, list[str]] = {}
    for name, verdict in possible.items():
        whose.setdefault(str(verdict), []).append(name)
    for said, names in whose.items():
        yield said if len(whose) == 1 else f"{said} at the epochs of {', '.join(names)}"
    caveats = [it.caveat for it in possible.values() if it.caveat]
    yield from caveats[:1]  # of other epochs it is much the same


def notes(possible: Mapping[str, Possible]) -> list[str]:
    """Explanation of these lines."""
    for verdict in possible.values():
        without = [_WITHOUT] if verdict.without else []
        return [_NOTES[verdict.kind].format(q=verdict.acceleration_psd), *without]
    return []


def caption(limits: Limits | None, frame: str) -> str:
    """What `draw` leaves out and what matters, for a title; empty if there is nothing to say."""
    from ..limits.unknown import brief

    found = None if limits is None or frame not in _COVARIANCE else limits.verdict()
    return "" if limits is None or found is None else brief(found.matters, limits.kind)


def draw(
    axes: Sequence[Axes], limits: Limits | None, frame: str, since_s: float, look: Theme
) -> None:
    """±2σ for north, east and down, and √trace for the total, behind everything else; no ring.

    Parameters
    ----------
    since_s
        Epoch of the first estimate [s]: before it there is nothing to compare with.
    """
    if limits is None or frame not in _COVARIANCE:
        return
    t = limits.epoch_ns / 1e9
    shown = t >= since_s
    if shown.sum() < 2:
        return  # a single epoch has no band
    P = getattr(limits, _COVARIANCE[frame])[shown]
    variances = np.fmax(np.diagonal(P, axis1=1, axis2=2), 0)
    variances[limits.ring[shown]] = np.nan
    bands = [(-2 * np.sqrt(v), 2 * np.sqrt(v)) for v in variances.T]
    bands.append((np.zeros(len(P)), np.sqrt(variances.sum(axis=1))))
    name = f"{limits.kind}: ±2σ, RMS"
    for ax, (low, high) in zip(axes, bands, strict=True):
        ax.fill_between(t[shown], low, high, color=look.soft, alpha=FILL_ALPHA, lw=0, zorder=0.5,
                        label=name)
        for edge in (low, high) if ax is not axes[-1] else (high,):
            ax.plot(t[shown], edge, color=look.soft, lw=0.9, ls=(0, (1, 1)), zorder=3, label=name)

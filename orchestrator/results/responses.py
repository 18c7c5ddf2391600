"""Responses: the numbers that a study records of each run.

The shipped responses are in `RESPONSES`, each with its definition in Python. Most come from sums
that the lanes master computes during a run (`sblcosim.results.sums`); tests keep both in agreement.
A user's own function can be a response too::

    def worst_after_a_minute_m(run):
        late = run.used.epoch_s > 60.0
        return np.sqrt(run.used.square[late]).max()

``sblcosim.study.load(source, responses=[worst_after_a_minute_m])``, or in a study file
``responses = ["mine.py:worst_after_a_minute_m"]``. Its column has the function's name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from types import MappingProxyType
from typing import Any

import cloudpickle
import numpy as np
from numpy.typing import NDArray

from ..data.record import Record
from ..errors import ConfigurationError, instance, shortened
from ..judge.definitions import (
    AXES,
    FRAMES,
    LOST,
    MISLEADING,
    OWN_PORT,
    PERCENTAGES,
    Judged,
    beyond_claim,
    chosen,
    errors_of,
    inconsistent,
    judge,
    length_squares,
    misleading,
    order_statistics,
    percentile_column,
    times_standing,
)
from ..judge.metrics import availability, lost
from ..shown import Shown
from ..simulation.code.user_code import InFile, by_value, foreseen, said
from ..simulation.masters.lanes_driver import LENGTHS
from .more import rows

Floats = NDArray[np.float64]

ORDER_STATISTIC = (
    "A percentile p is an order statistic: of n errors, or n runs, the one of rank p n / 100, "
    "rounded up."
)
"""What a percentile is, for people."""
ALL_PERCENTILES = "percentiles"
"""In a study file: all percentiles."""


@dataclass(frozen=True, eq=False, repr=False)
class Run(Shown):
    """One receiver in one run: the argument of a response.

    Attributes
    ----------
    record
        Outputs by ``"component.variable"``: the truth (`definitions.TRUTH`) and the receiver's
        ports, at all communication instants.
    receiver
        Label of the receiver.
    settling_ns
        Errors count from this time after the start [ns].
    """

    record: Record
    receiver: str
    settling_ns: int = 0

    @cached_property
    def judged(self) -> Judged:
        """All estimates, with the truth."""
        return judge(self.record, self.receiver)

    @cached_property
    def used(self) -> Judged:
        """The estimates that count: after the settling time and not broken."""
        after = float(self.record.time_ns[0] + self.settling_ns) / 1e9
        return chosen(self.judged, ~self.judged.broken & (after <= self.judged.epoch_s))


class Response:
    """A definition that gives one number per run and receiver.

    Attributes
    ----------
    name
        Second part of the column name, after the receiver. A suffix ``_m`` or ``_s`` is its unit.
    words
        Description to display.
    definition
        Function of a `Run`; NaN where the number does not exist.
    shipped
        Whether it is one of `RESPONSES`.
    needs
        Optional output of the receiver that it needs, or an empty string.
    origin, sha256
        For a user's function: its origin, and the hash of its source.
    """

    # Not a dataclass: pydantic would convert it when a study holds it.
    def __init__(
        self,
        name: str,
        words: str,
        definition: Callable[[Run], Any],
        shipped: bool = True,
        *,
        needs: str = "",
        origin: str = "",
        sha256: str = "",
    ) -> None:
        self.name, self.words, self.definition = name, words, definition
        self.shipped, self.needs = shipped, needs
        self.origin, self.sha256 = origin, sha256

    @property
    def in_lanes(self) -> bool:
        """Whether the lanes master computes it, so that it needs no record."""
        return False

    @property
    def unit(self) -> str:
        """Unit, or an empty string."""
        return unit_of(self.name)

    def __reduce__(self) -> Any:
        if self.shipped:
            return _of_name, (self.name,)
        if isinstance(self.definition, InFile):
            return _of_file, (self.definition, self.name, self.origin, self.sha256)
        # By value: a worker may lack both the file and the module.
        return _unpacked, (by_value(self.definition), self.name, self.origin, self.sha256)

    def __repr__(self) -> str:
        return f"<response {self.name}{f' from {self.origin}' if self.origin else ''}>"


class Percentile(Response):
    """An order statistic of the lengths of a run's errors.

    Attributes
    ----------
    length
        ``FRAME_horizontal`` or ``FRAME_total``; the lanes master has those in `LENGTHS`.
    percentage
        1 to 100.
    """

    def __init__(self, length: str, percentage: int) -> None:
        frame, _, what = length.rpartition("_")
        words = (
            f"{what} error's {percentage}th percentile" if percentage < 100
            else f"largest {what} error"
        )
        super().__init__(
            f"{length}_{percentile_column(percentage)}", f"{words}{_BESIDE[frame]} in a run",
            partial(_percentile, length, percentage),
            needs=OWN_PORT if frame == "own_relative" else "",
        )
        self.length, self.percentage = length, percentage

    @property
    def in_lanes(self) -> bool:
        return self.length in LENGTHS

    def __reduce__(self) -> Any:
        return Percentile, (self.length, self.percentage)


_SIGNED = ("_x_mean_m", "_y_mean_m", "_z_mean_m")
"""Suffixes of responses that can be negative."""
FLAGS = ("inconsistent", "lost", "broken", "misleading")
"""Responses that are 0 or 1."""
_OF_NONE = (*FLAGS, "beyond_claim", "beyond_claim_longest_s")
"""Responses whose best value is 0, which runs often have."""


def check_limit(where: str, limit: float, response: str) -> None:
    """Refuse a limit that no run could keep.

    Parameters
    ----------
    where
        Beginning of the message.
    response
        Name of a response. Nothing is known of one that is not in `RESPONSES`.

    Raises
    ------
    ConfigurationError
        The response is always larger.
    """
    if response not in RESPONSES or response.endswith(_SIGNED):
        return
    words, unit = RESPONSES[response].words, unit_of(response)
    if limit < 0 or (limit == 0 and response not in _OF_NONE):
        least = "at least 0" if response in _OF_NONE else f"more than 0{unit and f' {unit}'}"
        raise ConfigurationError(
            f"{where}: must be {least}, as the {words} always is, got {limit:g}"
        )


def unit_of(column: str) -> str:
    """Unit of a response, from its name."""
    return next((unit for unit in ("m", "s") if column.endswith(f"_{unit}")), "")


# --- Shipped responses ---------------------------------------------------------------------------


def _mean(values: Floats) -> float:
    return float(values.mean()) if len(values) else float("nan")


def _errors(frame: str, run: Run) -> tuple[Floats, Floats]:
    """Errors by axis [m], and their squared lengths [m²]; empty if it has none."""
    return errors_of(run.used).get(frame, (np.empty((0, 3)), np.empty(0)))


def _axis_mean(frame: str, axis: int, run: Run) -> float:
    return _mean(_errors(frame, run)[0][:, axis])


def _axis_rms(frame: str, axis: int, run: Run) -> float:
    return float(np.sqrt(_mean(_errors(frame, run)[0][:, axis] ** 2)))


def _total_mean(frame: str, run: Run) -> float:
    return _mean(np.sqrt(_errors(frame, run)[1]))


def _total_rms(frame: str, run: Run) -> float:
    return float(np.sqrt(_mean(_errors(frame, run)[1])))


def _percentile(length: str, percentage: int, run: Run) -> float:
    squares = length_squares(run.used).get(length, np.empty(0))
    return float(order_statistics(np.sqrt(squares), (percentage,))[0])


def _nees(run: Run) -> Floats:
    return run.used.nees[~np.isnan(run.used.nees)]


def _own_nees(run: Run) -> Floats:
    claims = run.used.own_relative_nees
    return np.empty(0) if claims is None else claims[~np.isnan(claims)]


def _nis(run: Run) -> tuple[Floats, Floats]:
    """NIS and degrees of freedom of the estimates with measurements."""
    estimates = run.used.estimates
    if estimates.nis is None:
        return np.empty(0), np.empty(0)
    tested = ~np.isnan(estimates.nis)
    if estimates.nis_degrees is None:
        return estimates.nis[tested], np.empty(0)
    tested &= estimates.nis_degrees > 0
    return estimates.nis[tested], estimates.nis_degrees[tested].astype(np.float64)


def _inconsistent(run: Run) -> float:
    claims = _nees(run)
    flag, known = inconsistent(_mean(claims), len(claims))
    return float(flag) if known else float("nan")


def _times_beyond(run: Run) -> tuple[float, float]:
    """Share of the time beyond the claim, and the longest such time [s]; NaN without any NEES."""
    used, time_ns = run.used, run.record.time_ns
    if not len(_nees(run)):
        return float("nan"), float("nan")
    beyond, longest = times_standing(used, beyond_claim(used))
    whole = int(time_ns[-1] - time_ns[0]) - run.settling_ns
    return beyond / whole if whole > 0 else float("nan"), longest / 1e9


def _misleading(run: Run) -> float:
    claims = _nees(run)
    flag = misleading(_mean(claims), _total_rms("absolute", run), _times_beyond(run)[1])
    return float(flag) if len(claims) else float("nan")


def _updates(run: Run) -> float:
    return float(run.record.values[f"{run.receiver}.update_count"][-1])


def _available(run: Run) -> float:
    return availability(run.record.time_ns, run.record.valid(run.receiver))


def _shipped() -> Iterator[Response]:
    yield Response("estimates", "estimates", lambda run: len(run.used.epoch_s))
    for frame in FRAMES:
        beside, needs = _BESIDE[frame], OWN_PORT if frame == "own_relative" else ""
        for i, axis in enumerate(AXES):
            name = f"{frame}_{axis}"
            text = f"error in {axis}{beside}"
            for what, words, of in (("mean", "mean", _axis_mean), ("rms", "RMS", _axis_rms)):
                yield Response(f"{name}_{what}_m", f"{words} {text}", partial(of, frame, i),
                               needs=needs)
        total = f"{frame}_total"
        for what, words, whole in (("mean", "mean", _total_mean), ("rms", "RMS", _total_rms)):
            yield Response(f"{total}_{what}_m", f"{words} total error{beside}",
                           partial(whole, frame), needs=needs)
    yield Response(
        "nees_position", "NEES of the position", lambda run: _mean(_nees(run)),
        needs="covariance",
    )  # fmt: skip
    yield Response("nees_estimates", "estimates with NEES", lambda run: len(_nees(run)))
    yield Response("nis", "NIS", lambda run: _mean(_nis(run)[0]))
    yield Response("nis_degrees", "degrees of freedom of NIS", lambda run: _nis(run)[1].sum())
    yield Response("availability", "availability", _available)
    yield Response("updates", "updates", _updates)
    yield Response(
        "inconsistent", "share of inconsistent runs", _inconsistent, needs="covariance"
    )
    yield Response("lost", "share of lost runs", lambda run: lost(run.judged))
    yield Response("broken", "share of broken runs", lambda run: run.judged.broken.any())
    yield Response(
        "own_relative_nees_position", f"NEES of the position{_BESIDE['own_relative']}",
        lambda run: _mean(_own_nees(run)), needs="relative_covariance",
    )  # fmt: skip
    yield Response(
        "own_relative_nees_estimates", "estimates with own relative NEES",
        lambda run: len(_own_nees(run)),
    )  # fmt: skip
    yield Response(
        "beyond_claim", "share of the time beyond the claim", lambda run: _times_beyond(run)[0],
        needs="covariance",
    )  # fmt: skip
    yield Response(
        "beyond_claim_longest_s", "longest time beyond the claim without a break",
        lambda run: _times_beyond(run)[1], needs="covariance",
    )  # fmt: skip
    yield Response("misleading", "share of misleading runs", _misleading, needs="covariance")


_BESIDE = {
    "absolute": "",
    "relative": " relative to the platform as it reports itself",
    "own_relative": " relative to the platform's true position",
}
"""What follows the name of an error, by frame."""


def _percentiles(lengths: Iterable[str]) -> Iterator[Response]:
    for length in lengths:
        for p in PERCENTAGES:
            yield Percentile(length, p)


def _defined() -> Iterator[Response]:
    """Responses that need a record: runs with one of them do not use lanes."""
    yield from (Response(*row) for row in rows("RESPONSES"))
    yield from _percentiles(("own_relative_horizontal", "own_relative_total"))


def _registered(responses: Iterable[Response]) -> MappingProxyType[str, Response]:
    named: dict[str, Response] = {}
    for response in responses:
        if response.name in named:
            raise ValueError(f"{response.name}: must be the name of one response, got two")
        named[response.name] = response
    return MappingProxyType(named)


PERCENTILES = _registered(_percentiles(LENGTHS))
"""Order statistics of the lengths of the absolute and relative errors; all masters compute them."""
ON_REQUEST = _registered((*PERCENTILES.values(), *_defined()))
"""Responses that a study records on request."""
RESPONSES = _registered((*_shipped(), *ON_REQUEST.values()))
"""All shipped responses, by name."""


def value_of(response: Response, run: Run) -> float:
    """Evaluate a response of a run.

    Raises
    ------
    ConfigurationError
        The function has raised an exception, or has not returned a number.
    """
    with np.errstate(all="ignore"):
        try:
            value = response.definition(run)
        except ConfigurationError:
            raise
        except foreseen() as error:
            raise ConfigurationError(
                f"{run.receiver}.{response.name}: must not raise an exception, got {said(error)}"
            ) from error
    if isinstance(value, int | float | np.number | np.bool_):
        return float(value)
    raise ConfigurationError(
        f"{run.receiver}.{response.name}: must be a number, got {shortened(instance(value))}"
    )


def readable(name: str) -> str:
    """Turn a name into words, for responses without a description."""
    return name.removesuffix("_m").removesuffix("_s").replace("_", " ")


def defined(column: str) -> list[str]:
    """Definition of a response in sentences for people, where its name is not enough.

    Parameters
    ----------
    column
        Column of a table of runs, with or without a receiver.
    """
    name = column.rpartition(".")[2]
    if isinstance(RESPONSES.get(name), Percentile):
        return [ORDER_STATISTIC]
    return {"lost": [LOST], "misleading": [MISLEADING]}.get(name, [])


def _of_name(name: str) -> Response:
    return RESPONSES[name]


def _of_file(function: InFile, name: str, origin: str, sha256: str) -> Response:
    return Response(name, readable(name), function, False, origin=origin, sha256=sha256)


def _unpacked(packed: bytes, name: str, origin: str, sha256: str) -> Response:
    function = cloudpickle.loads(packed)
    return Response(name, readable(name), function, False, origin=origin, sha256=sha256)

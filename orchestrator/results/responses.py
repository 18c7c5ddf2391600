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

import inspect
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import cloudpickle
import numpy as np
from numpy.typing import NDArray

from ..errors import ConfigurationError, instance, nearest, one_line, quoted, shortened
from ..simulation.masters.lanes_driver import LENGTHS
from ..simulation.record import Record
from ..simulation.user_code import by_value, fingerprint, run_file
from .definitions import (
    AXES,
    FRAMES,
    PERCENTAGES,
    Judged,
    chosen,
    inconsistent,
    judge,
    length_squares,
    order_statistics,
    percentile_column,
)
from .metrics import availability, lost

Floats = NDArray[np.float64]

ALL_PERCENTILES = "percentiles"
"""In a study file: all percentiles."""


@dataclass(frozen=True, eq=False)
class Run:
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
        Description for display.
    definition
        Function of a `Run`; NaN where the number does not exist.
    shipped
        Whether it is one of `RESPONSES`.
    needs_covariance
        Whether it needs a receiver with a covariance output.
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
        needs_covariance: bool = False,
        origin: str = "",
        sha256: str = "",
    ) -> None:
        self.name, self.words, self.definition = name, words, definition
        self.shipped, self.needs_covariance = shipped, needs_covariance
        self.origin, self.sha256 = origin, sha256

    @property
    def unit(self) -> str:
        """Unit, or an empty string."""
        return unit_of(self.name)

    def __reduce__(self) -> Any:
        if self.shipped:
            return _of_name, (self.name,)
        # By value: a worker may have neither the file nor the module.
        return _unpacked, (by_value(self.definition), self.name, self.origin, self.sha256)

    def __repr__(self) -> str:
        return f"<response {self.name}{f' from {self.origin}' if self.origin else ''}>"


def unit_of(column: str) -> str:
    """Unit of a response, from its name."""
    return next((unit for unit in ("m", "s") if column.endswith(f"_{unit}")), "")


# --- Shipped responses ---------------------------------------------------------------------------


def _mean(values: Floats) -> float:
    return float(values.mean()) if len(values) else float("nan")


def _errors(frame: str, run: Run) -> tuple[Floats, Floats]:
    """Errors by axis [m], and their squared lengths [m²]."""
    used = run.used
    if frame == "absolute":
        return used.error, used.square
    return used.relative, used.relative_square


def _axis_mean(frame: str, axis: int, run: Run) -> float:
    return _mean(_errors(frame, run)[0][:, axis])


def _axis_rms(frame: str, axis: int, run: Run) -> float:
    return float(np.sqrt(_mean(_errors(frame, run)[0][:, axis] ** 2)))


def _total_mean(frame: str, run: Run) -> float:
    return _mean(np.sqrt(_errors(frame, run)[1]))


def _total_rms(frame: str, run: Run) -> float:
    return float(np.sqrt(_mean(_errors(frame, run)[1])))


def _percentile(length: str, percentage: int, run: Run) -> float:
    return float(order_statistics(np.sqrt(length_squares(run.used)[length]), (percentage,))[0])


def _nees(run: Run) -> Floats:
    return run.used.nees[~np.isnan(run.used.nees)]


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


def _updates(run: Run) -> float:
    return float(run.record.values[f"{run.receiver}.update_count"][-1])


def _available(run: Run) -> float:
    return availability(run.record.time_ns, run.record.valid(run.receiver))


def _shipped() -> Iterator[Response]:
    yield Response("estimates", "estimates", lambda run: len(run.used.epoch_s))
    for frame in FRAMES:
        beside = " relative to the platform" if frame == "relative" else ""
        for i, axis in enumerate(AXES):
            name = f"{frame}_{axis}"
            text = f"error in {axis}{beside}"
            yield Response(f"{name}_mean_m", f"mean {text}", partial(_axis_mean, frame, i))
            yield Response(f"{name}_rms_m", f"RMS {text}", partial(_axis_rms, frame, i))
        total = f"total error{beside}"
        yield Response(f"{frame}_total_mean_m", f"mean {total}", partial(_total_mean, frame))
        yield Response(f"{frame}_total_rms_m", f"RMS {total}", partial(_total_rms, frame))
    yield Response(
        "nees_position", "NEES of the position", lambda run: _mean(_nees(run)),
        needs_covariance=True,
    )  # fmt: skip
    yield Response("nees_estimates", "estimates with NEES", lambda run: len(_nees(run)))
    yield Response("nis", "NIS", lambda run: _mean(_nis(run)[0]))
    yield Response("nis_degrees", "degrees of freedom of NIS", lambda run: _nis(run)[1].sum())
    yield Response("availability", "availability", _available)
    yield Response("updates", "updates", _updates)
    yield Response(
        "inconsistent", "share of inconsistent runs", _inconsistent, needs_covariance=True
    )
    yield Response("lost", "share of lost runs", lambda run: lost(run.record, run.receiver))
    yield Response("broken", "share of broken runs", lambda run: run.judged.broken.any())


def _percentiles() -> Iterator[Response]:
    for length in LENGTHS:
        frame, _, what = length.partition("_")
        beside = " relative to the platform" if frame == "relative" else ""
        for p in PERCENTAGES:
            words = f"{what} error's {p}th percentile" if p < 100 else f"largest {what} error"
            name = f"{length}_{percentile_column(p)}"
            text = f"{words}{beside} in a run"
            yield Response(name, text, partial(_percentile, length, p))


def _time_to_first_fix(run: Run) -> float:
    epochs = run.judged.epoch_s[~run.judged.broken]
    return float(epochs[0] - run.record.time_ns[0] / 1e9) if len(epochs) else float("nan")


def _defined() -> Iterator[Response]:
    """Responses that need a record: runs with one of them do not go through lanes."""
    yield Response("first_fix_s", "time to the first fix", _time_to_first_fix)


def _registered(responses: Iterable[Response]) -> MappingProxyType[str, Response]:
    named: dict[str, Response] = {}
    for response in responses:
        if response.name in named:
            raise ValueError(f"{response.name}: must be the name of one response, got two")
        named[response.name] = response
    return MappingProxyType(named)


PERCENTILES = _registered(_percentiles())
"""Order statistics of the lengths of the errors; all masters compute them."""
ON_REQUEST = _registered((*PERCENTILES.values(), *_defined()))
"""Responses that a study records on request."""
RESPONSES = _registered((*_shipped(), *ON_REQUEST.values()))
"""All shipped responses, by name."""


# --- The user's own responses --------------------------------------------------------------------


def of_function(function: Callable[[Run], Any]) -> Response:
    """The response that a function is.

    It is known by its source and by all that it refers to: other functions, values, and modules by
    their names.

    Raises
    ------
    ConfigurationError
        It is not a function, has no name or that of a shipped response, or its source is
        unavailable.
    """
    name = _checked_name(getattr(function, "__name__", ""), function)
    sha256 = fingerprint(function, "responses", name)
    origin = f"{function.__module__}:{name}"
    return Response(name, readable(name), function, False, origin=origin, sha256=sha256)


def of_file(text: str, folder: Path) -> Response:
    """Make a response of ``file.py:function``; the file may be relative to a folder.

    It is known by the file, not by what that imports.

    Raises
    ------
    ConfigurationError
        There is no such file or function, or the file cannot be run.
    """
    file, _, name = text.rpartition(":")
    where = f"responses: {quoted(text)}"
    module, sha256 = run_file(folder / file, f"{where} must be FILE.py:FUNCTION, got", where)
    functions = {n: thing for n, thing in vars(module).items() if inspect.isfunction(thing)}
    if name not in functions:
        raise ConfigurationError(
            f"{where} must name a function of {quoted(file)}, got {quoted(name)}"
            f"{nearest(name, functions)}"
        )
    function = functions[name]
    _checked_name(function.__name__, function)
    return Response(name, readable(name), function, False, origin=text, sha256=sha256)


def _checked_name(name: str, function: object) -> str:
    if not callable(function) or not name.isidentifier():
        raise ConfigurationError(
            f"responses: must be names or functions with a name, got {quoted(name)}"
        )
    if name in RESPONSES:
        raise ConfigurationError(f"responses: {name} must not be the name of one that is shipped")
    return name


def of_origin(name: str, origin: str, sha256: str) -> Response:
    """A user's response of which only the name, origin and hash are known."""

    def gone(run: Run) -> float:
        raise ConfigurationError(
            f"responses: {name} must be at hand to do more runs, got none; it is {origin}"
        )

    return Response(name, readable(name), gone, False, origin=origin, sha256=sha256)


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
        except (Exception, SystemExit) as error:
            raise ConfigurationError(
                f"{run.receiver}.{response.name}: must not raise an exception, got "
                f"{type(error).__name__}: {one_line(error)}"
            ) from error
    if isinstance(value, int | float | np.number | np.bool_):
        return float(value)
    raise ConfigurationError(
        f"{run.receiver}.{response.name}: must be a number, got {shortened(instance(value))}"
    )


def readable(name: str) -> str:
    """Turn a name into words, for responses without a description."""
    return name.removesuffix("_m").removesuffix("_s").replace("_", " ")


def _of_name(name: str) -> Response:
    return RESPONSES[name]


def _unpacked(packed: bytes, name: str, origin: str, sha256: str) -> Response:
    function = cloudpickle.loads(packed)
    return Response(name, readable(name), function, False, origin=origin, sha256=sha256)

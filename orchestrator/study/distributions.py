"""Distributions of factors, as study files describe them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, ValidationError

from ..errors import ConfigurationError, check_choice, instance, nearest, quoted, shortened
from ..scenario.messages import requirement
from ..scenario.schema import Table

Floats = NDArray[np.float64]
Kind = Literal["uniform", "log-uniform", "normal", "log-normal", "triangular", "choice"]
_NUMBERS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "uniform": (("range",), ()),
    "log-uniform": (("range",), ()),
    "normal": (("mean", "std"), ("range",)),
    "log-normal": (("median", "factor"), ("range",)),
    "triangular": (("range", "mode"), ()),
    "choice": (("levels",), ("weights",)),
}
"""Required and optional numbers of each distribution."""
_ALL = tuple(dict.fromkeys(name for lists in _NUMBERS.values() for part in lists for name in part))


def _array(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


_Number = Annotated[float, Field(allow_inf_nan=False)]
_NumberArray = Annotated[tuple[_Number, ...], BeforeValidator(_array)]


class Numbers(Table):
    """Numbers of distributions; see `Distribution`."""

    range: _NumberArray | None = Field(default=None, description="Lowest and highest value")
    mean: _Number | None = Field(default=None, description="Mean of a normal distribution")
    std: _Number | None = Field(default=None, description="Standard deviation, if normal")
    median: _Number | None = Field(default=None, description="Median, if log-normal")
    factor: _Number | None = Field(
        default=None, description="68 % of the values are between median/factor and median × factor"
    )
    mode: _Number | None = Field(default=None, description="Mode of a triangular distribution")
    weights: _NumberArray | None = Field(
        default=None, description="Weights of the levels of a choice; default: equal"
    )


class Distribution(Numbers):
    """Distribution of a factor, as in a study file; all numbers in the units of the keys.

    Attributes
    ----------
    distribution
        ``uniform`` and ``log-uniform`` between the ends of `range`; ``normal`` with `mean` and
        `std`; ``log-normal`` with `median` and `factor`; ``triangular`` over `range` with the mode
        `mode`; ``choice`` among `levels`, with probabilities proportional to `weights`.
    range
        Lowest and highest value. A normal or log-normal distribution with a range is truncated to
        it.
    median, factor
        The logarithm is normal: 68 % of the values are between median/factor and median × factor.
    levels
        Numbers or texts (or true and false); without `weights`, all are equally probable.
    """

    distribution: Kind
    levels: Annotated[tuple[Any, ...], BeforeValidator(_array)] | None = None

    def quantiles(self, u: Floats) -> NDArray[Any]:
        """The inverse of the cumulative distribution function.

        Parameters
        ----------
        u
            Probabilities, more than 0 and less than 1; any shape.
        """
        from scipy import stats  # only if something is drawn

        if self.distribution == "choice":
            assert self.levels is not None
            levels = self.levels
            share = np.cumsum(self.weights or np.ones(len(levels)))
            kind = np.object_ if isinstance(levels[0], str) else None
            return np.array(levels, kind)[np.searchsorted(share / share[-1], u, side="right")]
        if self.distribution in ("normal", "log-normal"):
            return self._normal_quantiles(u)
        assert self.range is not None
        low, high = self.range
        if self.distribution == "triangular":
            assert self.mode is not None
            law: Any = stats.triang((self.mode - low) / (high - low), low, high - low)
        elif self.distribution == "log-uniform":
            law = stats.loguniform(low, high)
        else:
            law = stats.uniform(low, high - low)
        # rounding must not leave the range
        return np.clip(np.asarray(law.ppf(u), np.float64), low, high)

    def _normal_quantiles(self, u: Floats) -> Floats:
        from scipy import stats

        logs = self.distribution == "log-normal"
        mean, std = (self.median, self.factor) if logs else (self.mean, self.std)
        assert mean is not None
        assert std is not None
        if logs:
            mean, std = math.log(mean), math.log(std)
        if self.range is None:
            z = stats.norm.ppf(u)
        else:
            ends = [math.log(end) if end > 0 else -math.inf for end in self.range] if logs else [
                *self.range
            ]
            z = stats.truncnorm.ppf(u, *((end - mean) / std for end in ends))
        values = np.asarray(mean + std * z, np.float64)
        if logs:
            with np.errstate(over="ignore"):
                values = np.exp(values)
        return values if self.range is None else np.clip(values, self.range[0], self.range[1])

    @property
    def logarithmic(self) -> bool:
        """Whether it is a distribution of the logarithm."""
        return self.distribution.startswith("log-")


def distribution_of(distribution: Kind, **numbers: Any) -> Distribution:
    """A distribution and its numbers; see `Distribution`.

    Raises
    ------
    ConfigurationError
        There is no such distribution, or a number is missing, wrong or does not belong to it.
    """
    check_choice("distribution", distribution, get_args(Kind))
    known = [name for name in Distribution.model_fields if name != "distribution"]
    for name in numbers:
        if name not in known:
            raise ConfigurationError(
                f"{distribution}: there is no key {quoted(name)}{nearest(name, known)}"
            )
    try:
        made = Distribution(distribution=distribution, **numbers)
    except ValidationError as error:
        first = error.errors()[0]
        raise ConfigurationError(
            f"{first['loc'][0]}: {requirement(first)[0]}, got {shortened(first['input'])}"
        ) from None
    for problem in problems(made):
        raise ConfigurationError(problem)
    return made


# --- Checks --------------------------------------------------------------------------------------


def problems(given: Distribution, names: Sequence[str] = ()) -> Iterator[str]:
    """Errors in a distribution; one line each, most basic first.

    Parameters
    ----------
    names
        Values of a key that is set by name, such as a solver; only a choice can vary it.
    """
    kind = given.distribution
    needed, allowed = _NUMBERS[kind]
    if names and kind != "choice":
        yield (
            f"distribution: must be 'choice' for a key that is one of {_quoted(names)}, got "
            f"{kind!r}"
        )
        return
    has = [name for name in _ALL if getattr(given, name) is not None]
    missing = [name for name in needed if name not in has]
    of = f"'{kind}', which has {' and '.join(needed)}" + "".join(
        f" and perhaps {name}" for name in allowed
    )
    for name in missing:
        yield f"{name}: must be given for the distribution {of}, got nothing"
    for name in has:
        if name not in (*needed, *allowed):
            yield f"{name}: must not be given for the distribution {of}, got it" + nearest(
                name, missing
            )
    if not missing:
        yield from _wrong_numbers(given)
        if kind == "choice":
            yield from _wrong_levels(given, names)


def _wrong_numbers(given: Distribution) -> Iterator[str]:
    """Errors in the numbers of a distribution."""
    if given.range is not None:
        if len(given.range) != 2 or not 0 < given.range[1] - given.range[0] < math.inf:
            yield f"range: must be two numbers, the lower first, got {shortened([*given.range])}"
            return
        if given.distribution == "log-uniform" and given.range[0] <= 0:
            yield f"range: must be above 0 for 'log-uniform', got {shortened([*given.range])}"
        if given.distribution == "log-normal" and given.range[1] <= 0:
            yield f"range: must reach above 0 for 'log-normal', got {shortened([*given.range])}"
        if given.mode is not None and not given.range[0] <= given.mode <= given.range[1]:
            yield f"mode: must be within the range {shortened([*given.range])}, got {given.mode:g}"
    for name, least in (("std", 0.0), ("median", 0.0), ("factor", 1.0)):
        value = getattr(given, name)
        if value is not None and value <= least:
            yield f"{name}: must be more than {least:g}, got {value:g}"


def _wrong_levels(given: Distribution, names: Sequence[str]) -> Iterator[str]:
    """Errors in the levels and weights of a choice."""
    levels = given.levels or ()
    if len(levels) < 2:
        yield f"levels: must be at least two, got {len(levels)}"
    kinds = [float if is_number(level) else type(level) for level in levels]
    if len({*kinds}) > 1:
        yield f"levels: must be all numbers or all texts, got {shortened([*levels])}"
        return
    for level, kind in zip(levels, kinds, strict=True):
        if kind not in (float, str, bool):
            yield f"levels: must be numbers or texts, got {shortened(instance(level))}"
        elif kind is float and not math.isfinite(level):
            yield f"levels: must be finite, got {level}"
        elif levels.count(level) > 1:
            yield f"levels: must differ, got {quoted(level)} {levels.count(level)} times"
        elif names and level not in names:
            yield f"levels: must be among {_quoted(names)}, got {quoted(level)}" + (
                nearest(level, names) if kind is str else ""
            )
        else:
            continue
        return
    if given.weights is not None:
        if len(given.weights) != len(levels):
            yield (
                f"weights: must be as many as the levels, {len(levels)}, got {len(given.weights)}"
            )
        elif min(given.weights) <= 0:
            yield f"weights: must be more than 0, got {min(given.weights):g}"


def _quoted(names: Sequence[str]) -> str:
    return ", ".join(map(quoted, names))


def is_number(level: object) -> bool:
    """Whether a level is a number; true and false are not."""
    return isinstance(level, int | float) and not isinstance(level, bool)

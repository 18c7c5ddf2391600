"""Designs of experiments: the points in factor space, and the order of the runs.

Two-level designs (full, or a regular fraction) with centre points, and sweeps of one factor at a
time; `sblcosim.study.grid` handles designs with any levels. Points are in standard (Yates) order:
the first factor changes fastest. A fraction is defined by generators such as ``E=ABCD``. The
factors are called A, B, C, … in order (without I, which stands for the mean).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, islice, product

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import ConfigurationError, quoted

Number = int | float
Level = Number | str
"""A number, or the name of something that is not one."""
INTERACTION_SIGN = " × "
"""Sign between the factors of an interaction."""
LETTERS = "ABCDEFGHJKLMNOPQRSTUVWXYZ"
MOST_POINTS = 2**16
_MOST_FRACTIONS = 20_000  # candidates compared for a requested resolution


def shown(level: Level) -> str:
    """A level for people."""
    return level if isinstance(level, str) else f"{level:g}"


@dataclass(frozen=True)
class Factor:
    """A quantity that is varied.

    Attributes
    ----------
    levels
        Physical values, or names. With two levels, the first is coded −1 and the second +1.
    """

    name: str
    levels: tuple[Level, ...]

    def __post_init__(self) -> None:
        if len(self.levels) < 2:
            raise ConfigurationError(
                f"factor {self.name}: must have at least two levels, got {len(self.levels)}"
            )
        for level in self.levels:
            if not isinstance(level, str) and not math.isfinite(level):
                raise ConfigurationError(
                    f"factor {self.name}: must have finite levels, got {level}"
                )
        for first, second in combinations(self.levels, 2):
            if first == second:
                raise ConfigurationError(
                    f"factor {self.name}: must have levels that differ, got {first!r} twice"
                )

    @property
    def is_categorical(self) -> bool:
        """Whether any level is not a number."""
        return any(isinstance(level, str) for level in self.levels)

    @property
    def numbers(self) -> tuple[Number, ...]:
        """The levels, if all are numbers.

        Raises
        ------
        ConfigurationError
            A level is not a number.
        """
        for level in self.levels:
            if isinstance(level, str):
                raise ConfigurationError(
                    f"factor {self.name}: must have numbers as levels in this design, got "
                    f"{quoted(level)}; a grid has any (kind = 'grid')"
                )
        return tuple(level for level in self.levels if not isinstance(level, str))

    def coded(self, value: Level) -> float:
        """Code a physical value: the first level is −1 and the last is +1."""
        if value == self.levels[0]:
            return -1.0
        if value == self.levels[-1]:
            return 1.0
        low, *_, high = self.numbers
        return (float(value) - (low + high) / 2) / ((high - low) / 2)


@dataclass(frozen=True)
class Design:
    """The points of an experiment, each listed once.

    Attributes
    ----------
    values
        Physical values or names, by point and factor, in standard order.
    centre
        Whether each point is a centre point.
    generators
        For a fraction: generating words of its defining relation, each a set of factor indices
        and a sign.
    """

    factors: tuple[Factor, ...]
    values: tuple[tuple[Level, ...], ...]
    centre: tuple[bool, ...]
    generators: tuple[tuple[frozenset[int], int], ...] = ()

    @property
    def coded(self) -> NDArray[np.float64]:
        """Coded values; shape (points, factors)."""
        return np.array(
            [[f.coded(v) for f, v in zip(self.factors, p, strict=True)] for p in self.values]
        )

    @property
    def relation(self) -> tuple[tuple[frozenset[int], int], ...]:
        """The defining relation: all words whose column is constant, each with its sign."""
        words: dict[frozenset[int], int] = {frozenset(): 1}
        for word, sign in self.generators:
            words |= {known ^ word: s * sign for known, s in words.items()}
        return tuple((word, sign) for word, sign in words.items() if word)

    @property
    def resolution(self) -> int | None:
        """Length of the shortest word of the defining relation; None without such a relation."""
        return min((len(word) for word, _ in self.relation), default=None)

    def aliases(self, order: int = 2) -> list[tuple[str, ...]]:
        """Groups of terms, up to an order, that are aliased with each other.

        A term is ``"gps × imu"``. A minus sign marks a term that is aliased with opposite sign.
        """
        terms = [
            frozenset(c)
            for n in range(1, order + 1)
            for c in combinations(range(len(self.factors)), n)
        ]
        signs = dict(self.relation)
        groups, seen = [], set()
        for i, term in enumerate(terms):
            if term in seen:
                continue
            group = [(term, 1)] + [
                (other, signs[term ^ other]) for other in terms[i + 1 :] if term ^ other in signs
            ]
            seen |= {other for other, _ in group}
            if len(group) > 1:
                groups.append(tuple(self._term(t, sign) for t, sign in group))
        return groups

    def _term(self, term: frozenset[int], sign: int) -> str:
        names = [self.factors[i].name for i in sorted(term)]
        return ("−" if sign < 0 else "") + INTERACTION_SIGN.join(names)

    def require(self, order: int) -> None:
        """Refuse a design with aliases among terms up to an order.

        Raises
        ------
        ConfigurationError
            There are aliased terms; the message names them.
        """
        groups = self.aliases(order)
        if groups:
            named = "; ".join(" aliased with ".join(group) for group in groups)
            raise ConfigurationError(
                f"design: must separate terms up to order {order}, got {named}; use a larger "
                "fraction or a full design"
            )

    def table(self) -> pd.DataFrame:
        """Table in standard order: ``point`` (from 1), physical values by factor, ``centre``."""
        columns = zip(*self.values, strict=True)
        return pd.DataFrame(
            {
                "point": np.arange(1, len(self.values) + 1),
                **{f.name: list(c) for f, c in zip(self.factors, columns, strict=True)},
                "centre": self.centre,
            }
        )

    def run_order(self, replicate: int, seed: int) -> NDArray[np.int64]:
        """Randomised position (from 1) of each point among all runs; shape (points,).

        Runs are randomised within a replicate (from 1), so more replicates do not change the order
        of the earlier ones.
        """
        n = len(self.values)
        # Use raw bits, which are the same in every version of NumPy.
        bits = np.random.Philox(key=seed, counter=[0, 0, 0, replicate]).random_raw(n)
        positions = np.empty(n, np.int64)
        positions[np.argsort(bits, kind="stable")] = np.arange(1, n + 1)
        return (replicate - 1) * n + positions


def full(factors: Sequence[Factor], centre_points: int = 0) -> Design:
    """All combinations of two levels, 2^k points."""
    check_factors(factors)
    _check_size(len(factors))
    rows = [signs[::-1] for signs in product((-1, 1), repeat=len(factors))]
    return _two_level(factors, rows, centre_points)


def fractional(
    factors: Sequence[Factor],
    generators: Sequence[str] = (),
    resolution: int | None = None,
    centre_points: int = 0,
) -> Design:
    """A regular fraction of a two-level design, 2^(k−p) points.

    Parameters
    ----------
    generators
        ``"E=ABCD"`` or ``"E=-ABCD"``: p of them.
    resolution
        Instead of generators: use the smallest fraction with at least this resolution, and among
        those the one with the fewest short words.

    Raises
    ------
    ConfigurationError
        A generator is invalid, main effects are aliased, or there is no such fraction.
    """
    check_factors(factors)
    if bool(generators) == (resolution is not None):
        raise ConfigurationError(
            "design: must have generators or a resolution for a fraction, got "
            + ("both" if generators else "neither")
        )
    if resolution is not None:
        words = _search(len(factors), resolution)
    else:
        words = {}
        for text in generators:
            generated, word, sign = _generator(text, factors)
            if generated in words:
                raise ConfigurationError(
                    f"generator {quoted(text)}: must define another factor than the others, got "
                    f"{LETTERS[generated]} twice"
                )
            words[generated] = (word, sign)
        for text in generators:
            generated, word, _ = _generator(text, factors)
            for i in sorted(word & words.keys()):
                raise ConfigurationError(
                    f"generator {quoted(text)}: must be made of factors without a generator, got "
                    f"{LETTERS[i]}"
                )
    basic = [i for i in range(len(factors)) if i not in words]
    _check_size(len(basic))
    rows = []
    for signs in product((-1, 1), repeat=len(basic)):
        row = dict(zip(basic, signs[::-1], strict=True))
        row |= {new: sign * math.prod(row[i] for i in word) for new, (word, sign) in words.items()}
        rows.append(tuple(row[i] for i in range(len(factors))))
    relation = tuple((word | {generated}, sign) for generated, (word, sign) in words.items())
    design = _two_level(factors, rows, centre_points, relation)
    if design.resolution is not None and design.resolution < 3:
        design.require(1)
    return design


def sweep(factors: Sequence[Factor], base: Sequence[Number]) -> Design:
    """Vary one factor at a time through all its levels, with the others at the base.

    With several factors the base itself is the first point.
    """
    check_factors(factors)
    start: tuple[Level, ...] = tuple(base)
    points = [start] if len(factors) > 1 else []
    for i, factor in enumerate(factors):
        points += [(*start[:i], level, *start[i + 1 :]) for level in factor.numbers]
    unique = tuple(dict.fromkeys(points))
    return Design(tuple(factors), unique, (False,) * len(unique))


def _two_level(
    factors: Sequence[Factor],
    rows: Sequence[tuple[int, ...]],
    centre_points: int,
    generators: tuple[tuple[frozenset[int], int], ...] = (),
) -> Design:
    for factor in factors:
        if len(factor.levels) != 2:
            raise ConfigurationError(
                f"factor {factor.name}: must have two levels in a two-level design, got "
                f"{len(factor.levels)}; a grid (kind = 'grid') and a sweep have any number"
            )
    middle = tuple(_middle(f) for f in factors)
    points: list[tuple[Level, ...]] = [
        tuple(f.levels[(sign + 1) // 2] for f, sign in zip(factors, row, strict=True))
        for row in rows
    ]
    return Design(
        tuple(factors),
        (*points, *[middle] * centre_points),
        (False,) * len(points) + (True,) * centre_points,
        generators,
    )


def _middle(factor: Factor) -> Number:
    low, high = factor.numbers
    if isinstance(low, int) and isinstance(high, int) and (low + high) % 2 == 0:
        return (low + high) // 2
    return (low + high) / 2


def check_factors(factors: Sequence[Factor]) -> None:
    """Refuse a missing factor, too many factors, and duplicate names."""
    if not factors:
        raise ConfigurationError("design: must have at least one factor, got none")
    if len(factors) > len(LETTERS):
        raise ConfigurationError(
            f"design: must have at most {len(LETTERS)} factors, got {len(factors)}"
        )
    names = [f.name for f in factors]
    for name in names:
        if names.count(name) > 1:
            raise ConfigurationError(f"factor {name}: must appear once, got {names.count(name)}")


def _check_size(basic: int) -> None:
    if 2**basic > MOST_POINTS:
        raise ConfigurationError(
            f"design: must have at most {MOST_POINTS} points, got 2^{basic}; use a fraction"
        )


def _generator(text: str, factors: Sequence[Factor]) -> tuple[int, frozenset[int], int]:
    """Index of the generated factor, indices of the factors in its word, and the sign."""
    match = re.fullmatch(r"\s*([A-Z])\s*=\s*([+-]?)\s*([A-Z]+)\s*", text)
    known = LETTERS[: len(factors)]
    if match is None:
        raise ConfigurationError(f"generator: must be like 'E=ABCD', got {quoted(text)}")
    generated, sign, word = match.groups()
    for letter in generated + word:
        if letter not in known:
            raise ConfigurationError(
                f"generator {quoted(text)}: must be made of {', '.join(known)} "
                f"({', '.join(f.name for f in factors)}), got {letter}"
            )
    if len(set(word)) != len(word) or generated in word:
        raise ConfigurationError(f"generator {quoted(text)}: must name each factor once")
    numbers = frozenset(known.index(letter) for letter in word)
    return known.index(generated), numbers, -1 if sign == "-" else 1


def _search(k: int, resolution: int) -> dict[int, tuple[frozenset[int], int]]:
    """Generators of the smallest fraction of a resolution; they define the last factors."""
    if resolution < 3:
        raise ConfigurationError(f"resolution: must be at least 3, got {resolution}")
    for basic in range(min(resolution - 1, k), k):
        words = [
            sum(1 << i for i in c)
            for n in range(resolution - 1, basic + 1)
            for c in combinations(range(basic), n)
        ]
        candidates = islice(_fractions(words, basic, k - basic, resolution), _MOST_FRACTIONS)
        best = min(candidates, key=lambda chosen: _lengths(chosen, basic), default=None)
        if best is not None:
            return {
                basic + j: (frozenset(i for i in range(basic) if word >> i & 1), 1)
                for j, word in enumerate(best)
            }
    raise ConfigurationError(
        f"resolution: must be at most {k} for a fraction of {k} factors, got {resolution}"
        if resolution > k
        else f"resolution: must be that of a fraction of {k} factors, got {resolution}; "
        "use a full design"
    )


def _fractions(
    words: Sequence[int], basic: int, count: int, resolution: int
) -> Iterator[tuple[int, ...]]:
    """Choices of words, one per generated factor, whose defining relation has no short word."""

    def grow(chosen: tuple[int, ...], relation: tuple[int, ...], first: int) -> Iterator[
        tuple[int, ...]
    ]:
        if len(chosen) == count:
            yield chosen
            return
        letter = 1 << (basic + len(chosen))
        for i in range(first, len(words)):
            new = tuple(known ^ words[i] ^ letter for known in relation)
            if all(word.bit_count() >= resolution for word in new):
                yield from grow((*chosen, words[i]), relation + new, i + 1)

    return grow((), (0,), 0)


def _lengths(chosen: Sequence[int], basic: int) -> tuple[int, ...]:
    """Number of words of each length in the defining relation; fewer short ones are better."""
    relation = [0]
    for j, word in enumerate(chosen):
        relation += [known ^ word ^ (1 << (basic + j)) for known in relation]
    lengths = [word.bit_count() for word in relation]
    return tuple(lengths.count(n) for n in range(1, basic + len(chosen) + 1))

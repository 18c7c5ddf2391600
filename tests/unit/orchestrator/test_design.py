"""Designs: points, fractions, aliases, run order."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, product

import numpy as np
import pytest
from sblcosim.errors import ConfigurationError
from sblcosim.study.design import LETTERS, Design, Factor, check_factors, fractional, full, sweep


def factors(k: int) -> list[Factor]:
    return [Factor(LETTERS[i], (0.0, 1.0)) for i in range(k)]


def test_a_full_design_is_in_standard_order() -> None:
    design = full([Factor("a", (0.4, 3.0)), Factor("b", (1, 10)), Factor("c", (5.0, -5.0))])
    assert design.coded.tolist() == [
        [-1, -1, -1], [1, -1, -1], [-1, 1, -1], [1, 1, -1],
        [-1, -1, 1], [1, -1, 1], [-1, 1, 1], [1, 1, 1],
    ]  # fmt: skip
    assert design.values[1] == (3.0, 1, 5.0)
    assert design.values[4] == (0.4, 1, -5.0)
    assert isinstance(design.values[1][1], int)
    assert design.resolution is None
    assert design.aliases(3) == []


def test_levels_between_the_ends_are_coded_by_their_place() -> None:
    factor = Factor("a", (2.0, 3.0, 5.5, 10.0))
    assert [factor.coded(it) for it in (2.0, 3.0, 5.5, 6.0, 10.0)] == [-1, -0.75, -0.125, 0, 1]


def test_centre_points_lie_in_the_middle() -> None:
    design = full([Factor("a", (0.5, 3.5)), Factor("n", (1, 5))], centre_points=2)
    assert design.values[4:] == ((2.0, 3), (2.0, 3))
    assert design.centre == (False,) * 4 + (True,) * 2
    np.testing.assert_array_equal(design.coded[4:], 0.0)
    assert list(design.table().columns) == ["point", "a", "n", "centre"]


@pytest.mark.parametrize(("low", "high", "middle"), [
    (1, 5, 3), (5, 1, 3), (-3, 1, -1), (-4, -2, -3), (0, 2, 1), (1, 4, 2.5), (-1, 0, -0.5),
    (1.0, 5.0, 3.0), (1, 5.0, 3.0), (0.5, 3.5, 2.0),
])  # fmt: skip
def test_the_middle_of_whole_numbers_is_a_whole_number_where_there_is_one(
    low: float, high: float, middle: float
) -> None:
    """A key of whole numbers takes no other, also at a centre point."""
    (found,) = full([Factor("n", (low, high))], centre_points=1).values[-1]
    assert (found, type(found)) == (middle, type(middle))


def test_a_generator_makes_its_factor_the_product_of_others() -> None:
    design = fractional(factors(5), ["E=-ABCD"])
    coded = design.coded
    assert coded.shape == (16, 5)
    np.testing.assert_array_equal(coded[:, 4], -coded[:, :4].prod(axis=1))
    np.testing.assert_array_equal(coded.T @ coded, 16 * np.eye(5))
    assert design.resolution == 5
    assert design.aliases(2) == []


@pytest.mark.parametrize(
    ("k", "resolution", "points"),
    # Box, Hunter and Hunter: the smallest regular fractions of these resolutions.
    [(3, 3, 4), (5, 3, 8), (7, 3, 8), (15, 3, 16), (4, 4, 8), (6, 4, 16), (8, 4, 16), (5, 5, 16),
     (6, 5, 32), (7, 5, 64), (8, 5, 64), (11, 5, 128), (7, 7, 64)],
)  # fmt: skip
def test_a_resolution_gives_the_smallest_fraction(k: int, resolution: int, points: int) -> None:
    design = fractional(factors(k), resolution=resolution)
    assert len(design.values) == points
    assert design.resolution is not None
    assert design.resolution >= resolution
    assert len(set(design.values)) == points


def test_the_fraction_has_the_fewest_short_words() -> None:
    """2^(9-4) of resolution IV: the minimum-aberration design has six words of four letters."""
    design = fractional(factors(9), resolution=4)
    assert len(design.values) == 32
    assert [len(word) for word, _ in design.relation].count(4) == 6


def lengths(basic: int, chosen: Sequence[frozenset[int]]) -> tuple[int, ...]:
    """Number of words of each length, of all products of the generators."""
    total = basic + len(chosen)
    counts = [0] * (total + 1)
    for some in product((False, True), repeat=len(chosen)):
        word: frozenset[int] = frozenset()
        for j, (taken, own) in enumerate(zip(some, chosen, strict=True)):
            word ^= own | {basic + j} if taken else frozenset()
        counts[len(word)] += 1
    return tuple(counts[1:])


@pytest.mark.parametrize("k", range(3, 9))
@pytest.mark.parametrize("resolution", range(3, 8))
def test_no_fraction_is_smaller_or_has_fewer_short_words(k: int, resolution: int) -> None:
    """Of all choices of generators, also such as define a factor by any other word."""
    for basic in range(1, k):
        words = [
            frozenset(c) for n in range(1, basic + 1) for c in combinations(range(basic), n)
        ]
        found = [lengths(basic, chosen) for chosen in combinations(words, k - basic)]
        good = [counts for counts in found if not any(counts[: resolution - 1])]
        if good:
            break
    else:
        with pytest.raises(ConfigurationError, match=f"got {resolution}"):
            fractional(factors(k), resolution=resolution)
        return
    design = fractional(factors(k), resolution=resolution)
    assert len(design.values) == len(set(design.values)) == 2**basic
    words_of = [len(word) for word, _ in design.relation]
    assert tuple(words_of.count(n) for n in range(1, k + 1)) == min(good)
    for word, sign in design.relation:
        np.testing.assert_array_equal(design.coded[:, sorted(word)].prod(axis=1), sign)


def test_as_many_factors_as_letters_and_as_many_points_as_allowed_are_taken() -> None:
    check_factors(factors(25))
    with pytest.raises(ConfigurationError, match="must have at most 25 factors, got 26"):
        check_factors([*factors(25), Factor("last", (0, 1))])
    assert len(full(factors(16)).values) == 2**16


def test_aliased_terms_have_equal_columns() -> None:
    design = fractional(factors(6), ["E=ABC", "F=-BCD"])
    coded = dict(zip(LETTERS, design.coded.T, strict=False))

    def column(term: str) -> np.ndarray:
        sign = -1 if term.startswith("−") else 1
        return sign * np.prod([coded[f] for f in term.removeprefix("−").split(" × ")], axis=0)

    groups = design.aliases(2)
    assert len(groups) == 7
    for first, *others in groups:
        for other in others:
            np.testing.assert_array_equal(column(first), column(other))


@pytest.mark.parametrize("first", ["", "-"])
@pytest.mark.parametrize("second", ["", "-"])
@pytest.mark.parametrize("third", ["", "-"])
def test_words_of_the_relation_are_constant_columns_with_their_signs(
    first: str, second: str, third: str
) -> None:
    design = fractional(factors(7), [f"E={first}ABC", f"F={second}BCD", f"G={third}ACD"])
    assert len(design.relation) == 7
    for word, sign in design.relation:
        column = design.coded[:, sorted(word)].prod(axis=1)
        np.testing.assert_array_equal(column, np.full(16, sign))
    # the product of two generators: ABCE BCDF = ADEF
    own = "−" if (first == "-") != (second == "-") else ""
    (group,) = [g for g in design.aliases(2) if "A × D" in g]
    assert f"{own}E × F" in group


def test_terms_that_cannot_be_estimated_are_named() -> None:
    design = fractional(factors(4), ["D=ABC"])
    design.require(1)
    with pytest.raises(ConfigurationError, match="A × B aliased with C × D"):
        design.require(2)
    with pytest.raises(ConfigurationError, match="got A aliased with C; use a larger fraction"):
        fractional(factors(3), ["C=A"])


def test_a_sweep_goes_through_all_levels_of_one_factor_at_a_time() -> None:
    single = sweep([Factor("arm", (0.2, 0.4, 1.0, 3.0))], [9.0])
    assert single.values == ((0.2,), (0.4,), (1.0,), (3.0,))
    several = sweep([Factor("a", (1, 2, 3)), Factor("b", (10, 20))], [2, 20])
    assert several.values == ((2, 20), (1, 20), (3, 20), (2, 10))


def test_the_run_order_is_a_permutation_within_each_replicate() -> None:
    design = full(factors(4))
    orders = [design.run_order(r, seed=3) for r in (1, 2, 3)]
    assert sorted(np.concatenate(orders)) == list(range(1, 49))
    assert sorted(orders[1]) == list(range(17, 33))
    assert (orders[0] != orders[1] - 16).any()
    np.testing.assert_array_equal(orders[2], design.run_order(3, seed=3))
    assert (design.run_order(1, seed=4) != orders[0]).any()
    # Written down: it must be the same in every version.
    assert orders[0].tolist() == [15, 5, 13, 1, 12, 16, 10, 11, 9, 8, 6, 14, 7, 4, 3, 2]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Factor("gps", (1.0, 1)), "factor gps: must have levels .* got 1.0 twice"),
        (lambda: Factor("gps", (1.0,)), "must have at least two levels, got 1"),
        (lambda: Factor("gps", (1.0, float("inf"))), "must have finite levels, got inf"),
        (lambda: full([]), "must have at least one factor"),
        (lambda: full([Factor("a", (1, 2)), Factor("a", (1, 3))]), "must appear once, got 2"),
        (lambda: full([Factor("a", (1, 2, 3))]), "must have two levels in a two-level design"),
        (lambda: full(factors(17)), r"at most 65536 points, got 2\^17; use a fraction"),
        (lambda: fractional(factors(5)), "must have generators or a resolution .* got neither"),
        (lambda: fractional(factors(5), ["E=AB"], 3), "got both"),
        (lambda: fractional(factors(5), ["E:AB"]), "must be like 'E=ABCD', got 'E:AB'"),
        (lambda: fractional(factors(5), ["E=ABX"]), r"must be made of A, B, C, D, E .* got X"),
        (lambda: fractional(factors(5), ["E=AAB"]), "must name each factor once"),
        (lambda: fractional(factors(5), ["E=ABE"]), "must name each factor once"),
        (lambda: fractional(factors(5), ["Z=AB"]), r"must be made of A, B, C, D, E .* got Z"),
        (lambda: fractional(factors(5), ["E=AB", "E=CD"]), "got E twice"),
        (lambda: fractional(factors(5), ["D=ABC", "E=AD"]), "without a generator, got D"),
        (lambda: fractional(factors(5), resolution=2), "must be at least 3, got 2"),
        (lambda: fractional(factors(5), resolution=6), "resolution: must be at most 5 for"),
    ],
)  # fmt: skip
def test_what_cannot_be_carried_out_is_refused(make: object, message: str) -> None:
    assert callable(make)
    with pytest.raises(ConfigurationError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_a_design_is_data() -> None:
    assert isinstance(full(factors(2)), Design)
    assert full(factors(2)) == full(factors(2))

"""Units of packages and FMUs, and numbers on their way from unit to unit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest
from sblcosim.packages.units import (
    EXPONENTS,
    LinearUnit,
    Named,
    Quantity,
    chained,
    conversion,
    unit_of,
    units_of,
)
from sblcosim.simulation.system import Conversion

METRE = (0, 1, 0, 0, 0, 0, 0, 0)
M = Named("m", LinearUnit(METRE, 1.0, 0.0))
KM = Named("km", LinearUnit(METRE, 1000.0, 0.0))
SHIFTED = Named("shifted", LinearUnit(METRE, 0.5, 3.0))
ELL = Named("ell", None)
S = Named("s", LinearUnit((0, 0, 1, 0, 0, 0, 0, 0), 1.0, 0.0))


def test_a_unit_has_the_attributes_of_its_definition() -> None:
    assert unit_of({"m": "2", "s": -1, "rad": "1", "kg": None, "factor": "0.25", "offset": "-7"}) \
        == LinearUnit((0, 2, -1, 0, 0, 0, 0, 1), 0.25, -7.0)
    assert unit_of({}) == LinearUnit((0,) * 8, 1.0, 0.0)
    for k, name in enumerate(EXPONENTS):
        assert unit_of({name: "3"}).exponents == tuple(3 * (i == k) for i in range(8))


@pytest.mark.parametrize("given", [
    {"m": "1.5"}, {"m": "x"}, {"factor": "0"}, {"factor": "inf"}, {"factor": "nan"},
    {"offset": "inf"}, {"offset": "nan"}, {"factor": "x"},
])  # fmt: skip
def test_a_unit_that_cannot_be_divided_by_is_none(given: dict[str, str]) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        unit_of(given)


@dataclass
class _Base:
    m: Any = 0
    factor: Any = None
    offset: Any = None


@dataclass
class _Definition:
    name: str
    baseUnit: Any  # noqa: N815  (as in FMI)


def test_units_of_an_fmu_are_those_that_it_defines_well() -> None:
    found = units_of([
        _Definition("none", None), _Definition("m", _Base(1)), _Definition("bad", _Base("x")),
        _Definition("km", _Base("1", "1000")), _Definition("zero", _Base(1, 0.0)),
        _Definition("shifted", _Base(1, 0.5, 3)),
    ])
    assert found == {"m": M.unit, "km": KM.unit, "shifted": SHIFTED.unit}


@pytest.mark.parametrize(("one", "other", "factor", "offset"), [
    (KM, M, 1000.0, 0.0), (M, KM, 0.001, 0.0), (SHIFTED, M, 0.5, 3.0), (M, SHIFTED, 2.0, -6.0),
    (KM, SHIFTED, 2000.0, -6.0), (SHIFTED, KM, 0.0005, 0.003), (SHIFTED, SHIFTED, 1.0, 0.0),
])  # fmt: skip
def test_values_are_converted_over_base_units(
    one: Named, other: Named, factor: float, offset: float
) -> None:
    """Base units are factor v + offset."""
    assert one.unit is not None
    assert other.unit is not None
    assert conversion(one.unit, other.unit) == Conversion(factor, offset)
    arrived = Quantity.of(one).to(other)
    assert arrived.through == (() if one is other else (Conversion(factor, offset),))
    assert arrived.certain


def test_quantities_do_not_become_others() -> None:
    assert M.unit is not None
    assert S.unit is not None
    with pytest.raises(ValueError, match="different quantities"):
        conversion(M.unit, S.unit)
    with pytest.raises(ValueError, match="must have units of the same quantity at both ends, got "
                       "'m' and 's'"):
        Quantity.of(M).to(S)
    for one, other, names in ((M, ELL, "'m' and 'ell'"), (ELL, M, "'ell' and 'm'")):
        with pytest.raises(ValueError, match=f"both units must be defined, got {names}"):
            Quantity.of(one).to(other)


def test_a_number_that_returns_to_its_unit_is_the_same() -> None:
    back = Quantity.of(KM).to(SHIFTED).to(M).to(KM)
    assert (back.unit, back.through, back.certain, back.doubts) == (KM, (), True, ())


def test_a_number_goes_on_in_the_unit_that_is_said() -> None:
    """A unit without a definition is itself; without a conversion the number stays."""
    assert Quantity.of(ELL).to(ELL) == Quantity(ELL, ELL)
    nothing = Quantity.of(KM).to(None)
    assert nothing == Quantity.of(KM)
    plain = Quantity.of(KM).unchanged(M)
    assert (plain.unit, plain.through, plain.certain) == (M, (), True)
    later = Quantity.of(KM).to(M).unchanged(SHIFTED).to(M)
    assert later.through == (Conversion(1000.0), Conversion(0.5, 3.0))
    from_nowhere = Quantity.of(None).to(KM, "here").to(M, "there")
    assert from_nowhere.doubts == (("here", "none", "km"),)
    assert from_nowhere.through == (Conversion(1000.0),)
    unsure = Quantity.of(None).to(KM, "here")
    assert (unsure.certain, unsure.through) == (False, ())
    by = Conversion(0.1, 0.3)
    turned = unsure.to(M).transformed(by)
    assert (turned.unit, turned.through) == (M, (Conversion(1000.0), by))
    assert (turned.certain, turned.doubts) == (True, ())


def test_conversions_one_after_another() -> None:
    steps = (Conversion(2.0, 1.0), Conversion(), Conversion(3.0, -5.0), Conversion(0.5, 0.25))
    whole = chained(steps)
    assert whole.steps == (steps[0], steps[2], steps[3])
    assert chained([]) == chained([Conversion(), Conversion()]) == Conversion()
    assert chained(steps[:1]) == steps[0]

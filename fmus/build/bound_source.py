"""C code of the bound's equations: tables and rows of each model, from its CasADi functions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import casadi as ca
from sblcosim.models.ports import BEACONS
from sblcosim.models.receiver.bound import BOUNDS, SITUATION, SURROUNDINGS, Bound, Row, least

from .generator import procedure
from .straight_line import Array, statements

_OWN_BEACON = {None: -1, False: 0, True: 1}


def bound_source() -> str:
    """The generated part of a bound: sizes, parameters and equations of all models, as C."""
    parts = [line for name, bound in BOUNDS.items() for line in _model(name, bound)]
    most = max(b.states + b.each * BEACONS.most for b in BOUNDS.values())
    longest = max(len(_parameters(bound)) for bound in BOUNDS.values())
    elements, used = map(max, zip(*map(_sizes, BOUNDS.values()), strict=True))
    return "\n".join([
        "/* Equations of bounds, generated from CasADi functions. */",
        f"enum {{ MOST_BEACONS = {BEACONS.most}, MOST_STATES = {most}, "
        f"MOST_PARAMETERS = {longest}, MOST_ELEMENTS = {elements}, MOST_USED = {used} }};",
        "",
        *parts,
        "static const struct model *const models[] = {"
        + ", ".join(f"&{name}" for name in BOUNDS) + "};",
        "",
    ])


def _parameters(bound: Bound) -> tuple[str, ...]:
    return (*bound.parameters, *SITUATION)


def _sizes(bound: Bound) -> tuple[int, int]:
    """Number of elements of a transition, and of the longest row with its variance."""
    p, s = _parameter_symbols(bound)[1], _surroundings()[1]
    rows = [len(row.of(ca, p, s).row) + 1 for row in bound.rows]
    return sum(map(len, bound.transition(ca, p, ca.SX.sym("dt")))), max(rows)


def _parameter_symbols(bound: Bound) -> tuple[Any, Any]:
    """A column of symbols, and a namespace with their names."""
    names = _parameters(bound)
    column = ca.SX.sym("p", len(names))
    return column, SimpleNamespace(**dict(zip(names, ca.vertsplit(column), strict=True)))


def _surroundings() -> tuple[Any, Any]:
    """The same for the true values at an epoch, as sequences."""
    parts = {name: ca.SX.sym(name, length) for name, length in SURROUNDINGS.items()}
    return ca.vertcat(*parts.values()), SimpleNamespace(
        **{name: ca.vertsplit(part) for name, part in parts.items()}
    )


def _model(name: str, bound: Bound) -> Iterator[str]:
    """Functions and tables of one model."""
    column, p = _parameter_symbols(bound)
    size = bound.states + bound.each
    yield f"/* {name}: parameters {', '.join(_parameters(bound))} */"
    surroundings, s = _surroundings()
    stds = bound.prior_stds(ca, p, s)
    yield _function(
        f"{name}_prior(const real *p, const real *s, real *variance)",
        ca.vertcat(column, surroundings), [stds.get(i, 0) ** 2 for i in range(size)], "variance",
        [*(f"p[{i}]" for i in range(column.numel())),
         *(f"s[{i}]" for i in range(surroundings.numel()))],
    )
    dt = ca.SX.sym("dt")
    tables = bound.transition(ca, p, dt)
    for what, elements in zip(("phi", "noise"), tables, strict=True):
        pairs = ", ".join(f"{{{i}, {j}}}" for i, j in elements)
        yield f"static const int {name}_{what}[][2] = {{{pairs}}};\n"
    values = [value for elements in tables for value in elements.values()]
    yield _function(
        f"{name}_transition(const real *p, real dt, real *v)", ca.vertcat(column, dt), values, "v",
        [*(f"p[{i}]" for i in range(column.numel())), "dt"],
    )
    P = _covariance(size)
    yield _function(
        f"{name}_marginals(const real *p, const real *P, int n, real *v)",
        ca.vertcat(column, _upper(P)),
        [e for matrix in bound.marginals(p, P) for row in matrix for e in row], "v",
        [*(f"p[{i}]" for i in range(column.numel())),
         *(f"P[{i} * n + {j}]" for i in range(size) for j in range(i, size))],
    )
    yield from _rows(name, bound, column, p)
    sizes = f"{bound.states}, {bound.each}, {len(_parameters(bound))}"
    counts = f"{len(tables[0])}, {len(tables[1])}, {len(bound.rows)}"
    yield (
        f"static const struct model {name} = {{\n    {sizes}, {counts}, {name}_phi, {name}_noise, "
        f"{name}_rows,\n    {name}_prior, {name}_transition, {name}_marginals,\n}};\n"
    )


def _rows(name: str, bound: Bound, column: Any, p: Any) -> Iterator[str]:
    """A function for each measurement: its nonzero derivatives, then the variance."""
    surroundings, s = _surroundings()
    lines = []
    for number, row in enumerate(bound.rows):
        measurement = row.of(ca, p, s)
        yield (
            f"static const int {name}_at_{number}[] = {{{', '.join(map(str, measurement.row))}}};\n"
        )
        yield _function(
            f"{name}_row_{number}(const real *p, const real *s, real *h)",
            ca.vertcat(column, surroundings),
            [*measurement.row.values(), least(ca, measurement)], "h",
            [*(f"p[{i}]" for i in range(column.numel())),
             *(f"s[{i}]" for i in range(surroundings.numel()))],
        )
        lines.append(f"    {_row(name, number, row, len(measurement.row))},")
    yield "\n".join([f"static const struct row {name}_rows[] = {{", *lines, "};", ""])


def _row(name: str, number: int, row: Row, used: int) -> str:
    own = _OWN_BEACON[row.own_beacon]
    return f"{{{row.counts.upper()}, {own}, {used}, {name}_at_{number}, {name}_row_{number}}}"


def _covariance(size: int) -> Any:
    """A symmetric matrix of symbols, built from its upper triangle."""
    P = ca.SX.sym("P", size, size)
    return ca.triu2symm(ca.triu(P))


def _upper(P: Any) -> Any:
    n = P.shape[0]
    return ca.vertcat(*(P[i, j] for i in range(n) for j in range(i, n)))


def _function(
    signature: str, column: Any, values: Sequence[Any], result: str,
    elements: Array | None = None,
) -> str:
    """A C function of a column of symbols; its elements are ``p`` unless named otherwise."""
    name = signature.partition("(")[0]
    function = ca.Function(name, [column], [ca.densify(ca.vertcat(*values))])
    names = [part.split()[-1].strip("* ") for part in signature[len(name) + 1 : -1].split(",")]
    lines = statements(function, ["p" if elements is None else elements], result)
    return procedure(signature, lines, [n for n in names if n != result])

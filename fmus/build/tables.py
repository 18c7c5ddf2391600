"""Tables of constants in C: variables of an FMU shell, and draws of noise."""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Literal

from sblcosim.models.declaration import Component, Variable
from sblcosim.models.equations import Draw

from ..standard import Fmi
from .description import value_references

if TYPE_CHECKING:
    from sblcosim.models.equations import Model

_TYPES = {"Float64": "FLOAT64", "Int32": "INT32", "Boolean": "BOOLEAN"}
_CAUSALITIES = {"parameter": "PARAMETER", "input": "INPUT", "output": "OUTPUT"}


def draw_blocks(draws: Sequence[Draw], occasion: str, parameters: Mapping[str, int]) -> list[str]:
    """The blocks of random numbers drawn on one occasion, as rows of ``struct draw``.

    A block gives two numbers. Draws of one kind share blocks, in the order of their declaration.

    Parameters
    ----------
    parameters
        Index of each scalar parameter in ``p``.
    """
    kinds: dict[Literal["normal", "uniform"], list[tuple[int, str | None]]]
    kinds = {"normal": [], "uniform": []}
    index = 0
    for draw in draws:
        if draw.occasion == occasion:
            scales = draw.scale or (None,) * draw.size
            kinds[draw.kind] += zip(range(index, index + draw.size), scales, strict=True)
            index += draw.size
    rows = []
    for kind, numbers in kinds.items():
        for first in range(0, len(numbers), 2):
            pair = numbers[first : first + 2]
            to = [index for index, _ in pair]
            scale = [-1 if scale is None else parameters[scale] for _, scale in pair]
            if len(pair) == 1:
                to, scale = [*to, -1], scale * 2
            uniform = int(kind == "uniform")
            rows.append(f"{{{first + uniform}, {uniform}, {{{to[0]}, {to[1]}}}, "
                        f"{{{scale[0]}, {scale[1]}}}}}")
    return rows


def draw_tables(blocks: Sequence[Sequence[str]]) -> Iterator[str]:
    """The blocks of all occasions, and their numbers, as C."""
    yield f"static const struct draw model_draws[{len(blocks)}][N_BLOCKS + 1] = {{"
    for rows in blocks:
        yield f"    {{{', '.join(rows or ['{0, 0, {0, 0}, {0, 0}}'])}}},"
    yield "};"
    counts = ", ".join(str(len(rows)) for rows in blocks)
    yield f"static const int model_blocks[{len(blocks)}] = {{{counts}}};"
    yield ""


def noise_size(draws: Sequence[Draw], occasion: str) -> int:
    """Number of values drawn on one occasion."""
    return sum(draw.size for draw in draws if draw.occasion == occasion)


def _bound(value: float | None, infinity: str) -> str:
    return infinity if value is None else float(value).hex()


def table_source(component: Component, token: str, references: Mapping[str, int]) -> str:
    """The generated tables of an FMU shell: its variables, start values and identity, as C.

    Parameters
    ----------
    references
        Value reference of each variable's first element, as in modelDescription.xml.
    """

    def row(v: Variable) -> str:
        columns = v.shape[1] if len(v.shape) == 2 else 0
        return (
            f'    {{"{v.name}", {_TYPES[v.type]}, {_CAUSALITIES[v.causality]}, '
            f"{references[v.name]}, {v.size}, {len(v.shape)}, {columns}, "
            f'{_bound(v.min, "-INFINITY")}, {_bound(v.max, "INFINITY")}}},'
        )

    owners = [str(i) for i, v in enumerate(component) for _ in range(v.size)]
    kinds = [(v.type, v.causality) for v in component for _ in range(v.size)]
    alike: list[int] = []
    for i in reversed(range(len(kinds))):
        same = i + 1 < len(kinds) and kinds[i] == kinds[i + 1]
        alike.append(alike[-1] + 1 if same else 1)
    starts = [
        float(start).hex() for v in component if v.causality != "output" for start in v.starts
    ]
    return "\n".join(
        [
            f"/* Tables of {component.name}, generated from its declaration. */",
            f'#define MODEL_NAME "{component.name}"',
            f'#define MODEL_TOKEN "{token}"',
            f"#define FIRST_REFERENCE {min(references.values())}",
            f"#define N_VARIABLES {len(component.variables)}",
            "static const struct variable variables[N_VARIABLES] = {",
            *(row(v) for v in component),
            "};",
            "/* Which variable each element belongs to. */",
            f"static const unsigned short owner[N_VALUES] = {{{', '.join(owners)}}};",
            "/* How many elements from this one on have its type and causality. */",
            "static const unsigned short alike[N_VALUES] = "
            f"{{{', '.join(map(str, reversed(alike)))}}};",
            f"static const double start_values[N_P + N_U] = {{{', '.join(starts)}}};",
            "",
        ]
    )


def tables_of(model: Model, token: str) -> bytes:
    """The tables of a component's variables."""
    return table_source(model.component, token, value_references(model.component)).encode()


def token_of(model: Model, sources: Mapping[str, bytes], fmi: Fmi) -> str:
    """GUID or instantiation token: the same for the same interface and equations."""
    digest = hashlib.sha256(tables_of(model, ""))
    for file in sorted(sources):
        digest.update(file.encode() + b"\0" + sources[file])
    token = str(uuid.UUID(bytes=digest.digest()[:16]))
    return f"{{{token}}}" if fmi == 2 else token

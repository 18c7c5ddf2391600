"""A receiver as C for a microcontroller: one file and one header, for one scenario's parameters.

The equations, the engine and the elementary functions are those of its FMU, and so are the bits.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence

from sblcosim.models.declaration import Variable
from sblcosim.models.equations import Model

from .c_files import FIRMWARE, c_files
from .factory import engine_sources
from .fixed import fixed
from .generator import Fixed, state_indices

_TYPES = {"Float64": "double", "Int32": "int32_t", "Boolean": "bool"}
_INCLUDE = re.compile(r'^#include "(.+)".*$', re.MULTILINE)


def sources(
    model: Model, name: str, parameters: Mapping[str, Sequence[float]], interval_ns: int
) -> dict[str, str]:
    """``NAME.c`` and ``NAME.h``.

    Parameters
    ----------
    model
        A receiver.
    name
        Prefix of all its public names, an identifier in C.
    parameters
        Values of parameters by name; all others have their start values.
    interval_ns
        Time between updates [ns].

    Raises
    ------
    ValueError
        As `sblcosim.fmus.build.fixed.fixed`.
    """
    whole = fixed(model, parameters)
    files = {
        **{file: text.decode() for file, text in engine_sources(whole).items()},
        **{file: text.decode() for file, text in c_files(FIRMWARE).items()},
        "firmware.h": "\n".join(_names(whole, name, interval_ns)),
        "firmware_ports.h": "\n".join(_ports(model)),
    }
    return {f"{name}.c": _joined("firmware.c", files, set()), f"{name}.h": _header(whole, name)}


def state_bytes(model: Fixed) -> int:
    """Size of the state of a receiver [B]: its block, and the time of its next update."""
    inputs, outputs = (sum(v.size for v in model.component.of(it)) for it in ("input", "output"))
    states = max([outputs, *(index + 1 for index in state_indices(model))])
    loops = len(model.advance) + len(model.iterate)
    return 8 * (inputs + states + loops + 1 + 2 + 1)


def _joined(file: str, files: Mapping[str, str], done: set[str]) -> str:
    """A file with all that it includes in the place of the first ``#include``."""

    def content(match: re.Match[str]) -> str:
        included = match[1]
        if included not in files or included in done:
            return "" if included in files else match[0]
        done.add(included)
        return _joined(included, files, done)

    return _INCLUDE.sub(content, files[file])


def _names(model: Fixed, name: str, interval_ns: int) -> Iterator[str]:
    """What NAME.c needs to know of NAME.h."""
    yield f'#include "{name}.h"'
    yield f"#define FIRMWARE(it) {name}_##it"
    yield f"#define FIRMWARE_STATE_BYTES {name.upper()}_STATE_BYTES"
    yield f"#define FIRMWARE_INTERVAL_NS INT64_C({interval_ns})"
    yield "#ifdef __clang__ /* which warns of functions of the engine that a receiver does not use */"
    yield '#pragma clang diagnostic ignored "-Wunused-function"'
    yield "#endif"


def _ports(model: Model) -> Iterator[str]:
    """Functions that copy inputs to the engine, and outputs from it."""
    yield "static void firmware_take(const FIRMWARE(inputs) *in, real *u)"
    yield "{"
    yield from _copied(model.component.of("input"), lambda at, port: f"u[{at}] = in->{port};")
    yield "}"
    yield ""
    yield "static void firmware_give(const real *x, FIRMWARE(outputs) *out)"
    yield "{"
    types = {v.name: _TYPES[v.type] for v in model.component.of("output")}

    def given(at: str, port: str) -> str:
        kind = types[port.partition("[")[0]]
        value = f"x[{at}]" if kind == "double" else f"({kind})x[{at}]"
        return f"out->{port} = {value};"

    yield from _copied(model.component.of("output"), given)
    yield "}"


def _copied(variables: Sequence[Variable], line: Callable[[str, str], str]) -> Iterator[str]:
    at = 0
    for v in variables:
        if not v.shape:
            yield f"    {line(str(at), v.name)}"
        elif len(v.shape) == 1:
            yield f"    for (int i = 0; i < {v.size}; i++)"
            yield f"        {line(f'{at} + i', f'{v.name}[i]')}"
        else:
            rows, columns = v.shape
            yield f"    for (int i = 0; i < {rows}; i++)"
            yield f"        for (int j = 0; j < {columns}; j++)"
            yield f"            {line(f'{at} + {columns} * i + j', f'{v.name}[i][j]')}"
        at += v.size


def _header(model: Fixed, name: str) -> str:
    """The types and functions for users."""
    component, size = model.component, state_bytes(model)
    guard = f"{name.upper()}_H"
    return "\n".join([
        *_comment(f"{component.description}. README.md says how to use it.", ""),
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        "#include <stdbool.h>",
        "#include <stdint.h>",
        "",
        "#ifdef __cplusplus",
        'extern "C" {',
        "#endif",
        "",
        f"#define {name.upper()}_STATE_BYTES {size}",
        "",
        "/* All that a receiver remembers. Its members are its own; a copy is a snapshot. */",
        "typedef struct {",
        "    int64_t time_ns;",
        f"    double block[{size // 8 - 1}];",
        f"}} {name}_state;",
        "",
        "/* What has been received so far. Values hold until they are overwritten, and must be",
        " * finite. Arrays have an element, or a row, for each beacon. */",
        "typedef struct {",
        *_members(component.of("input")),
        f"}} {name}_inputs;",
        "",
        "typedef struct {",
        *_members(component.of("output")),
        f"}} {name}_outputs;",
        "",
        "/* Begin at time 0. */",
        f"void {name}_init({name}_state *state);",
        "",
        "/* Use what is new in the inputs; to be called once per update interval. */",
        f"void {name}_update({name}_state *state, const {name}_inputs *in, {name}_outputs *out);",
        "",
        "#ifdef __cplusplus",
        "}",
        "#endif",
        "#endif",
        "",
    ])


def _members(variables: Sequence[Variable]) -> Iterator[str]:
    for v in variables:
        unit = f" [{v.unit}]" if v.unit else ""
        yield from _comment(f"{v.description}{unit}.", "    ")
        sizes = "".join(f"[{n}]" for n in v.shape)
        yield f"    {_TYPES[v.type]} {v.name}{sizes};"


def _comment(text: str, indent: str) -> list[str]:
    lines = textwrap.wrap(text, 96 - len(indent))
    return [f"{indent}{'/*' if n == 0 else ' *'} {line}" + (" */" if line is lines[-1] else "")
            for n, line in enumerate(lines)]


def elements(model: Model, name: str) -> Iterator[str]:
    """A table in C of the place and type of each element of inputs and outputs, in their order."""
    for causality in ("input", "output"):
        variables = model.component.of(causality)
        yield f"static const struct place {causality}s[] = {{"
        for v in variables:
            kind = _TYPES[v.type]
            for i in range(v.size):
                yield (f"    {{offsetof({name}_{causality}s, {v.name}) + {i} * sizeof({kind}), "
                       f"sizeof({kind})}},")
        yield "};"

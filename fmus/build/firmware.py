"""A receiver as C for a microcontroller: one file and one header, for one scenario's parameters.

The equations, the engine and the elementary functions are those of its FMU, and so are the bits.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files as resources

import jinja2
import numpy as np
from numpy.typing import NDArray
from sblcosim.models.declaration import Causality, Variable
from sblcosim.models.equations import Model

from .c_files import FIRMWARE, SELFTEST, c_files
from .factory import engine_sources
from .fixed import fixed
from .generator import Fixed, state_indices
from .targets import FLAGS, TARGETS

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
    yield "#ifdef __clang__ /* for parts of the engine that a receiver does not use */"
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


@dataclass(frozen=True, eq=False)
class SelfTest:
    """A recorded dive of a receiver.

    Attributes
    ----------
    inputs
        Elements of all inputs at each update; (n, inputs).
    outputs
        Elements of all outputs after it; (n, outputs).
    """

    inputs: NDArray[np.float64]
    outputs: NDArray[np.float64]


def recording_source(model: Model, name: str, recording: SelfTest) -> str:
    """``recording.h``: changes of inputs and outputs, and the table of their places."""
    lines = [
        "/* Receptions of a recorded dive, and what the receiver made of them. */",
        f'#include "{name}.h"',
        f"#define SELFTEST(it) {name}_##it",
        f"#define UPDATES {len(recording.inputs)}",
        *_elements(model, name),
        "struct change {",
        "    unsigned short element;",
        "};",
    ]
    columns = [_bits(model.component.of("input"), recording.inputs),
               _bits(model.component.of("output"), recording.outputs)]
    changes: list[str] = []
    values: list[str] = []
    counts = []
    before = [[0] * len(column[0]) for column in columns]
    for update in range(len(recording.inputs)):
        count = []
        for port, column in enumerate(columns):
            new = [i for i, (a, b) in enumerate(zip(column[update], before[port], strict=True))
                   if a != b]
            changes += [f"{{{i}}}" for i in new]
            values += [f"0x{column[update][i]:x}" for i in new]
            count.append(str(len(new)))
            before[port] = column[update]
        counts.append(f"{{{', '.join(count)}}}")
    for kind, of, texts in (
        ("struct change", "changes", changes), ("uint64_t", "values", values),
        ("struct {\n    unsigned short inputs, outputs;\n}", "counts", counts),
    ):
        lines += [f"static const {kind} {of}[] = {{",
                  *textwrap.wrap(", ".join(texts), 96, initial_indent="    ",
                                 subsequent_indent="    "), "};"]
    return "\n".join([*lines, ""])


def _bits(variables: Sequence[Variable], values: NDArray[np.float64]) -> list[list[int]]:
    """The bits of each element, of its own type, as 64-bit numbers."""
    kinds = [v.type for v in variables for _ in range(v.size)]
    whole = np.array([kind != "Float64" for kind in kinds])
    bits = np.ascontiguousarray(values).view(np.uint64).copy()
    bits[:, whole] = values[:, whole].astype(np.int64).view(np.uint64)
    listed: list[list[int]] = bits.tolist()
    return listed


def _elements(model: Model, name: str) -> Iterator[str]:
    """A table in C of the place and size of each element of inputs and outputs, in their order."""
    causalities: tuple[Causality, ...] = ("input", "output")
    for causality in causalities:
        yield f"static const struct place {causality}s[] = {{"
        for v in model.component.of(causality):
            kind = _TYPES[v.type]
            for i in range(v.size):
                yield (f"    {{offsetof({name}_{causality}s, {v.name}) + {i} * sizeof({kind}), "
                       f"sizeof({kind})}},")
        yield "};"


def folder_files(
    model: Model, name: str, parameters: Mapping[str, Sequence[float]], interval_ns: int,
    target: str, recording: SelfTest, about: str,
) -> dict[str, bytes]:
    """All files of a folder: the receiver, how to use it, and its self-test.

    Parameters
    ----------
    target
        A key of `sblcosim.fmus.build.targets.TARGETS`.
    about
        Where the parameters and the recorded dive come from.

    Raises
    ------
    ValueError
        As `sblcosim.fmus.build.fixed.fixed`.
    """
    own = sources(model, name, parameters, interval_ns)
    chosen = TARGETS[target]
    extra = c_files([*SELFTEST.values()])
    for_board = ("measure.h", "board.c", "board.ld")
    texts = {
        **own, "recording.h": recording_source(model, name, recording),
        **{file: _rendered(f"firmware.{template}.jinja", {
            "name": name, "model": model, "target": chosen, "flags": FLAGS, "about": about,
            "interval_s": interval_ns / 1e9, "updates": len(recording.inputs),
            "state_bytes": re.findall(r"_STATE_BYTES (\d+)", own[f"{name}.h"])[0],
            "parameters": _parameters(model, parameters),
        }) for file, template in (("README.md", "md"), ("Makefile", "mk"))},
    }
    return {
        **{file: text.encode() for file, text in texts.items()},
        **{file: extra[source] for file, source in SELFTEST.items()
           if chosen.board or file not in for_board},
    }


def _rendered(template: str, values: Mapping[str, object]) -> str:
    environment = jinja2.Environment(
        trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
    )
    text = resources(__package__).joinpath(template).read_text("utf-8")
    return environment.from_string(text).render(values)


def _parameters(
    model: Model, given: Mapping[str, Sequence[float]]
) -> list[tuple[Variable, str]]:
    """Each parameter and its value, as text."""
    return [
        (v, ", ".join(f"{float(x):.12g}" for x in np.ravel(given.get(v.name, v.starts))))
        for v in model.component.of("parameter")
    ]

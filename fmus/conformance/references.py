"""The check of value references that belong to no variable."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator

from ..host.signatures import C_TYPES
from .bench import Bench, Clauses
from .library import TracedInstance
from .probes import INITIALISING, NEW, NOWHERE, STEPPED, Act, ProbeRow, call, probed, room
from .subject import Subject

_UNKNOWN: Clauses = ("2.1.2", None)
"""FMI 3 requires an error for what an FMU detects (3.0.2, 2.2.4), but not that it detects it."""


def unknown_references(bench: Bench) -> str:
    subject = bench.subject
    kinds = [*C_TYPES[subject.fmi], *(["Binary", "Clock"] if subject.fmi == 3 else [])]
    probes = [row for kind in kinds for row in _unknown_values(subject, kind)]
    return probed(bench, [*probes, *_unknown_derivatives(subject)], "refused")


def _unknown_values(subject: Subject, kind: str) -> Iterator[ProbeRow]:
    """References that no variable of a type has."""
    known = {v.reference for v in subject.variables}
    own = {v.reference for v in subject.variables if v.kind == kind}  # FMI 2 counts per type
    wrong = [v.reference for v in subject.variables if v.kind != kind][:1]
    # A variable missing from the description may have a reference close to theirs.
    doubtful = {max(known, default=0) + 1, *wrong, *known.intersection(_FAR)}
    for reference in sorted({*doubtful, *_FAR} - own - {_TOO_LARGE}):
        refusal = NOWHERE if reference in doubtful else _UNKNOWN
        for verb, modes in (("Get", (INITIALISING, STEPPED)), ("Set", (NEW, STEPPED))):
            act = _access(f"{verb}{kind}", reference, kind)
            label = f"fmi{subject.fmi}{verb}{kind} of {reference}, which is no {kind}"
            for mode in modes:
                yield label, mode, act, _UNKNOWN, refusal


_FAR = (0x7FFFFFFF, 0xFFFFFFFF)
"""References that no tool gives to a variable."""
_TOO_LARGE = 1 << 32


def _unknown_derivatives(subject: Subject) -> Iterator[ProbeRow]:
    if not subject.derivatives:
        return
    reals = [v for v in subject.variables if v.kind in ("Real", "Float64") and v.size == 1]
    name, spare = "GetDirectionalDerivative", room()
    size = (1,) if subject.fmi == 3 else ()
    for place in range(2) if reals else ():
        references = [(ctypes.c_uint32 * 1)(reals[0].reference) for _ in range(2)]
        references[place][0] = _FAR[0]
        act = call(name, references[0], 1, references[1], 1, spare, *size, spare, *size)
        what = ("unknown", "known")[place]
        label = f"fmi{subject.fmi}{name} with the {what} {_FAR[0]}, which is no variable"
        # The standard's own FMUs do not take it to require checks of derivatives too.
        yield label, STEPPED, act, _UNKNOWN, NOWHERE


def _access(name: str, reference: int, kind: str) -> Act:
    def act(instance: TracedInstance) -> int:
        size, fmi = 64, instance.library.fmi  # with room for more than requested
        references = (ctypes.c_uint32 * 1)(reference)
        if kind == "Binary":
            sizes, texts = (ctypes.c_size_t * size)(), (ctypes.c_char_p * size)(*[b""] * size)
            return instance.try_(name, references, 1, sizes, texts, size)
        if kind == "Clock":
            return instance.try_(name, references, 1, (ctypes.c_bool * size)(*[True] * size))
        buffer = (C_TYPES[fmi][kind] * size)(*([b""] * size if kind == "String" else []))
        return instance.try_(name, *instance.library.access([reference], buffer))

    return act

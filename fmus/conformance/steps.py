"""Checks of numbers: how they depend on the size of a step, and their derivatives."""

from __future__ import annotations

import random
from collections.abc import Sequence

from ..host.signatures import DISCARD
from .bench import (
    REALS,
    Bench,
    ConcernError,
    ConformanceError,
    NotApplicableError,
    Values,
    begin,
    expect_same,
    run,
    stimulus,
)
from .library import RefusedError, TracedInstance
from .subject import Subject, SubjectVariable

CUTS = (2, 5)
"""Numbers of parts into which a step is cut."""


def step_sizes(bench: Bench) -> str:
    subject = bench.subject
    if not subject.variable_steps:
        raise NotApplicableError("the FMU does not claim to handle steps of any size")
    cuts = [cut for cut in CUTS if _allowed(subject, subject.step / cut)]
    if not cuts:
        raise NotApplicableError(f"the FMU has fixed internal steps of {subject.internal_step:g} s")
    expected, level = bench.reference(), bench.facts["level"]
    for number in range(bench.first, len(cuts)):
        cut = cuts[number]
        instance = bench.instance()
        try:
            rows = run(begin(instance, level), level, cut=cut)
        except RefusedError as refusal:
            said = f"steps of {subject.step / cut:g} s: {refusal}"
            if refusal.status == DISCARD:
                raise NotApplicableError(said) from None
            raise ConcernError(said) from None  # another size may be tried: FMI 2.0.5, 4.2.2
        finally:
            instance.free()
        what = f"steps of {subject.step:g} s cut into {cut}"
        try:
            expect_same(bench, expected, rows, what, subject.tolerance)
        except ConformanceError as difference:
            raise ConcernError(str(difference)) from None
        if subject.once and number + 1 < len(cuts):
            bench.resume = number + 1
            return ""
    parts = " and ".join(map(str, cuts))
    return f"steps of {subject.step:g} s cut into {parts}, to {subject.tolerance:g}"


def _allowed(subject: Subject, step: float) -> bool:
    if subject.internal_step is None:
        return True
    parts = step / subject.internal_step
    return parts > 0.5 and abs(parts - round(parts)) < 1e-6


def derivatives(bench: Bench) -> str:
    subject = bench.subject
    if not subject.derivatives:
        raise NotApplicableError("the FMU does not claim directional derivatives")
    pairs = [
        (subject.variables[y], [v for v in map(subject.variables.__getitem__, u) if _smooth(v)])
        for y, u in subject.dependencies
        if _smooth(subject.variables[y])
    ]
    pairs = [(y, u) for y, u in pairs if u]
    if not pairs:
        raise NotApplicableError("no real output depends directly on a real input")
    instance = bench.instance()
    instance.enter()  # in this mode, values may be set and read in turn
    compared = 0
    for number in range(3):
        moved = stimulus(subject, REALS, number + 1, number)
        point = {v: [_inside(v, float(value)) for value in values] for v, values in moved}
        for y, u in pairs:
            for variable in u:
                instance.set(variable, point[variable])
            compared += _compare_derivative(instance, y, u, point)
    instance.free()
    if not compared:
        raise NotApplicableError("no point was found with derivatives that differences can confirm")
    return f"{compared} directions agree with differences"


def _smooth(variable: SubjectVariable) -> bool:
    """Whether differences of its values are exact enough."""
    return variable.real and variable.kind != "Float32" and not variable.clocked


def _inside(variable: SubjectVariable, value: float) -> float:
    """A value that can be changed in both directions."""
    low, high = variable.min, variable.max
    if low is not None and high is not None:
        margin = min(0.1, 0.1 * (high - low))
        return min(max(value, low + margin), high - margin)
    value = value if low is None else max(value, low + 0.1)
    return value if high is None else min(value, high - 0.1)


def _compare_derivative(
    instance: TracedInstance,
    y: SubjectVariable,
    u: Sequence[SubjectVariable],
    point: dict[SubjectVariable, list[float]],
) -> int:
    """Number of random directions that agree."""
    generator = random.Random(y.reference)
    inner = [value for v in u for value in point[v]]
    agreed = 0
    for _ in range(3):
        seed = [generator.uniform(-1.0, 1.0) for _ in inner]
        try:
            claimed = instance.derivative(y, u, seed)
            coarse, fine = (_difference(instance, y, u, inner, seed, h) for h in (2e-5, 1e-5))
        except RefusedError as refusal:
            if refusal.status == DISCARD:  # a point without a derivative
                return agreed
            raise
        for i, (d, rough, good) in enumerate(zip(claimed, coarse, fine, strict=True)):
            size = max(1.0, abs(good))
            if not abs(rough - good) < 1e-3 * size:  # a kink
                continue
            if not abs(d - good) <= 1e-5 * size + 10.0 * abs(rough - good):
                element = y.name if y.size == 1 else f"{y.name}[{i + 1}]"
                raise ConformanceError(
                    f"the derivative of {element} along {', '.join(v.name for v in u)} must be "
                    f"{good:.6g} by differences, got {d:.6g}"
                )
            agreed += 1
    return agreed


def _difference(
    instance: TracedInstance,
    y: SubjectVariable,
    u: Sequence[SubjectVariable],
    point: Sequence[float],
    seed: Sequence[float],
    h: float,
) -> list[float]:
    ends: list[Values] = []
    for sign in (1.0, -1.0, 0.0):
        moved = iter(p + sign * h * s for p, s in zip(point, seed, strict=True))
        for v in u:
            instance.set(v, [next(moved) for _ in range(v.size)])
        ends.append(instance.values([y]))
    return [(a - b) / (2.0 * h) for a, b, _ in zip(*ends, strict=True)]

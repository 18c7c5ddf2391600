"""What the checks know of an FMU: facts of its modelDescription.xml, without FMPy.

The checks run in processes of their own, many of them, which must start quickly: they get these
facts and import nothing but the standard library.
"""

from __future__ import annotations

from dataclasses import dataclass

Number = float | int | bool


@dataclass(frozen=True, slots=True)
class SubjectVariable:
    """A variable: a scalar, or an array of FMI 3.

    Attributes
    ----------
    kind
        End of the names of the functions that get and set it, e.g. ``Real`` or ``Float64``.
    start
        Per element; None if the FMU gives none.
    choice
        Whether it is an enumeration.
    clocked
        Whether it belongs to a clock: it has values at the clock's ticks only.
    """

    name: str
    reference: int
    kind: str
    causality: str
    variability: str
    size: int
    start: tuple[Number, ...] | None
    min: float | None
    max: float | None
    unit: str | None
    choice: bool
    clocked: bool

    @property
    def number(self) -> bool:
        """Whether it has values that one can calculate with."""
        return self.kind not in ("String", "Binary", "Clock", "Boolean") and not self.choice

    @property
    def real(self) -> bool:
        """Whether its values are floating-point numbers."""
        return self.kind in ("Real", "Float64", "Float32")


@dataclass(frozen=True, slots=True)
class Subject:
    """An unpacked FMU.

    Attributes
    ----------
    library, resources
        Paths of the binary for this machine and of the folder of resources.
    functions
        Names of all functions that it has to export.
    once, saves, serialises, variable_steps, derivatives
        Its capability flags.
    tool
        Whether it needs a tool that is not part of it.
    start, step, steps, tolerance
        Start in s, communication interval in s and number of steps of all runs, and the relative
        tolerance of results, from the default experiment as far as it says.
    internal_step
        Fixed internal step in s (FMI 3), of which every step is a multiple.
    dependencies
        Outputs and the inputs on which each depends directly, by index of ``variables``.
    """

    fmi: int
    version: str
    token: str
    library: str
    resources: str
    functions: tuple[str, ...]
    once: bool
    tool: bool
    saves: bool
    serialises: bool
    variable_steps: bool
    derivatives: bool
    start: float
    step: float
    steps: int
    tolerance: float
    internal_step: float | None
    variables: tuple[SubjectVariable, ...]
    dependencies: tuple[tuple[int, tuple[int, ...]], ...]

    def of(self, *causalities: str) -> tuple[SubjectVariable, ...]:
        """The variables of these causalities that are always there."""
        return tuple(v for v in self.variables if v.causality in causalities and not v.clocked)

    @property
    def observed(self) -> tuple[SubjectVariable, ...]:
        """The variables that are compared: the outputs, else what there is to be seen."""
        seen = self.of("output") or self.of("local")
        return tuple(v for v in seen if v.kind not in ("Binary", "Clock"))

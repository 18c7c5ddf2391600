"""What the checks know about an FMU: facts from its modelDescription.xml, without FMPy.

The checks run in many separate processes, which must start quickly. They receive these facts and
import only the standard library.
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
        End of the names of the functions that get and set it, for example ``Real`` or ``Float64``.
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
        """Whether arithmetic with its values makes sense."""
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
        Names of all functions that it must export.
    once, saves, serialises, variable_steps, derivatives
        Its capability flags.
    tool
        Whether it needs a tool that it does not include.
    start, step, steps, tolerance
        Start in s, communication interval in s, number of steps of all runs, and relative tolerance
        of results. Taken from the default experiment where it states them.
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
        """The variables with these causalities that always exist."""
        return tuple(v for v in self.variables if v.causality in causalities and not v.clocked)

    @property
    def observed(self) -> tuple[SubjectVariable, ...]:
        """The variables to compare: the outputs, or else whatever can be observed."""
        seen = self.of("output") or self.of("local")
        return tuple(v for v in seen if v.kind not in ("Binary", "Clock"))

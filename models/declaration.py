"""Declaration of a component: its variables, defined once.

modelDescription.xml (FMI 2 and 3), the C tables, the documentation in the FMU, the keys of a
scenario file and the orchestrator's checks are all generated from these declarations. This module
needs neither CasADi nor NumPy.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from .parts import DeclarationError as DeclarationError
from .parts import check_parts

Causality = Literal["parameter", "input", "output"]
Type = Literal["Float64", "Int32", "Boolean"]
Variability = Literal["fixed", "continuous", "discrete"]
Number = float | int | bool
Bounds = tuple[float | None, float | None]
"""Smallest and largest value, inclusive; None: there is none."""
Starts = Callable[[tuple[int, ...]], tuple[Number, ...]]
"""Makes the start values of an array of this shape, row by row."""
TerminalKind = Literal[
    "reception", "pose", "depth", "estimate", "system", "beacons", "reported_pose"
]

INT32_MAX = 2**31 - 1


class Dimension(int):
    """A size that is a constant of the build: a component is made for one value of it.

    It is an `int` whose value is that of the build. ``Component.sized`` replaces it.

    Attributes
    ----------
    name
        Name of the constant, e.g. ``"beacons"``.
    least, most
        Range of values for which components can be made.
    """

    name: str
    least: int
    most: int

    def __new__(cls, value: int, name: str, least: int = 1, most: int = INT32_MAX) -> Dimension:
        self = super().__new__(cls, value)
        self.name, self.least, self.most = name, least, most
        return self

    def __reduce__(self) -> tuple[type[Dimension], tuple[int, str, int, int]]:
        return Dimension, (int(self), self.name, self.least, self.most)

    def of(self, value: int) -> Dimension:
        """The same constant with another value.

        Raises
        ------
        ValueError
            Components cannot be made for this value.
        """
        if not self.least <= value <= self.most:
            raise ValueError(
                f"{self.name}: must be from {self.least} to {self.most}, got {value}"
            )
        return Dimension(value, self.name, self.least, self.most)


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit, known by its name (`sblcosim.fmus.build.description.base_unit`).

    Attributes
    ----------
    name
        Name in modelDescription.xml, e.g. ``"m/s"``.
    suffix
        Suffix of a key in a scenario file, e.g. ``"m_s"``.
    """

    name: str
    suffix: str


UNITS: Mapping[str, Unit] = {
    unit.name: unit
    for unit in (
        Unit("m", "m"),
        Unit("s", "s"),
        Unit("m/s", "m_s"),
        Unit("m2/s", "m2_s"),
        Unit("m2/s3", "m2_s3"),
        Unit("rad", "deg"),
        Unit("rad/s", "deg_s"),
        Unit("rad/K", "deg_K"),
        Unit("K", "K"),
        Unit("K/s", "K_s"),
        Unit("Hz", "Hz"),
        Unit("s/s", "s_s"),
    )
}
"""All units available to declarations. Angles are radians here and degrees in scenario files."""


@dataclass(frozen=True, slots=True)
class Condition:
    """A condition on another parameter.

    Attributes
    ----------
    parameter
        Name of the parameter, in the same component.
    values
        Accepted values. Empty: any value except zero (for an array, at least one element).
    """

    parameter: str
    values: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        check_parts(self)

    def holds(self, value: Number | Sequence[Number]) -> bool:
        """Whether a value in SI units, or the elements of an array, meet the condition."""
        if self.values:
            return value in self.values
        return any(value) if isinstance(value, Sequence) else bool(value)


Needs = tuple[tuple[Condition, ...], ...]
"""Requirements: at least one condition of each group must hold."""


@dataclass(frozen=True, slots=True)
class Variable:
    """One FMI variable; a scalar, or an array of fixed shape stored row by row.

    Attributes
    ----------
    name
        Name in the FMU. Elements of an array are ``name[i]`` or ``name[i,j]``, 1-based.
    description
        One sentence for display, including the frame.
    causality, type, variability
        As in the FMI standard. ``variability`` defaults to ``fixed`` for parameters,
        ``continuous`` for other Float64 variables and ``discrete`` for the rest.
    unit
        Key of `UNITS`, or None for a plain number.
    shape
        ``()`` for a scalar, else one or two dimensions.
    start
        Start value of a parameter or an input: one number for all elements, one number per element,
        or, if a size is a constant of the build, a function that makes them for a shape.
    min, max
        Bounds of every element, inclusive. Named values extend them.
    choices
        Values and names of the alternatives, if the variable is an Int32 that selects one.
    needs
        Requirements for the parameter to have an effect.
    named
        Values outside the declared bounds that have a name: ``{"learned": -1.0}``. People give the
        name, or a number within the declared bounds. A named value has no unit.
    starting
        The function that made ``start``, if any.
    declared
        Bounds as declared, if named values have extended them.
    """

    name: str
    description: str
    causality: Causality
    unit: str | None = None
    shape: tuple[int, ...] = ()
    start: Number | tuple[Number, ...] | Starts = 0.0
    min: float | None = None
    max: float | None = None
    type: Type = "Float64"
    variability: Variability | None = None
    choices: Mapping[int, str] | None = None
    needs: Needs = ()
    named: Mapping[str, float] | None = None
    starting: Starts | None = field(default=None, repr=False, compare=False)
    declared: Bounds | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_parts(self)
        if self.unit is not None and self.unit not in UNITS:
            raise DeclarationError(
                f"{self.name}: unit {self.unit!r} is not one of {sorted(UNITS)}, or None for a "
                "plain number"
            )
        if callable(self.start):
            object.__setattr__(self, "starting", self.start)
            try:
                object.__setattr__(self, "start", self.start(self.shape))
            except Exception as error:
                raise DeclarationError(
                    f"{self.name}: start must make start values for the shape {self.shape}, got "
                    f"{type(error).__name__}: {error}"
                ) from error
        if len(self.starts) != self.size:
            raise DeclarationError(
                f"{self.name}: {len(self.starts)} start values for {self.size} elements"
            )
        if self.variability is None:
            default: Variability = "continuous" if self.type == "Float64" else "discrete"
            object.__setattr__(
                self, "variability", "fixed" if self.causality == "parameter" else default
            )
        if self.choices is not None:
            if not self.choices:
                raise DeclarationError(f"{self.name}: choices must not be empty")
            object.__setattr__(self, "type", "Int32")
            object.__setattr__(self, "min", min(self.choices))
            object.__setattr__(self, "max", max(self.choices))
            if self.causality != "parameter":
                object.__setattr__(self, "variability", "discrete")
            elif not isinstance(self.start, int) or self.start not in self.choices:
                raise DeclarationError(
                    f"{self.name}: start {self.start!r} is not one of its choices"
                )
        if self.named and self.declared is None:
            self._extend(self.named)

    def _extend(self, named: Mapping[str, float]) -> None:
        """Let the bounds include the named values."""
        if self.shape or self.type != "Float64" or self.choices is not None:
            raise DeclarationError(f"{self.name}: only a number can have named values")
        low, high = self.min, self.max
        for name, value in named.items():
            if (low is None or value >= low) and (high is None or value <= high):
                raise DeclarationError(
                    f"{self.name}: {name!r} must be outside the bounds of numbers"
                )
        values = named.values()
        object.__setattr__(self, "declared", (low, high))
        object.__setattr__(self, "min", None if low is None else min(low, *values))
        object.__setattr__(self, "max", None if high is None else max(high, *values))

    @property
    def bounds(self) -> Bounds:
        """Bounds of the values that have no name."""
        return (self.min, self.max) if self.declared is None else self.declared

    @property
    def unnamed(self) -> Variable:
        """The variable without named values."""
        low, high = self.bounds
        return replace(self, named=None, declared=None, min=low, max=high)

    @property
    def size(self) -> int:
        """Number of elements."""
        return math.prod(self.shape)

    @property
    def rows(self) -> Dimension | None:
        """The constant of the build that sets the number of rows of the array, if any."""
        first = self.shape[0] if self.shape else None
        return first if isinstance(first, Dimension) else None

    @property
    def starts(self) -> tuple[Number, ...]:
        """Start value of each element, row by row."""
        start = self.start
        if isinstance(start, tuple):
            return start
        assert not callable(start)  # it was called when the variable was made
        return (start,) * self.size

    @property
    def elements(self) -> tuple[str, ...]:
        """Names of the elements, row by row: ``("x[1]", "x[2]")``, or the plain name."""
        if not self.shape:
            return (self.name,)
        if len(self.shape) == 1:
            return tuple(f"{self.name}[{i + 1}]" for i in range(self.shape[0]))
        rows, columns = self.shape
        return tuple(f"{self.name}[{i + 1},{j + 1}]" for i in range(rows) for j in range(columns))

    @property
    def legend(self) -> str:
        """The description with the choices or named values spelled out, if there are any."""
        if self.choices is None:
            return "; ".join(
                (self.description, *(f"{v:g}: {k}" for k, v in (self.named or {}).items()))
            )
        return f"{self.description}: " + ", ".join(f"{k} {v}" for k, v in self.choices.items())

    @property
    def key(self) -> str:
        """Key in a scenario file: the name with its unit, ``range_std_m``."""
        return self.name if self.unit is None else f"{self.name}_{UNITS[self.unit].suffix}"



@dataclass(frozen=True, slots=True)
class Terminal:
    """A group of ports that are connected as a whole (FMI 3, section 2.4.9).

    Attributes
    ----------
    name, kind
        Name in the FMU, and kind of the group. Terminals of the same kind can be connected.
    members
        Member name of each of the component's variables, the same on both sides.
    """

    name: str
    kind: TerminalKind
    description: str
    members: Mapping[str, str]

    def __post_init__(self) -> None:
        check_parts(self)


@dataclass(frozen=True, slots=True)
class Component:
    """Declaration of a component.

    Attributes
    ----------
    name
        FMI model name.
    number
        Identifies the kind of component in the key of its noise; never reused.
    interval
        Parameter that holds the tick interval [s]; None for a component without ticks.
    variant
        Choice parameter that selects one of several sets of equations; None if there is one set.
    step_size, stop_time
        Default experiment [s].
    """

    name: str
    number: int
    description: str
    variables: tuple[Variable, ...]
    interval: str | None
    variant: str | None = None
    terminals: tuple[Terminal, ...] = ()
    step_size: float = 0.1
    stop_time: float = 90.0

    def __post_init__(self) -> None:
        check_parts(self)
        names = [v.name for v in self.variables]
        if len(set(names)) != len(names):
            raise DeclarationError(f"{self.name}: variable names are not unique")
        order = [("parameter", "input", "output").index(v.causality) for v in self.variables]
        if order != sorted(order):
            raise DeclarationError(
                f"{self.name}: parameters must come first, then inputs, then outputs"
            )
        parameters = {v.name for v in self.of("parameter")}
        for variable in self.variables:
            for condition in (c for group in variable.needs for c in group):
                if condition.parameter not in parameters:
                    raise DeclarationError(
                        f"{variable.name}: must need a parameter, got {condition.parameter}"
                    )

    def __iter__(self) -> Iterator[Variable]:
        return iter(self.variables)

    def __getitem__(self, name: str) -> Variable:
        for variable in self.variables:
            if variable.name == name:
                return variable
        raise KeyError(f"{self.name} has no variable {name!r}")

    def of(self, causality: Causality) -> tuple[Variable, ...]:
        """The variables with this causality, in order."""
        return tuple(v for v in self.variables if v.causality == causality)

    @property
    def constants(self) -> Mapping[str, Dimension]:
        """Constants of the build, by name."""
        return {n.name: n for v in self.variables for n in v.shape if isinstance(n, Dimension)}

    def sized(self, **constants: int) -> Component:
        """The component for other constants of the build; it ignores constants it does not have.

        Its name and description state the constants.

        Raises
        ------
        ValueError
            The component cannot be made for this value.
        """
        own = self.constants
        new = {n: own[n].of(value) for n, value in constants.items() if n in own}
        changed = {n: value for n, value in new.items() if value != own[n]}
        if not changed:
            return self

        def resized(shape: tuple[int, ...]) -> tuple[int, ...]:
            return tuple(changed.get(n.name, n) if isinstance(n, Dimension) else n for n in shape)

        def most(bound: float | None) -> float | None:
            return changed.get(bound.name, bound) if isinstance(bound, Dimension) else bound

        return replace(
            self,
            name=self.name + "_".join(map(str, changed.values())),
            description=f"{self.description}; made for "
            + ", ".join(f"{value} {n}" for n, value in changed.items()),
            variables=tuple(
                replace(v, shape=resized(v.shape), start=v.starting or v.start, max=most(v.max))
                for v in self.variables
            ),
        )


def parameter(name: str, description: str, unit: str | None = None, **rest: object) -> Variable:
    """A fixed parameter; see `Variable` for the keywords."""
    return Variable(name, description, "parameter", unit, **rest)  # type: ignore[arg-type]


def output(name: str, description: str, unit: str | None = None, **rest: object) -> Variable:
    """An output; see `Variable` for the keywords."""
    return Variable(name, description, "output", unit, **rest)  # type: ignore[arg-type]


def input_(name: str, description: str, unit: str | None = None, **rest: object) -> Variable:
    """An input; see `Variable` for the keywords."""
    return Variable(name, description, "input", unit, **rest)  # type: ignore[arg-type]


def choice(
    name: str, description: str, choices: Mapping[int, str], start: int, needs: Needs = ()
) -> Variable:
    """A parameter that selects one of several named alternatives."""
    return parameter(name, description, start=start, choices=choices, needs=needs)


def switch(name: str, description: str, start: bool, needs: Needs = ()) -> Variable:
    """A parameter that turns something on or off."""
    return parameter(name, description, start=start, type="Boolean", needs=needs)


def tick_interval(name: str, description: str, needs: Needs = ()) -> Variable:
    """The parameter that holds a component's tick interval [s]."""
    return parameter(name, description, "s", start=0.1, min=1e-6, max=1e6, needs=needs)


def noise_keys(*needs: tuple[Condition, ...]) -> tuple[Variable, Variable]:
    """Seed and stream of a component with noise: equal pairs draw the same noise.

    Parameters
    ----------
    needs
        Requirements for anything to be random; see `Variable`.
    """
    return (
        Variable("seed", "Seed of every random number of this component", "parameter",
                 start=1, min=0, max=INT32_MAX, type="Int32", needs=needs),
        Variable("stream", "Separates components of the same kind and seed", "parameter",
                 start=0, min=0, max=2**16 - 1, type="Int32", needs=needs),
    )


def is_one_of(name: str, choices: Mapping[int, str], *chosen: str) -> Condition:
    """The condition that a choice is one of the given names."""
    return Condition(name, tuple(value for value, label in choices.items() if label in chosen))


def number_of(choices: Mapping[int, str], name: str) -> int:
    """The number of a choice in the FMU.

    Raises
    ------
    KeyError
        No choice has this name.
    """
    for number, known in choices.items():
        if known == name:
            return number
    raise KeyError(f"a choice must be one of {', '.join(choices.values())}, got {name!r}")


def not_zero(*names: str) -> tuple[Condition, ...]:
    """Conditions that parameters are not zero, one per parameter."""
    return tuple(map(Condition, names))

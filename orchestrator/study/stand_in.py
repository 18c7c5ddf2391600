"""A Python function in place of the simulation, such as a published test function.

It is called once for each run, with the values of the factors by name, and returns one number, or
NaN if there is none::

    def ishigami(x1, x2, x3, a=7.0, b=0.1):
        return sin(x1) + a * sin(x2) ** 2 + b * x3**4 * sin(x1)

A function with a parameter ``seed`` receives the seed of the run: everything random in it must use
this seed. Other parameters need defaults.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import cloudpickle
import numpy as np
from sblcosim.fmus import stopping
from sblcosim.fmus.host.watch import watch

from ..errors import ConfigurationError, escaped, instance, nearest, quoted, shortened
from ..simulation.children.children import Children
from ..simulation.code.user_code import Gone, InFile, by_value, fingerprint, foreseen, raised
from ..simulation.user.files import call, function_of_file
from .distributions import Floats
from .space import SEED_FACTOR, Sample

OneRun = tuple[Mapping[str, Any], int]
"""Values of the factors by name, and the seed."""


class StandIn:
    """A user's function in place of the simulation.

    Attributes
    ----------
    function
        Function of one run.
    name
        The function's name.
    origin, sha256
        ``file.py:function``, or module and name; and the hash of the file, or of the source and
        everything that it refers to.
    """

    # Not a dataclass: pydantic would convert it when a study holds it.
    def __init__(self, function: Callable[..., Any], origin: str, sha256: str) -> None:
        self.function, self.origin, self.sha256 = function, origin, sha256
        self.name = origin.rpartition(":")[2]
        self.parameters = inspect.signature(function).parameters

    def __reduce__(self) -> Any:
        if isinstance(self.function, InFile):
            return StandIn, (self.function, self.origin, self.sha256)
        # By value: a worker may have neither the file nor the module.
        return _unpacked, (by_value(self.function), self.origin, self.sha256)

    def __repr__(self) -> str:
        return f"<function {self.name} from {self.origin} in place of the simulation>"

    @property
    def is_random(self) -> bool:
        """Whether it takes the seed of the run."""
        return SEED_FACTOR in self.parameters

    def given(self, values: Mapping[str, Any], seed: int) -> Mapping[str, Any]:
        """The arguments of a run."""
        return {**values, SEED_FACTOR: seed} if self.is_random else values

    def check(self, factors: Sequence[str]) -> None:
        """Refuse a function whose parameters are not these factors.

        Raises
        ------
        ConfigurationError
            A factor is not a parameter, or a parameter without default is not a factor.
        """
        kinds = inspect.Parameter
        known = {
            name for name, parameter in self.parameters.items()
            if parameter.kind in (kinds.POSITIONAL_OR_KEYWORD, kinds.KEYWORD_ONLY)
        }
        anything = any(p.kind is kinds.VAR_KEYWORD for p in self.parameters.values())
        for name in factors:
            if name not in known and not anything:
                raise ConfigurationError(
                    f"model: {self.name} must take the factor {quoted(name)} by its name, got the "
                    f"parameters {', '.join(self.parameters) or 'none'}{nearest(name, known)}"
                )
        for name, parameter in self.parameters.items():
            needed = parameter.default is kinds.empty and parameter.kind not in (
                kinds.VAR_KEYWORD, kinds.VAR_POSITIONAL
            )
            if needed and name not in (*factors, SEED_FACTOR):
                raise ConfigurationError(
                    f"model: {self.name} must have a default for {quoted(name)}, which is no "
                    f"factor, got none{nearest(name, factors)}"
                )

    def __call__(self, values: Mapping[str, Any], seed: int) -> float:
        """The number of one run; NaN if there is none. `values_of` calls functions from files.

        Raises
        ------
        ConfigurationError
            The function has raised an exception, or has not returned a number.
        """
        given = self.given(values, seed)
        try:
            value = self.function(**given)
        except ConfigurationError:
            raise
        except foreseen() as error:
            raise ConfigurationError(
                f"model: {self.name} must not raise an exception, got {raised(error)} at "
                f"{_shown_values(given)}"
            ) from error
        if isinstance(value, int | float | np.number | np.bool_) and not isinstance(
            value, np.complexfloating
        ):
            return float(value)
        raise ConfigurationError(
            f"model: {self.name} must return a number, got {shortened(instance(value))} at "
            f"{_shown_values(given)}"
        )


def model_of(source: str | Callable[..., Any], folder: Path | None = None) -> StandIn:
    """The function in place of the simulation.

    Parameters
    ----------
    source
        ``file.py:function``, identified by the file with all its imports, or a function, identified
        by its code and everything it refers to.
    folder
        Folder that the file may be relative to; default: the current one.

    Raises
    ------
    ConfigurationError
        There is no such file or function, the file cannot be run, or a function refers to something
        that cannot identify a run.
    """
    if isinstance(source, str):
        if ":" not in source:
            raise ConfigurationError(f"model: must be FILE.py:FUNCTION, got {quoted(source)}")
        function, sha256 = function_of_file(source, folder or Path(), "model")
        return StandIn(function, source, sha256)
    if not inspect.isfunction(source):
        raise ConfigurationError(
            f"model: must be FILE.py:FUNCTION or a function, got {shortened(instance(source))}"
        )
    origin = f"{source.__module__}:{source.__name__}"
    return StandIn(source, origin, fingerprint(source, "model", source.__name__))


def stand_in_of(origin: str, sha256: str) -> StandIn:
    """A stand-in of which only origin and hash are known."""
    gone = Gone(f"model: must be available to do more runs, got none; it is {origin}")
    return StandIn(gone, origin, sha256)


def evaluate(model: StandIn, sample: Sample) -> Floats:
    """The numbers of all runs of a sample; shape (rows,).

    Raises
    ------
    ConfigurationError
        The parameters are not the factors, or a run fails.
    """
    names = [factor.name for factor in sample.factors]
    model.check(names)
    columns = zip(*(sample.values[name].tolist() for name in names), strict=True)
    runs = zip(columns, sample.seeds.tolist(), strict=True)
    given = [(dict(zip(names, values, strict=True)), seed) for values, seed in runs]
    return values_of(model, given)


def values_of(
    model: StandIn, runs: Sequence[OneRun], children: Children | None = None
) -> Floats:
    """The numbers of some runs; a child process calls a function from a file.

    Parameters
    ----------
    runs
        Values of the factors by name, and the seed, of each run.
    children
        Child processes to use; None: any.

    Raises
    ------
    ConfigurationError
        A run fails, does not return, or ends its process.
    """
    if not isinstance(model.function, InFile):
        return _values(model, runs)
    found: Floats = call(
        partial(_values, model, runs), model.function.key,
        {"model": f"the function {escaped(Path(model.origin).name)}"},
        cases=_Cases(model, runs), children=children,
    )  # fmt: skip
    return found


def _values(model: StandIn, runs: Sequence[OneRun]) -> Floats:
    """The same, in a process that may call the function."""
    noted = watch().progress()
    found = np.empty(len(runs))
    with np.errstate(all="ignore"):
        for row, (values, seed) in enumerate(runs):
            stopping.check()
            noted.row = row
            with watch().calling("model", "its call"):
                found[row] = model(values, seed)
    return found


class _Cases(Sequence[str]):
    """Description of each run, if it is needed."""

    def __init__(self, model: StandIn, runs: Sequence[OneRun]) -> None:
        self._model, self._runs = model, runs

    def __len__(self) -> int:
        return len(self._runs)

    def __getitem__(self, row: Any) -> Any:
        return _shown_values(self._model.given(*self._runs[row]))


def _shown_values(values: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{name} {value:.6g}" if isinstance(value, float) else f"{name} {value}"
        for name, value in values.items()
    )


def _unpacked(packed: bytes, origin: str, sha256: str) -> StandIn:
    return StandIn(cloudpickle.loads(packed), origin, sha256)

"""Files of the user, run and inspected: the child's side of `files`.

Each function is called in a child, and the user reads its errors. `declared` also handles classes
that the user gives in Python.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

from sblcosim.fmus.host.watch import watch
from sblcosim.models.declaration import Variable

from ...errors import CodeChangedError, ConfigurationError, SblcosimError, instance, nearest, quoted
from ..code.local_files import Loaded
from ..code.user_code import CONSTRUCTOR, InFile, PythonSource, by_value, foreseen, raised, run_file
from ..receiver import Receiver

IMPORT = "its import"
"""Name for running a file in failure messages."""
_METHODS = ("variables", "initialise", "do_step")


def component(
    path: Path, content: bytes, key: str, name: str | None, where: str
) -> tuple[InFile, str]:
    """The class in a file that makes a component, and the identity of the file.

    Parameters
    ----------
    key
        Identifies the file.
    name
        Name of the class; None: the only suitable class.
    where
        Beginning of messages.

    Raises
    ------
    ConfigurationError
        There is no such class, or the file cannot be run.
    """
    module, sha256, files = _run(path, content, where)
    known = {n: t for n, t in vars(module).items() if _is_component(t, module)}
    if name is None:
        bare = [n for n, t in vars(module).items() if _lacks_base(t, module)]
        if not known and len(bare) == 1:
            raise _without_base(where, path, bare[0])
        if len(known) != 1:
            got = ", ".join(f"{path.name}:{n}" for n in known) or "none"
            raise ConfigurationError(
                f"{where} must be FILE.py:CLASS if the file does not have a single class with "
                f"{', '.join(_METHODS)}, got {got}"
            )
        (name,) = known
    maker = vars(module).get(name)
    if not callable(maker):
        got = quoted(name) if maker is None else f"{quoted(name)}, {instance(maker)}"
        others = nearest(name, known) or (f"; it has {', '.join(known)}" if known else "")
        raise ConfigurationError(
            f"{where} must name a class of {quoted(path.name)}, got {got}{others}"
        )
    if _lacks_base(maker, module):
        raise _without_base(where, path, name)
    derived = isinstance(maker, type) and issubclass(maker, Receiver)
    return InFile(path, content, name, key, files, is_receiver=derived), sha256


def function(
    path: Path, content: bytes, key: str, name: str, where: str
) -> tuple[InFile, str]:
    """A function of a file, and the identity of the file.

    Raises
    ------
    ConfigurationError
        There is no such function, or the file cannot be run.
    """
    module, sha256, files = _run(path, content, where)
    functions = {n: thing for n, thing in vars(module).items() if inspect.isfunction(thing)}
    if name not in functions:
        raise ConfigurationError(
            f"{where} must name a function of {quoted(path.name)}, got {quoted(name)}"
            f"{nearest(name, functions)}"
        )
    parameters = tuple(
        parameter.replace(
            annotation=parameter.empty,
            default=parameter.empty if parameter.default is parameter.empty else None,
        )
        for parameter in inspect.signature(functions[name]).parameters.values()
    )
    return InFile(path, content, name, key, files, parameters=parameters), sha256


def declared(where: str, maker: Any) -> tuple[Variable, ...]:
    """The variables of a Python component; makes an object to ask it.

    Parameters
    ----------
    where
        Start of error messages.

    Raises
    ------
    ConfigurationError
        The component cannot be made, or the object is not a component.
    """
    if not callable(maker):
        raise ConfigurationError(
            f"{where}: must be a class or function that makes the component, got {instance(maker)}"
        )
    name = getattr(maker, "__qualname__", instance(maker))
    maker = maker.maker if isinstance(maker, PythonSource) else maker
    if isinstance(maker, InFile):
        with watch().calling(where, IMPORT):
            maker = maker.load()
    try:
        inspect.signature(maker).bind()
    except TypeError as error:
        raise ConfigurationError(
            f"{where}: must make the component without arguments, got {name} ({error})"
        ) from None
    except ValueError:  # a callable in C has no signature
        pass
    try:
        with watch().calling(where, CONSTRUCTOR):
            component = maker()
    except foreseen() as error:
        raise ConfigurationError(
            f"{where}: must make the component, got {raised(error, name)}"
        ) from error
    try:
        with watch().calling(where, "variables"):
            return _variables(where, name, component)
    except SblcosimError:
        raise
    except foreseen() as error:
        raise ConfigurationError(
            f"{where}: must declare its variables, got {raised(error, name)}"
        ) from error


def _variables(where: str, name: str, component: Any) -> tuple[Variable, ...]:
    missing = [method for method in _METHODS if not hasattr(component, method)]
    if missing:
        raise ConfigurationError(
            f"{where}: must make a component, got {name}, whose object has no "
            f"{' and no '.join(missing)}; see sblcosim.Receiver and sblcosim.PythonComponent"
        )
    declared: Any = component.variables
    must = f"{where}: variables must be a sequence of Variable, got"
    if not isinstance(declared, Iterable) or isinstance(declared, str):
        raise ConfigurationError(f"{must} {instance(declared)}")
    variables: tuple[Variable, ...] = tuple(declared)
    for variable in variables:
        if not isinstance(variable, Variable):
            raise ConfigurationError(f"{must} {instance(variable)} in it")
    return variables


def packed(thing: InFile) -> InFile:
    """A class or function by value, for processes that do not have the file.

    Raises
    ------
    ConfigurationError
        Something that it refers to cannot be sent to another process.
    """
    try:
        return replace(thing, content=None, packed=by_value(thing.load()))
    except CodeChangedError:
        raise
    except BaseException as error:
        raise ConfigurationError(
            f"{thing.path.name}:{thing.name} must be something that other processes can receive, "
            "got "
            f"{raised(error)}"
        ) from error


def _run(path: Path, content: bytes, where: str) -> Loaded:
    with watch().calling(where.partition(":")[0], IMPORT):
        return run_file(path, content, where)


def _lacks_base(thing: Any, module: ModuleType) -> bool:
    """Whether this is a class of the file like a receiver's that is no component."""
    own = inspect.isclass(thing) and thing.__module__ == module.__name__
    return own and hasattr(thing, "update") and not any(hasattr(thing, it) for it in _METHODS)


def _without_base(where: str, path: Path, name: str) -> ConfigurationError:
    return ConfigurationError(
        f"{where} must be a subclass of sblcosim.Receiver, got class {name} of "
        f"{quoted(path.name)}; write 'class {name}(sblcosim.Receiver):'"
    )


def _is_component(thing: Any, module: ModuleType) -> bool:
    own = inspect.isclass(thing) and thing.__module__ == module.__name__
    return own and all(hasattr(thing, method) for method in _METHODS)

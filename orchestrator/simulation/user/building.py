"""Builds a receiver in a folder of the user, from declaration to FMU; runs in a child process.

The functions are called there, like those of `loading`, and the user reads their errors.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Event, Thread
from types import ModuleType
from typing import TYPE_CHECKING, Any

from sblcosim.fmus.build import factory
from sblcosim.fmus.build.ingredients import of_user
from sblcosim.fmus.host.watch import watch
from sblcosim.fmus.standard import Fmi
from sblcosim.models import COMPONENTS, check_unique
from sblcosim.models.declaration import Component, Variable
from sblcosim.models.receiver.receiver import Beacons, ReceiverDeclaration

from ...errors import ConfigurationError, SblcosimError, instance, nearest
from ..code.user_code import foreseen, raised, run_file
from .loading import IMPORT

if TYPE_CHECKING:
    from sblcosim.models.equations import Model

NAME = "RECEIVER"
"""Name under which the file declares its receiver."""
COMPILING_S = 600
"""Time limit for the compiler [s]."""
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
Asked = tuple[str, str, int, Fmi]
"""File name of the FMU, description, number of beacons, and FMI version."""
Built = tuple[Path, tuple[Variable, ...], str, Mapping[Beacons, str]]
"""The FMU, its parameters, its purpose, and the beacons that it is unfit for."""


def receiver(
    path: Path, content: bytes, key: str, asked: Asked, where: str
) -> tuple[Built, str]:
    """The FMU of the receiver that a file declares, and the identity of the file.

    Raises
    ------
    ConfigurationError
        The file cannot be run, or declares no receiver that can be built.
    """
    who = where.partition(":")[0]
    with watch().calling(who, IMPORT):
        module, sha256, _ = run_file(path, content, where)
    with watch().calling(who, "its declaration"):
        declaration, component, of, plain = _declared(module, path, sha256, asked, where)
    name, readme, _, fmi = asked
    with ExitStack() as built:

        def model() -> Model:
            with watch().calling(who, "its equations"):
                made = replace(_model(component, declaration, where), readme=readme)
            built.enter_context(_going_on(who))
            return made

        fmu = factory.kept_fmu(f"{name}.fmu", of, model, fmi)
    return (fmu, *plain), sha256


@contextmanager
def _going_on(who: str) -> Iterator[None]:
    """Tell the parent that the process is alive: a compiler takes longer than a call may."""
    done = Event()

    def beat() -> None:
        for _ in range(COMPILING_S):
            with watch().calling(who, "its compilation"):
                pass
            if done.wait(1.0):
                return

    Thread(target=beat, daemon=True).start()
    try:
        yield
    finally:
        done.set()


_Plain = tuple[tuple[Variable, ...], str, Mapping[Beacons, str]]


def _declared(
    module: ModuleType, path: Path, sha256: str, asked: Asked, where: str
) -> tuple[ReceiverDeclaration, Component, str, _Plain]:
    """A module's declaration for the requested beacons; its key, and facts to report about it."""
    declaration = _declaration(module, path, where)
    _, readme, beacons, fmi = asked
    try:
        component = declaration.component.sized(beacons=beacons)
    except ValueError as error:
        raise ConfigurationError(f"{where}: {error}") from None
    try:
        of = of_user(repr((sha256, component, readme)), fmi)
        plain = (
            tuple(map(_plain, component.of("parameter"))), declaration.purpose,
            {**declaration.unfit},
        )  # fmt: skip
    except SblcosimError:
        raise
    except foreseen() as error:
        raise ConfigurationError(
            f"{where}: {path.name} must have a {NAME} that can be read, got {raised(error)}"
        ) from error
    return declaration, component, of, plain


def _declaration(module: ModuleType, path: Path, where: str) -> ReceiverDeclaration:
    """The declaration of a module, checked."""
    must = f"{where}: {path.name} must have {NAME}, a ReceiverDeclaration, got"
    if NAME not in vars(module):
        names = [name for name in vars(module) if not name.startswith("_")]
        raise ConfigurationError(f"{must} none{nearest(NAME, names)}")
    declaration = vars(module)[NAME]
    if not isinstance(declaration, ReceiverDeclaration):
        raise ConfigurationError(f"{must} {instance(declaration)}")
    component: Any = declaration.component
    if not isinstance(component, Component):
        raise ConfigurationError(
            f"{where}: {NAME} must hold a Component, as receiver(...) makes it, got "
            f"{instance(component)}"
        )
    if not _IDENTIFIER.fullmatch(component.name):
        raise ConfigurationError(
            f"{where}: its name must consist of letters, digits and _, and not begin with a digit, "
            "got "
            f"{component.name!r}"
        )
    try:
        check_unique({**COMPONENTS, path.parent.name: component})
    except ValueError as error:
        raise ConfigurationError(f"{where}: {str(error).removeprefix('components: ')}") from None
    if not callable(declaration.equations):
        raise ConfigurationError(
            f"{where}: {NAME} must have equations, a function that makes them, got "
            f"{instance(declaration.equations)}"
        )
    return declaration


def _model(component: Component, declaration: ReceiverDeclaration, where: str) -> Model:
    """The equations of a receiver as functions, made by the user's code."""
    from sblcosim.models.equations import Equations, build

    assert declaration.equations is not None
    try:
        equations: Any = declaration.equations()
    except SblcosimError:
        raise
    except foreseen() as error:
        raise ConfigurationError(
            f"{where}: must make its equations, got {raised(error)}"
        ) from error
    if not isinstance(equations, Equations):
        raise ConfigurationError(
            f"{where}: equations must make Equations, got {instance(equations)}"
        )
    try:
        return build(component, equations)
    except foreseen() as error:
        raise ConfigurationError(
            f"{where}: its equations must fit its declaration, got {raised(error)}"
        ) from error


def _plain(variable: Variable) -> Variable:
    """A variable without functions, for the process that asked."""
    start = variable.starts if variable.shape else variable.starts[0]
    return replace(variable, start=start, starting=None)

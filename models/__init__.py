"""Declarations of all components, by the name of their FMU."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from itertools import combinations
from typing import TYPE_CHECKING

from .acoustics.variables import COMPONENT as _ACOUSTICS
from .declaration import Component, DeclarationError
from .platform.variables import COMPONENT as _PLATFORM
from .range_model.variables import COMPONENT as _RANGE_MODEL
from .receiver.receivers import FOUND
from .target.variables import COMPONENT as _TARGET

if TYPE_CHECKING:
    from .equations import Equations

RECEIVERS: Mapping[str, Component] = {name: it.component for name, it in FOUND.items()}
COMPONENTS: Mapping[str, Component] = {
    "target": _TARGET,
    "platform": _PLATFORM,
    "acoustics": _ACOUSTICS,
    **RECEIVERS,
    "range_model": _RANGE_MODEL,
}


def check_unique(components: Mapping[str, Component]) -> None:
    """Check that no two components share a name or the number that keeps their noise apart.

    Raises
    ------
    DeclarationError
        Two components share a name or a number; the message names both components.
    """
    for what in ("number", "name"):
        first: dict[object, str] = {}
        for name, component in components.items():
            value = getattr(component, what)
            other = first.setdefault(value, name)
            if other != name:
                raise DeclarationError(
                    f"components: each must have a {what} of its own, got {value!r} for {other} "
                    f"and {name}"
                )


check_unique(COMPONENTS)


def declared(name: str, **constants: int) -> Component:
    """Declaration of a component, by the name of its FMU and the constants of the build.

    Raises
    ------
    KeyError
        No component has this name.
    ValueError
        The component cannot be made for this value.
    """
    return COMPONENTS[name].sized(**constants)


def file_name(name: str, **constants: int) -> str:
    """Name of a component's file, without suffix; it contains any constants that are unusual."""
    usual, sized = COMPONENTS[name].name, declared(name, **constants).name
    return name + sized.removeprefix(usual)


def of_file(stem: str) -> tuple[str, dict[str, int]] | None:
    """Component and constants for a name made by `file_name`; None if it is no such name."""
    name = stem.rstrip("0123456789_")
    component = COMPONENTS.get(name)
    if component is None or stem == name:
        return None if component is None else (name, {})
    values = stem.removeprefix(name).split("_")
    for chosen in combinations(component.constants, len(values)):
        try:
            constants = dict(zip(chosen, map(int, values), strict=True))
            if file_name(name, **constants) == stem:
                return name, constants
        except ValueError:
            continue
    return None


def module_of(name: str) -> tuple[str, str]:
    """Folder and module that hold the equations of a component."""
    if name not in FOUND:
        return name, "equations"
    return "receiver", name if FOUND[name].equations is None else f"receivers.{name}"


def equations_of(name: str) -> Equations | Mapping[int, Equations]:
    """Equations of a component, or of each of its variants. Needs CasADi."""
    own = FOUND[name].equations if name in FOUND else None
    module = import_module(".".join((__name__, *module_of(name))))
    equations: Equations | Mapping[int, Equations] = module.EQUATIONS if own is None else own()
    return equations


__all__ = [
    "COMPONENTS", "RECEIVERS", "declared", "equations_of", "file_name", "module_of", "of_file",
]

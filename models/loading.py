"""Load a component's model by the name of its FMU: the only path from a name to equations."""

from __future__ import annotations

from importlib import import_module

from . import COMPONENTS, module_of
from .equations import Model, build


def load(name: str) -> Model:
    """Build the model of a component by the name of its FMU.

    Raises
    ------
    KeyError
        There is no such component.
    """
    component = COMPONENTS[name]
    equations = import_module(".".join(("", *module_of(name))), __package__).EQUATIONS
    return build(component, equations)

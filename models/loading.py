"""Load a component's model by the name of its FMU: the only path from a name to equations."""

from __future__ import annotations

from . import declared, equations_of
from .equations import Model, build


def load(name: str, **constants: int) -> Model:
    """Build the model of a component by the name of its FMU and the constants of the build.

    Raises
    ------
    KeyError
        No component has this name.
    ValueError
        The component cannot be made for this value.
    """
    return build(declared(name, **constants), equations_of(name))

"""Load a component's model by the name of its FMU: the only path from a name to equations."""

from __future__ import annotations

from . import declared, equations_of
from .equations import Model, build


def load(name: str, **constants: int) -> Model:
    """Build the model of a component by the name of its FMU, for some constants of the build.

    Raises
    ------
    KeyError
        There is no such component.
    ValueError
        It cannot be made for such a value.
    """
    return build(declared(name, **constants), equations_of(name))

"""The modules of a folder: they are found, not listed."""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib import import_module
from types import ModuleType
from typing import TypeVar

from .parts import DeclarationError, check_parts

_D = TypeVar("_D")


def modules_of(package: str) -> Mapping[str, ModuleType]:
    """The modules of a package, sorted by name."""
    return {name: import_module(f"{package}.{name}") for name in _files(package)}


def _files(package: str) -> list[str]:
    # Not pkgutil: importing it takes 5 ms at the start of every command.
    files = {file for folder in import_module(package).__path__ for file in os.listdir(folder)}
    names = sorted(file.removesuffix(".py") for file in files if file.endswith(".py"))
    return [name for name in names if name != "__init__"]


def declared(package: str, name: str, kind: type[_D]) -> Mapping[str, _D]:
    """What the modules of a package declare under one name.

    Raises
    ------
    DeclarationError
        A module cannot be imported; it declares nothing under this name, or something of another
        type; or its declaration lacks a part, or has an unknown one, or one of a wrong type. The
        message names the file.
    """
    found: dict[str, _D] = {}
    for file in _files(package):
        try:
            module = import_module(f"{package}.{file}")
        except DeclarationError as error:
            raise DeclarationError(f"{file}.py: {error}") from error
        except TypeError as error:  # of a declaration without one of its parts
            raise DeclarationError(f"{file}.py: must declare {name} completely: {error}") from error
        except Exception as error:  # whatever a file of a user raises
            raise DeclarationError(
                f"{file}.py: must be a module that can be imported, got {type(error).__name__}: "
                f"{error}"
            ) from error
        one = getattr(module, name, None)
        if not isinstance(one, kind):
            got = "none" if one is None else f"{type(one).__name__}"
            raise DeclarationError(
                f"{file}.py: must declare {name}, of the type {kind.__name__}, got {got}"
            )
        number = getattr(one, "number", 1)
        if type(number) is not int or number < 1:
            raise DeclarationError(
                f"{file}.py: {name}: number must be a whole number from 1, got {number!r}"
            )
        try:
            check_parts(one)
        except DeclarationError as error:
            raise DeclarationError(f"{file}.py: {error}") from error
        found[file] = one
    return found


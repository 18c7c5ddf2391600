"""Libraries of FMUs: unpacked once per process, loaded, unloaded, and recognised as ours or not."""

from __future__ import annotations

import ctypes
import os
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from fmpy import freeLibrary

from ..build.ours import is_build
from ..errors import FmuError
from ..files import scratch
from ..read.archive import opened
from ..read.ports import Fmu
from .watch import watch

_OURS: dict[str, bool] = {}


def ours(fmu: Fmu) -> bool:
    """Whether this project built an FMU; nothing in it is run to find out."""
    if fmu.sha256 not in _OURS:
        _OURS[fmu.sha256] = is_build(fmu.path, fmu.identifier, fmu.sha256)
    return _OURS[fmu.sha256]


def trust(sha256s: Iterable[str]) -> None:
    """Treat these FMUs as ours: their sender has checked."""
    _OURS.update(dict.fromkeys(sha256s, True))


_FOLDERS: dict[str, Path] = {}


def unpacked(fmu: Fmu) -> Path:
    """Folder with the FMU's contents, removed when the process ends."""
    folder = _FOLDERS.get(fmu.sha256)
    if folder is None:
        folder = Path(tempfile.mkdtemp(dir=scratch()))
        with opened(fmu.path) as archive:
            if archive.sha256 != fmu.sha256:
                raise FmuError(f"{fmu.path}: must not change while it is used, got another file")
            archive.unpack(folder)
        _FOLDERS[fmu.sha256] = folder
    return folder


def binary_of(fmu: Fmu) -> Path:
    """The FMU's shared library for this machine, unpacked."""
    return unpacked(fmu) / fmu.library


_OPENED: dict[str, list[int]] = {}
"""Handles by path, of the libraries to be unloaded."""


def load(library: str) -> None:
    """Load a library without Python's global lock, which ctypes would hold during the loading."""
    if not watch().direct or sys.platform == "win32":  # on Windows ctypes does not hold it
        return
    here = os.getcwd()
    os.chdir(os.path.dirname(library))
    try:
        open_ = _system("dlopen", ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int)
        handle = open_(os.fsencode(library), os.RTLD_NOW)
    finally:
        os.chdir(here)
    if handle:
        _OPENED.setdefault(library, []).append(handle)


def _system(name: str, result: Any, *arguments: Any) -> Any:
    function = ctypes.CDLL(None)[name]
    function.restype, function.argtypes = result, arguments
    return function


def unload(library: str, handles: Iterable[int]) -> None:
    """Unload a library, whether `load` or another function opened it."""
    for handle in (*_OPENED.pop(library, ()), *handles):
        if sys.platform == "win32":
            freeLibrary(handle)
        else:
            _system("dlclose", ctypes.c_int, ctypes.c_void_p)(handle)

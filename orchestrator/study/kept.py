"""Finished runs of a command in progress: after a kill, the same command continues with them.

They lie next to the folder of its result, in ``NAME-unfinished``, until that is written. Each study
has a folder, named after everything that defines its runs, with parts as in a study's folder.
Whatever another command finds there is therefore valid for it too, and damaged runs are repeated.
"""

from __future__ import annotations

import hashlib
import json
import os
import warnings
from contextlib import suppress
from pathlib import Path

from sblcosim.fmus import files

from ..artifacts import NOTE, UNFINISHED
from ..errors import ConfigurationWarning, DamageWarning, resolved
from ..manifests import OTHER
from . import parts
from .parts import Parts

_TOLD = (
    "Finished runs of a command of sblcosim that has not ended yet. The same command continues "
    "with them, and removes them when its result is written. They may be deleted.\n"
)


class Kept:
    """The finished runs of a command.

    Parameters
    ----------
    result
        Folder of the command's result, which need not exist.

    Attributes
    ----------
    folder
        Where the runs are.
    """

    def __init__(self, result: str | Path) -> None:
        path = resolved(result)
        self.folder = path.with_name(f"{path.name}{UNFINISHED}")
        self._used: dict[Path, None] = {}
        self._above = [it for it in self.folder.parents if not os.path.exists(it)]

    def of(self, *identity: object) -> Path | None:
        """The folder for some runs; None, with a warning, if there can be none.

        Parameters
        ----------
        identity
            Everything that defines the runs except their numbers, as plain data.
        """
        name = hashlib.sha256(json.dumps(identity).encode()).hexdigest()[:16]
        note, folder = self.folder / NOTE, self.folder / name
        try:
            files.make_folder(folder)
            if not note.exists():
                files.write_file(note, _TOLD.encode(), durable=False)
        except OSError as error:
            for empty in (folder, self.folder):
                with suppress(OSError):
                    empty.rmdir()
            warnings.warn(
                f"{self.folder}: must be a folder that can be made, to keep finished runs, got "
                f"{error.strerror or error}; if this is interrupted, it starts from the beginning",
                ConfigurationWarning, stacklevel=3,
            )
            return None
        self._used[folder] = None
        return folder

    @property
    def runs(self) -> int:
        """Number of requested runs that are kept."""
        return sum(len(parts.finished(_looked_through(folder)[0])) for folder in self._used)

    def remove(self) -> None:
        """Remove what this command has used, and the folder if nothing else is in it."""
        for folder in self._used:
            files.sweep(folder)
            if not os.path.isdir(folder) or any(map(files.is_hidden, os.listdir(folder))):
                continue  # another process is using it
            files.remove(folder)
        if os.path.isdir(self.folder) and {*os.listdir(self.folder)} <= {NOTE}:
            files.remove(self.folder)
        for folder in self._above:  # if it was never used
            with suppress(OSError):
                folder.rmdir()


def sound(folder: Path) -> Parts:
    """The unchanged parts in a folder; others are removed, with a warning."""
    there, damaged = _looked_through(folder)
    for path in damaged:
        files.remove(path)
        warnings.warn(f"{path}: {OTHER}; its runs are repeated", DamageWarning, stacklevel=3)
    return there


def _looked_through(folder: Path) -> tuple[Parts, list[Path]]:
    return parts.looked_through(folder, {})

"""Receivers in folders of the user, declared like ours: identified by content and cached."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from sblcosim.fmus.standard import Fmi
from sblcosim.models.declaration import Variable
from sblcosim.models.ports import BEACONS
from sblcosim.models.receiver.receiver import Beacons

from ...errors import ConfigurationError, nearest, quoted, shortened
from ..code.user_code import raised, read_file
from . import building
from .files import found

ENTRY, README = "receiver.py", "README.md"
"""The file with the declaration, and the documentation of the receiver."""


@dataclass(frozen=True)
class UserReceiver:
    """What a folder declares, and the FMU built from it.

    Attributes
    ----------
    parameters
        Parameters as declared, for `beacons`.
    purpose, unfit
        See `sblcosim.models.receiver.receiver.ReceiverDeclaration`.
    """

    folder: Path
    fmu: Path
    beacons: int
    fmi: Fmi
    parameters: tuple[Variable, ...]
    purpose: str
    unfit: Mapping[Beacons, str]


_BY_FMU: dict[Path, UserReceiver] = {}


def of_folder(text: str, beacons: int = BEACONS, fmi: Fmi = 2) -> UserReceiver:
    """The receiver of a folder; its FMU is built unless the cache has one with the same content.

    It is identified by ``receiver.py``, the local files that this imports, and ``README.md``.

    Parameters
    ----------
    beacons, fmi
        Number of beacons and FMI version of the run, for which it is made.

    Raises
    ------
    ConfigurationError
        There is no such file, it cannot be run, or it declares no receiver that can be built.
    """
    where = f"receiver: {quoted(text)}"
    folder = Path(os.path.abspath(text))
    path = folder / ENTRY
    if not path.is_file():
        try:
            names = sorted(os.listdir(folder))
        except OSError as error:
            raise ConfigurationError(f"{where}: must be readable, got {raised(error)}") from None
        raise ConfigurationError(
            f"{where}: must be a folder with {ENTRY}, got {shortened(', '.join(names) or 'none')}"
            f"{nearest(ENTRY, names)}"
        )
    content = read_file(path, f"{where} must have {ENTRY}, got", where)
    readme = folder / README
    told = readme.read_text("utf-8", "replace") if readme.is_file() else ""
    asked = (folder.name or "receiver", told, int(beacons), fmi)
    (fmu, parameters, purpose, unfit), _ = found(building.receiver, path, content, asked, where)
    known = UserReceiver(folder, fmu, int(beacons), fmi, parameters, purpose, unfit)
    before = _BY_FMU.get(fmu)
    if before is not None and before.folder == folder:
        return before
    _BY_FMU[fmu] = known
    return known


def of_fmu(source: object) -> UserReceiver | None:
    """The receiver in a folder from which an FMU was built, in this process."""
    return _BY_FMU.get(source) if isinstance(source, Path) else None

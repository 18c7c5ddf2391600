"""The archive of an FMU; no other module opens one.

Reading any file, whoever wrote it, takes a bounded amount of memory, disk and time: the bounds
below are checked before anything is allocated or unpacked. They are far above any FMU that we know.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from ..errors import FmuError, one_line
from ..files import KINDS

MAX_FILE = 1 << 30
"""Maximum size of an FMU file in bytes."""
MAX_ENTRIES = 20_000
"""Maximum number of files and folders in an FMU."""
MAX_UNPACKED = 1 << 30
"""Maximum size of all files of an FMU together, unpacked, in bytes."""
MAX_DEPTH = 100
"""Maximum depth of folders."""
MAX_XML = 32 << 20
"""Maximum size of one of the standard's XML files, such as modelDescription.xml, in bytes."""

_MAX_READ = 16 << 20
"""Bytes read at once. Only an archive's directory can ask for more."""
_PIECE = 1 << 20

_KINDS = {stat.S_IFDIR: "a folder", **KINDS}
_BROKEN = (
    zipfile.BadZipFile, zlib.error, struct.error, EOFError, OSError, OverflowError, RuntimeError,
    ValueError,
)  # fmt: skip
"""Exceptions that reading a damaged archive may raise."""


class _Bounded(io.FileIO):
    """A file that never returns more at once than any intact FMU asks for."""

    def read(self, size: int | None = -1, /) -> bytes:
        if size is not None and size > _MAX_READ:
            raise zipfile.BadZipFile(f"a directory of {size:,} bytes")
        return super().read(size)


@dataclass(frozen=True)
class Archive:
    """An open FMU file.

    Attributes
    ----------
    sha256
        SHA-256 of the file.
    names
        Names of everything in it.
    """

    path: Path
    sha256: str
    names: Sequence[str]
    _zip: zipfile.ZipFile

    def read(self, name: str, most: int = MAX_XML) -> bytes:
        """The content of a file.

        Raises
        ------
        FmuError
            It is damaged, or larger than ``most`` bytes.
        """
        size = self._zip.getinfo(name).file_size
        if size > most:
            raise FmuError(f"{self.path}: {name} must have at most {most:,} bytes, got {size:,}")
        return b"".join(self._pieces(name))

    def facts(self) -> dict[str, tuple[int, int]]:
        """Sizes and checksums (CRC-32) of all files by name, from the archive's directory."""
        files = (entry for entry in self._zip.infolist() if not entry.is_dir())
        return {entry.filename: (entry.file_size, entry.CRC) for entry in files}

    def start(self, name: str, size: int) -> bytes:
        """The first bytes of a file."""
        with _intact(self.path), self._zip.open(name) as file:
            return file.read(size)

    def unpack(self, folder: Path) -> None:
        """Write all files into a folder.

        Raises
        ------
        FmuError
            A file is damaged or cannot be written.
        """
        for entry in self._zip.infolist():
            target = folder / entry.filename
            try:
                if entry.is_dir():
                    target.mkdir(parents=True, exist_ok=True)
                    continue
                target.parent.mkdir(parents=True, exist_ok=True)
                with target.open("wb") as file:
                    for piece in self._pieces(entry.filename):
                        file.write(piece)
            except OSError as error:
                raise FmuError(
                    f"{self.path}: must be possible to unpack, got {error.strerror or error} "
                    f"for {shown(entry.filename)}"
                ) from error

    def _pieces(self, name: str) -> Iterator[bytes]:
        entry = self._zip.getinfo(name)
        left = entry.file_size
        with _intact(self.path):
            with self._zip.open(entry) as file:
                while piece := file.read(_PIECE):
                    left -= len(piece)
                    yield piece
            if left:
                raise zipfile.BadZipFile(f"{shown(name)} of another size than its directory says")


@contextmanager
def opened(path: Path, what: str = "an FMU") -> Iterator[Archive]:
    """Open an FMU file, within the bounds of this module.

    Parameters
    ----------
    what
        Kind of archive for messages, if it is another archive of the same format.

    Raises
    ------
    FmuError
        There is no such file, it is not a ZIP archive, it is damaged, larger than the bounds,
        encrypted, packed in a way that the standard does not allow, or holds links or names that
        lead out of its folder. Only what `Archive.read` and `Archive.unpack` read is known to be
        intact.
    """
    _check_file(path, what)
    try:
        file = _Bounded(path)
    except OSError as error:
        raise FmuError(
            f"{path}: must be a file that can be read, got {error.strerror or error}"
        ) from error
    with file:
        with _intact(path):
            sha256 = _hash(file)
            if not zipfile.is_zipfile(file):
                raise FmuError(f"{path}: is not {what} (not a ZIP archive)")
            archive = zipfile.ZipFile(file)
        with archive:
            entries = archive.infolist()
            _check_entries(path, entries)
            yield Archive(path, sha256, [entry.filename for entry in entries], archive)


def _check_file(path: Path, what: str) -> None:
    try:
        status = os.stat(path)
    except FileNotFoundError:
        raise FmuError(f"{path}: must be {what}, got no file") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FmuError(f"{shown(str(path))}: must be {what}, got {reason}") from error
    if not stat.S_ISREG(status.st_mode):
        got = _KINDS.get(stat.S_IFMT(status.st_mode), "something else")
        raise FmuError(f"{path}: must be {what}, got {got}")
    if status.st_size > MAX_FILE:
        raise FmuError(f"{path}: must have at most {MAX_FILE:,} bytes, got {status.st_size:,}")


def _hash(file: io.FileIO) -> str:
    digest = hashlib.sha256()
    left = MAX_FILE  # the file size reported by the system is not always right
    while left > 0 and (piece := file.read(_PIECE)):
        digest.update(piece)
        left -= len(piece)
    file.seek(0)
    return digest.hexdigest()


def _check_entries(path: Path, entries: Sequence[zipfile.ZipInfo]) -> None:
    """Refuse whatever the standard (FMI 2.0.5, 2.3; FMI 3.0.2, 2.5) or a bound forbids."""
    if len(entries) > MAX_ENTRIES:
        raise FmuError(f"{path}: must hold at most {MAX_ENTRIES:,} files, got {len(entries):,}")
    unpacked = sum(entry.file_size for entry in entries)
    if unpacked > MAX_UNPACKED:
        raise FmuError(
            f"{path}: must have at most {MAX_UNPACKED:,} bytes unpacked, got {unpacked:,}"
        )
    for entry in entries:
        name = shown(entry.orig_filename)
        kind = stat.S_IFMT(entry.external_attr >> 16)
        if not _is_inside(entry.orig_filename):
            raise FmuError(f"{path}: must hold names of files inside its folder, got {name}")
        if entry.orig_filename.count("/") > MAX_DEPTH:
            raise FmuError(
                f"{path}: must hold at most {MAX_DEPTH} folders in one another, got {name}"
            )
        if entry.flag_bits & 0x1:
            raise FmuError(f"{path}: must not be encrypted, got {name} encrypted")
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise FmuError(
                f"{path}: must be packed with method 0 (store) or 8 (deflate), got method "
                f"{entry.compress_type} for {name}"
            )
        if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
            raise FmuError(f"{path}: must hold files and folders only, got a link or device {name}")


def _is_inside(name: str) -> bool:
    """Whether a name stays inside the folder it is unpacked to, on every system."""
    return not re.search(r"^/|[\\:\0]|(^|/)\.\.(/|$)", name) and name.strip("/.") != ""


@contextmanager
def _intact(path: Path) -> Iterator[None]:
    try:
        yield
    except _BROKEN as error:
        reason = one_line(error)
        raise FmuError(f"{path}: must be an intact ZIP archive, got {shown(reason)}") from error


def shown(text: str, most: int = 80) -> str:
    """A text from an archive, made harmless for a message."""
    safe = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
    return safe if len(safe) <= most else f"{safe[:most]}…"

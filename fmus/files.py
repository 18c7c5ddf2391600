"""Writing files and folders so that nobody sees them half-written and dead processes leave nothing.

Unfinished files have a hidden name, and next to each lies a file that its process keeps locked. A
lock ends with its process, however that ends, so the next process knows what to remove, even with
several processes at once. On a file system without locks nothing is removed.
"""

from __future__ import annotations

import atexit
import errno
import hashlib
import os
import re
import shutil
import stat
import sys
import tempfile
import threading
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from . import stopping

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

HIDDEN = ".sblcosim-"
"""Prefix of the names of unfinished files and folders."""

_LOCK = ".lock"
_OURS = re.compile(re.escape(HIDDEN) + "[0-9a-f]{32}(" + re.escape(_LOCK) + ")?")
_BYTE = 1 << 30  # Windows forbids reading locked bytes, so the lock lies beyond the content


def working_directory_problem() -> str | None:
    """Why the working directory cannot be worked in; None if it can."""
    try:
        here = os.getcwd()
    except OSError:
        return "working directory: must exist, got one that was deleted"
    try:
        here.encode()  # as lxml and other libraries do with what is relative to it
    except UnicodeEncodeError:
        return f"working directory: must have a name in UTF-8, got {here!a}"
    return None


def write_file(
    path: Path, content: bytes, *, replace: bool = True, durable: bool = True
) -> None:
    """Write a file that appears under its name only when it is complete.

    Parameters
    ----------
    replace
        Whether to replace an existing file.
    durable
        Wait until it would survive a loss of power, which takes some milliseconds.

    Raises
    ------
    OSError
        The file cannot be written; `FileExistsError` if it exists and must not be replaced, or if
        something other than a file has the name.
    """
    if os.path.lexists(path) and (not replace or not os.path.isfile(path)):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))
    make_folder(path.parent)
    if path.parent not in _TIDY:
        sweep(path.parent)
        _TIDY.add(path.parent)
    with unfinished(path.parent) as hidden:
        with hidden.open("xb") as file:
            file.write(content)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        stopping.check()
        if replace or not _linked(hidden, path):
            hidden.replace(path)
        if durable:
            sync_folder(path.parent)


_TIDY: set[Path] = set()


def _linked(hidden: Path, path: Path) -> bool:
    """Give a file its name unless it is taken; False if the file system has no links."""
    try:
        os.link(hidden, path)
    except FileExistsError:
        raise
    except OSError:
        return False
    return True


def make_folder(path: Path) -> None:
    """Make a folder and those above it; `Path.mkdir` is recursive and gives up on deep ones."""
    missing = []
    while not os.path.isdir(path):
        missing.append(path)
        if path.parent == path:
            break
        path = path.parent
    for folder in reversed(missing):
        try:
            folder.mkdir(exist_ok=True)
        except FileExistsError:
            reason = os.strerror(errno.ENOTDIR)
            raise NotADirectoryError(errno.ENOTDIR, reason, str(folder)) from None


def sync_folder(path: Path) -> None:
    """Make names in a folder survive a loss of power, where the system supports this."""
    if os.name == "nt":
        return
    with suppress(OSError):
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def sync_file(path: Path) -> None:
    """Make the content of a file survive a loss of power."""
    with path.open("r+b") as file:
        os.fsync(file.fileno())


# --- Reading --------------------------------------------------------------------------------------


def regular(path: Path) -> Path:
    """The path of something with an end to read; folders are left to the caller's open to refuse.

    Raises
    ------
    OSError
        It is a pipe, which may wait forever, a device or a socket; or it does not exist.
    """
    kind = KINDS.get(stat.S_IFMT(path.stat().st_mode))
    if kind is not None:
        raise OSError(errno.EINVAL, kind, str(path))
    return path


KINDS = {
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
}
"""Types of things that can be opened but are not files."""

# --- Files that others may have damaged -----------------------------------------------------------

SEAL = ".sha256"
"""Suffix of the file that holds another file's SHA-256."""


def seal(content: bytes, name: str) -> bytes:
    """Content of that file, in the format of ``sha256sum``."""
    return f"{hashlib.sha256(content).hexdigest()}  {name}\n".encode()


def write_sealed(path: Path, content: bytes) -> None:
    """Write a file and, before it, its SHA-256 next to it."""
    write_file(path.with_name(path.name + SEAL), seal(content, path.name))
    write_file(path, content)


def intact(path: Path) -> bool:
    """Whether a file is as `write_sealed` wrote it; computed once, until it changes."""
    try:
        recorded = regular(path.with_name(path.name + SEAL)).read_bytes()[:64]
    except OSError:
        return False
    return len(recorded) == 64 and recorded == sha256_of(path).encode()


def sha256_of(path: Path) -> str:
    """SHA-256 of a file in hexadecimal, computed once, until it changes; empty if missing."""
    try:
        about = regular(path).stat()
        known = str(path), about.st_size, about.st_mtime_ns, about.st_ino
        if known not in _HASHES:
            _HASHES[known] = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return ""
    return _HASHES[known]


_HASHES: dict[tuple[str, int, int, int], str] = {}


# --- Unfinished files -----------------------------------------------------------------------------


@contextmanager
def unfinished(folder: Path, instead: str = "") -> Iterator[Path]:
    """A hidden name in a folder for a file or folder of this process.

    Whatever still has that name at the end is removed; if the process is killed, by a later
    `sweep`.

    Parameters
    ----------
    instead
        Name in the same folder that a `sweep` restores for what is moved here, unless the name is
        taken again.
    """
    with stopping.deferred():
        path, handle = _claim(folder, instead)
    try:
        yield path
    finally:
        with stopping.deferred():
            remove(path)
            _release(path, handle)


def is_hidden(name: str) -> bool:
    """Whether a name belongs to something `unfinished`."""
    return _OURS.fullmatch(name) is not None


def sweep(folder: Path) -> bool:
    """Remove leftovers of dead processes from a folder; returns whether there were any."""
    try:
        names = os.listdir(folder)
    except OSError:
        return False
    locks = [name for name in names if name.endswith(_LOCK) and is_hidden(name)]
    return sum(_sweep(folder / name.removesuffix(_LOCK)) for name in locks) > 0


def scratch() -> Path:
    """Temporary folder of this process, for as long as it lives."""
    global _scratch
    with _GUARD:
        if _scratch is None or _scratch[0] != os.getpid():  # a forked process needs its own
            temporary = Path(tempfile.gettempdir())
            sweep(temporary)
            with stopping.deferred():
                path, handle = _claim(temporary, "")
                path.mkdir(mode=0o700)
                _scratch = os.getpid(), path, handle
                # The worker processes of multiprocessing end without atexit.
                processes: Any = sys.modules.get("multiprocessing.util")
                if processes is None:
                    atexit.register(_end, path, handle, os.getpid())
                else:
                    processes.Finalize(None, _end, (path, handle, os.getpid()), exitpriority=0)
        return _scratch[1]


def leave() -> None:
    """Remove the folder from `scratch`, before a process ends without notice."""
    if _scratch is not None:
        _end(_scratch[1], _scratch[2], _scratch[0])


_scratch: tuple[int, Path, int | None] | None = None
_ended: set[Path] = set()
_GUARD = threading.Lock()


def _end(path: Path, handle: int | None, owner: int) -> None:
    if os.getpid() != owner:  # a forked process uses its parent's folder
        return
    with _GUARD:  # two threads may end the process, and the next file gets the handle's number
        if path not in _ended:
            _ended.add(path)
            remove(path)
            _release(path, handle)


def _claim(folder: Path, instead: str) -> tuple[Path, int | None]:
    """An unused name and the lock on it; None where there are no locks."""
    while True:
        path = folder / f"{HIDDEN}{uuid.uuid4().hex}"
        handle = os.open(_lock_of(path), os.O_RDWR | os.O_CREAT | os.O_EXCL)
        try:
            os.write(handle, os.fsencode(instead))
            held = _lock(handle)
        except OSError:
            _release(path, handle)
            raise
        if held is None:
            _release(path, handle)
            return path, None
        if held and os.fstat(handle).st_nlink:
            return path, handle
        _release(path, handle)  # a sweep came before the lock


def _release(path: Path, handle: int | None) -> None:
    if handle is None:
        return
    # On Windows loaded libraries stay, and a compiler may survive its parent: the next process will
    # find anything left.
    done = not os.path.lexists(path)
    if done and os.name != "nt":
        with suppress(OSError):
            _lock_of(path).unlink()
    os.close(handle)
    if done and os.name == "nt":  # where open files cannot be removed
        with suppress(OSError):
            _lock_of(path).unlink()


def _sweep(path: Path) -> bool:
    try:
        handle = os.open(_lock_of(path), os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
    except OSError:
        return False
    if not _mine(handle) or not _lock(handle):
        os.close(handle)
        return False
    back = os.fsdecode(os.read(handle, 4096))
    if back and os.path.basename(back) == back and not os.path.lexists(path.with_name(back)):
        with suppress(OSError):
            path.rename(path.with_name(back))
    remove(path)
    _release(path, handle)
    return True


def _mine(handle: int) -> bool:
    return os.name == "nt" or os.fstat(handle).st_uid == os.geteuid()


def _lock_of(path: Path) -> Path:
    return path.with_name(path.name + _LOCK)


def _lock(handle: int) -> bool | None:
    """Lock an open file until it is closed or the process ends; None if that is impossible."""
    try:
        if fcntl is not None:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        else:
            import msvcrt

            os.lseek(handle, _BYTE, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
            os.lseek(handle, 0, os.SEEK_SET)
    except OSError as error:
        held = error.errno in (errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES, errno.EDEADLK)
        return False if held else None
    return True


def remove(path: Path) -> None:
    """Remove a file, or a folder with its content, if it exists."""
    if os.path.isdir(path) and not os.path.islink(path):
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink(missing_ok=True)

"""The platforms that FMUs are built for, under the names that FMI 3 gives them.

FMI 3 (section 2.5.1.4.1) names the folder of a binary by architecture and system, for example
``aarch64-linux``. FMI 2 has older names for the x86-64 platforms and, since 2.0.4, uses those of
FMI 3 for the others.
"""

from __future__ import annotations

import platform
import struct
from collections.abc import Mapping

from .standard import Fmi

ZIG_TARGETS = {
    "x86_64-linux": "x86_64-linux-gnu.2.17",
    "aarch64-linux": "aarch64-linux-gnu.2.17",
    "x86_64-windows": "x86_64-windows-gnu",
    "x86_64-darwin": "x86_64-macos.11.0",
    "aarch64-darwin": "aarch64-macos.11.0",
}
"""All platforms with their names in zig: the oldest supported glibc and macOS."""

PLATFORMS = tuple(ZIG_TARGETS)
WASM = "wasm32"
"""WebAssembly without an operating system: an engine that any host of it can run, but no FMI."""
_WASM_FOLDER = "wasm32-freestanding"

_FMI2_FOLDERS = {"x86_64-linux": "linux64", "x86_64-windows": "win64", "x86_64-darwin": "darwin64"}
_MACHINES = {"amd64": "x86_64", "x64": "x86_64", "arm64": "aarch64"}


def platform_of(system: str, machine: str) -> str:
    """Name of a platform, from `platform.system` and `platform.machine`, in any case."""
    machine = machine.lower()
    return f"{_MACHINES.get(machine, machine)}-{system.lower()}"


def this_platform() -> str:
    """The platform on which Python runs."""
    return platform_of(platform.system(), platform.machine())


def folder(name: str, fmi: Fmi) -> str:
    """The folder in ``binaries`` that the standard prescribes for a platform.

    It has no name for WebAssembly. Ours is of the same form.
    """
    if name == WASM:
        return _WASM_FOLDER
    return _FMI2_FOLDERS.get(name, name) if fmi == 2 else name


def folders(name: str, fmi: Fmi) -> tuple[str, ...]:
    """The folders in ``binaries`` that may hold a platform's library, the most likely first.

    In FMI 2, many tools put the library of a 64-bit system into the folder of its x86-64 kind,
    whatever the processor; others (such as FMPy) look for it there.
    """
    if fmi == 3:
        return (name,)
    x86 = _FMI2_FOLDERS.get(f"x86_64-{name.partition('-')[2]}")
    return tuple(dict.fromkeys((folder(name, 2), name, *([x86] if x86 else []))))


def suffix(name: str) -> str:
    """File name suffix of a shared library, by platform, folder or system."""
    name = name.lower()
    if name in (WASM, _WASM_FOLDER):
        return ".wasm"
    if "darwin" in name:
        return ".dylib"
    return ".dll" if "win" in name else ".so"


def machine_of(start: bytes) -> str | None:
    """The processor of a Linux library, from its first 20 bytes; None if they do not show it."""
    if len(start) < 20 or start[:4] != b"\x7fELF":
        return None
    return {62: "x86_64", 183: "aarch64"}.get(int.from_bytes(start[18:20], "little"))


def in_folders(libraries: Mapping[str, bytes], fmi: Fmi) -> dict[str, bytes]:
    """Shared libraries by folder, from those by platform.

    In FMI 2, ``darwin64`` holds one library for both processors if both exist, because tools look
    there on either. (Linux has no such files, only ``aarch64-linux``.)
    """
    by_folder = {folder(name, fmi): library for name, library in libraries.items()}
    both = [libraries.get(f"{machine}-darwin") for machine in _MACH_O]
    if fmi == 2 and None not in both:
        by_folder["darwin64"] = universal([library for library in both if library is not None])
    return by_folder


_MACH_O = {"x86_64": (0x01000007, 3), "aarch64": (0x0100000C, 0)}
"""Processors of macOS: type and subtype in a Mach-O file."""


def universal(libraries: list[bytes]) -> bytes:
    """Join Mach-O libraries, x86-64 then ARM, into one file for both processors."""
    alignment = 14  # as a power of two: pages of 16 KiB
    header = struct.pack(">II", 0xCAFEBABE, len(libraries))
    body = bytearray()
    start = 1 << alignment
    for (kind, subtype), library in zip(_MACH_O.values(), libraries, strict=True):
        header += struct.pack(">5I", kind, subtype, start + len(body), len(library), alignment)
        body += library
        body += bytes(-len(body) % (1 << alignment))
    return header.ljust(start, b"\0") + bytes(body)

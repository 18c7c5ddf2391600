"""The names of the platforms, and where their libraries lie in an FMU."""

from __future__ import annotations

import struct

import fmpy
import pytest
from sblcosim.fmus.platforms import (
    PLATFORMS,
    folder,
    folders,
    in_folders,
    machine_of,
    platform_of,
    suffix,
    this_platform,
)


@pytest.mark.parametrize(
    ("system", "machine", "expected"),
    [
        ("Linux", "x86_64", ("linux64", "x86_64-linux")),
        ("Windows", "AMD64", ("win64", "x86_64-windows")),
        ("Darwin", "x86_64", ("darwin64", "x86_64-darwin")),
        ("Darwin", "arm64", ("aarch64-darwin", "aarch64-darwin")),
        ("Linux", "aarch64", ("aarch64-linux", "aarch64-linux")),
    ],
)
def test_platform_folders_have_the_names_of_the_standard(
    system: str, machine: str, expected: tuple[str, str]
) -> None:
    name = platform_of(system, machine)
    assert name in PLATFORMS
    assert (folder(name, 2), folder(name, 3)) == expected
    ending = {"Linux": ".so", "Windows": ".dll", "Darwin": ".dylib"}[system]
    assert {suffix(place) for place in (system, *expected)} == {ending}


def test_this_platform_is_the_one_fmpy_sees() -> None:
    assert this_platform() == fmpy.platform_tuple
    assert fmpy.platform in folders(this_platform(), 2)
    assert suffix(this_platform()) == fmpy.sharedLibraryExtension


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("x86_64-linux", ("linux64", "x86_64-linux")),
        ("aarch64-linux", ("aarch64-linux", "linux64")),
        ("aarch64-darwin", ("aarch64-darwin", "darwin64")),
        ("riscv64-plan9", ("riscv64-plan9",)),
    ],
)
def test_fmi_2_libraries_are_looked_for_where_tools_put_them(
    name: str, expected: tuple[str, ...]
) -> None:
    assert folders(name, 2) == expected
    assert folders(name, 3) == (name,)


def test_fmi_2_has_one_library_for_both_macs() -> None:
    libraries = {name: name.encode() * 3000 for name in PLATFORMS}
    found = in_folders(libraries, 2)
    assert set(found) == {"linux64", "aarch64-linux", "win64", "darwin64", "aarch64-darwin"}
    assert found["aarch64-darwin"] == libraries["aarch64-darwin"]
    magic, count = struct.unpack_from(">II", found["darwin64"])
    assert (magic, count) == (0xCAFEBABE, 2)
    for i, name in enumerate(("x86_64-darwin", "aarch64-darwin")):
        kind, _, offset, size, align = struct.unpack_from(">5I", found["darwin64"], 8 + 20 * i)
        assert kind == {"x86_64-darwin": 0x01000007, "aarch64-darwin": 0x0100000C}[name]
        assert offset % (1 << align) == 0
        assert found["darwin64"][offset : offset + size] == libraries[name]
    assert in_folders(libraries, 3) == libraries
    one = {"x86_64-darwin": b"1"}
    assert in_folders(one, 2) == {"darwin64": b"1"}


def test_the_processor_of_a_linux_library_is_told_from_its_header() -> None:
    for number, machine in ((62, "x86_64"), (183, "aarch64"), (243, None)):
        assert machine_of(b"\x7fELF".ljust(18, b"\0") + bytes([number, 0])) == machine
    assert machine_of(b"") is machine_of(b"MZ" * 10) is None

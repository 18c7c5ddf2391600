"""The factory: valid, reproducible, self-contained FMUs, each built at most once."""

from __future__ import annotations

import os
import re
import shutil
import struct
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest
from fmpy import extract, read_model_description
from fmpy.validation import validate_fmu
from quick import one_in
from sblcosim.fmus.build import compiler, factory
from sblcosim.fmus.platforms import PLATFORMS, WASM, folder, this_platform
from sblcosim.models import COMPONENTS
from seams import Seam

from . import binaries
from .host import NOISY, TICKS, Host, assert_same_bits, chain, grid, host

BOTH = pytest.mark.parametrize("fmi", [2, 3])
EVERY = pytest.mark.parametrize("name", COMPONENTS)
LINUX = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads ELF files")
SMALL = "range_model"
"""The component that is built quickest."""


def binary_of(path: Path, folder: Path) -> Path:
    """Unpack the shared library."""
    with zipfile.ZipFile(path) as archive:
        (name,) = (n for n in archive.namelist() if n.startswith("binaries/"))
        return Path(archive.extract(name, folder))


LANES = "sblcosim_lanes"
"""What is exported beside the standard: the engine for many simulations."""


def declared_functions(fmi: int) -> set[str]:
    """Names of the functions of the standard, from its header; for FMI 2 without Model Exchange."""
    text = (factory.fmi_headers() / f"fmi{fmi}Functions.h").read_text()
    names = set(re.findall(rf"^\s*FMI{fmi}_Export\s+fmi{fmi}\w+\s+(fmi{fmi}\w+);", text, re.M))
    model_exchange = {
        "fmi2EnterEventMode", "fmi2NewDiscreteStates", "fmi2EnterContinuousTimeMode",
        "fmi2CompletedIntegratorStep", "fmi2SetTime", "fmi2SetContinuousStates",
        "fmi2GetDerivatives", "fmi2GetEventIndicators", "fmi2GetContinuousStates",
        "fmi2GetNominalsOfContinuousStates",
    }
    assert fmi == 3 or model_exchange < names
    return names - model_exchange


def tool(*command: str | Path) -> str:
    if shutil.which(str(command[0])) is None:
        pytest.skip(f"needs {command[0]}")
    return subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, check=True,
        env={**os.environ, "LC_ALL": "C"},
    ).stdout


# What is in an FMU -------------------------------------------------------------------------------


@BOTH
@EVERY
@one_in(2)
def test_fmpy_finds_no_fault(name: str, fmi: int) -> None:
    assert validate_fmu(str(factory.build(name, fmi))) == []  # type: ignore[arg-type]


@BOTH
@EVERY
def test_archive_is_complete(name: str, fmi: int) -> None:
    with zipfile.ZipFile(factory.build(name, fmi)) as archive:  # type: ignore[arg-type]
        assert archive.testzip() is None
        names = archive.namelist()
        description = archive.read("modelDescription.xml").decode()
        build = archive.read("sources/buildDescription.xml").decode()
        index = archive.read("documentation/index.html").decode()
        licence = archive.read("documentation/licenses/license.txt").decode()
    component = COMPONENTS[name]
    assert names[0] == "modelDescription.xml"
    assert ("terminalsAndIcons/terminalsAndIcons.xml" in names) == bool(component.terminals)
    assert {f"sources/fmi{fmi}.c", "sources/model.h", "sources/tables.h"} < set(names)
    assert f'modelIdentifier="{component.name}"' in description
    assert f"fmi{fmi}.c" in build
    assert "MIT" in licence
    assert component.variables[0].name in index


@LINUX
@BOTH
@EVERY
def test_exactly_the_functions_of_the_standard_and_the_lanes_are_exported(
    name: str, fmi: int, tmp_path: Path
) -> None:
    library = binary_of(factory.build(name, fmi), tmp_path)  # type: ignore[arg-type]
    listed = tool("nm", "-D", "--defined-only", library)
    exported = {line.split()[-1].split("@")[0] for line in listed.splitlines()}
    assert exported == declared_functions(fmi) | {LANES}


@LINUX
@BOTH
@EVERY
def test_library_needs_nothing_but_libc(name: str, fmi: int, tmp_path: Path) -> None:
    library = binary_of(factory.build(name, fmi), tmp_path)  # type: ignore[arg-type]
    needed = re.findall(r"\(NEEDED\).*\[(.+)\]", tool("readelf", "-d", library))
    assert all(re.match(r"libc\.|ld-linux", entry) for entry in needed), needed
    wanted = {
        line.split()[-1].split("@")[0]
        for line in tool("nm", "-D", "--undefined-only", library).splitlines()
    }
    weak = {"__cxa_finalize", "__gmon_start__", "_ITM_deregisterTMCloneTable",
            "_ITM_registerTMCloneTable"}
    assert wanted - weak <= {
        "calloc", "free", "malloc", "memcmp", "memcpy", "memset", "snprintf", "strcmp", "strlen",
        "vsnprintf", "__stack_chk_fail",
    }


@LINUX
@BOTH
@EVERY
def test_library_has_no_variables_of_its_own(name: str, fmi: int, tmp_path: Path) -> None:
    """So instances are independent, in one thread or many. The C runtime has a few bytes."""
    library = binary_of(factory.build(name, fmi), tmp_path)  # type: ignore[arg-type]
    sections = re.findall(
        r"\s(\.t?data|\.t?bss)\s+(?:PROG|NO)BITS\s+\w+ \w+ (\w+)",
        tool("readelf", "-SW", library),
    )
    assert sections
    for section, size in sections:
        assert int(size, 16) <= 16, section


# Equal bytes, at most once -----------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("name", "fmi"), [("acoustics", 3), (SMALL, 2)])
def test_two_builds_are_byte_identical(
    name: str, fmi: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import tempfile

    expected = factory.build(name, fmi).read_bytes()
    elsewhere = tmp_path / "a folder with another name"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    monkeypatch.setattr(tempfile, "tempdir", str(elsewhere))
    monkeypatch.setenv(factory.CACHE_VARIABLE, str(tmp_path / "cache"))
    again = factory.build(name, fmi)
    assert again.is_relative_to(tmp_path)
    assert again.read_bytes() == expected


def test_model_that_has_not_changed_is_not_compiled_again(
    fresh_cache: Path, seam: Seam
) -> None:
    first = factory.build(SMALL, 2)
    assert first.is_relative_to(fresh_cache)

    def fail(*_: object, **__: object) -> None:
        raise AssertionError("nothing should be compiled")

    seam.instead(compiler.Compiler.compile, fail)
    assert factory.build(SMALL, 2) == first
    with pytest.raises(AssertionError, match="nothing should be compiled"):
        factory.build(SMALL, 3)


def test_every_ingredient_counts(fresh_cache: Path, seam: Seam) -> None:
    """In the name of the folder that the FMU is kept in."""
    usual = compiler.find()
    now = [usual]
    seam.instead(compiler.find, lambda: now[0])

    def compiled(_: object, *arguments: Any) -> None:
        folder, output = arguments[-1], arguments[1]
        (folder / output).write_bytes(b"compiled")

    seam.instead(compiler.Compiler.compile, compiled)
    seam.instead(compiler.Compiler.link, compiled)

    def known_as(name: str = SMALL, fmi: Any = 2, cc: compiler.Compiler = usual) -> str:
        now[0] = cc
        return factory.build(name, fmi).parent.name

    seen = {known_as()}

    def differs(fingerprint: str) -> None:
        assert fingerprint not in seen
        seen.add(fingerprint)

    assert known_as() in seen
    differs(known_as("ekf"))
    differs(known_as(fmi=3))
    differs(known_as(cc=compiler.Compiler((*usual.command, "-O3"), usual.identity)))
    differs(known_as(cc=compiler.Compiler(usual.command, usual.identity + " newer")))
    for flags in (compiler.FLAGS, compiler.LINK_FLAGS):
        with Seam() as inner:
            inner.instead(flags, (*flags, "-g"))
            differs(known_as())
    with Seam() as seam:
        seam.instead(factory.ingredients, lambda name, fmi: "other sources")
        differs(known_as())
    assert known_as() in seen


def test_build_at_the_same_time_gives_one_good_file(fresh_cache: Path) -> None:
    code = f"from sblcosim.fmus.build.factory import build; print(build({SMALL!r}, 2))"
    builders = [
        subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    paths = {builder.communicate()[0].strip() for builder in builders}
    assert [builder.returncode for builder in builders] == [0, 0]
    (path,) = map(Path, paths)
    assert {file.name for file in path.parent.iterdir()} == {f"{SMALL}.fmu", f"{SMALL}.fmu.sha256"}
    assert validate_fmu(str(path)) == []


# Compiled elsewhere ------------------------------------------------------------------------------


def run_of(path: Path, name: str, fmi: int) -> Any:
    instance = Host(name, fmi, path)
    return instance.start(NOISY[name]).run(grid(TICKS), chain()[name])


@pytest.mark.skipif(shutil.which("cmake") is None, reason="needs CMake")
@pytest.mark.parametrize(("name", "fmi"), [("ekf", 2), ("acoustics", 3)])
def test_sources_in_the_fmu_give_the_same_results(name: str, fmi: int, tmp_path: Path) -> None:
    from fmpy.build import build_platform_binary
    from fmpy.util import create_zip_archive

    built = factory.build(name, fmi)  # type: ignore[arg-type]
    folder = tmp_path / "unpacked"
    extract(str(built), str(folder))
    shutil.rmtree(folder / "binaries")
    work = tmp_path / "build"
    work.mkdir()
    build_platform_binary(folder, work, all_warnings=True)
    again = tmp_path / "again" / f"{name}.fmu"
    again.parent.mkdir()
    create_zip_archive(str(again), str(folder))
    instance = host(name, fmi).start(NOISY[name])
    assert_same_bits(run_of(again, name, fmi), instance.run(grid(TICKS), chain()[name]))


@pytest.mark.parametrize("fmi", [2, 3])
def test_build_description_names_everything_to_compile(fmi: int, tmp_path: Path) -> None:
    folder = tmp_path / "unpacked"
    extract(str(factory.build(SMALL, fmi)), str(folder))  # type: ignore[arg-type]
    (configuration,) = read_model_description(str(folder)).buildConfigurations
    (files,) = configuration.sourceFileSets
    cc = compiler.find()
    objects = [f"{file}.o" for file in files.sourceFiles]
    for file, made in zip(files.sourceFiles, objects, strict=True):
        cc.compile(file, made, [factory.fmi_headers()], (), folder / "sources")
    cc.link(objects, "again.so", folder / "sources")
    assert (folder / "sources" / "again.so").stat().st_size > 0


@pytest.mark.skipif(compiler.zig() is None, reason="needs ziglang")
@pytest.mark.parametrize("platform", ["x86_64-linux", WASM])
def test_no_time_is_spent_on_debug_information(platform: str, tmp_path: Path) -> None:
    """It would take zig most of its time, and the linker takes it out again."""
    (tmp_path / "one.c").write_text("int one(int it) { return it + 1; }\n")
    compiler.for_platform(platform).compile("one.c", "object", [], (), tmp_path)
    made = (tmp_path / "object").read_bytes()
    assert b"one" in made
    assert b".debug_" not in made


@pytest.mark.skipif(compiler.zig() is None, reason="needs ziglang")
@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
def test_zig_builds_fmus_with_equal_results(
    fmi: Any, fresh_cache: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    expected = host("ekf", fmi).start(NOISY["ekf"]).run(grid(TICKS), chain()["ekf"])
    monkeypatch.setenv(compiler.VARIABLE, "zig")
    compiler.find.cache_clear()
    path = factory.build("ekf", fmi)
    assert validate_fmu(str(path)) == []
    assert_same_bits(run_of(path, "ekf", fmi), expected)
    if sys.platform.startswith("linux"):
        listed = tool("nm", "-D", "--defined-only", binary_of(path, tmp_path))
        exported = {line.split()[-1].split("@")[0] for line in listed.splitlines()}
        assert exported == declared_functions(fmi) | {LANES}


def libraries(path: Path, fmi: Any) -> dict[str, bytes]:
    """The shared libraries of an FMU by the name of their folder."""
    with zipfile.ZipFile(path) as archive:
        return {
            name.split("/")[1]: archive.read(name)
            for name in archive.namelist()
            if name.startswith("binaries/")
        }


FOUR = tuple(name for name in PLATFORMS if name != "x86_64-windows")
"""Those for which zig needs no minutes to make the C runtime when it is first used."""


@pytest.mark.skipif(compiler.zig() is None, reason="needs ziglang")
@pytest.mark.parametrize(
    ("name", "platforms"),
    [
        pytest.param(SMALL, FOUR, marks=pytest.mark.slow),
        *(pytest.param(name, PLATFORMS, marks=pytest.mark.slow) for name in COMPONENTS),
    ],
)
def test_one_fmu_runs_on_all_platforms(
    name: str, platforms: tuple[str, ...], seam: Seam, monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    """Each library exports the functions of the standard and the lanes, and needs an old libc."""
    allowed = {
        "linux": r"libc\.so\.6|ld-linux-.*",
        "windows": r"kernel32\.dll|api-ms-win-crt-.*\.dll",
        "darwin": r"/usr/lib/libSystem\.B\.dylib",
    }
    seam.instead(compiler.PLATFORMS, platforms)
    for fmi in (2, 3):
        path = factory.build(name, fmi, all_platforms=True)  # type: ignore[arg-type]
        assert validate_fmu(str(path)) == []
        found = libraries(path, fmi)
        assert set(found) == {folder(platform, fmi) for platform in platforms}  # type: ignore[arg-type]
        if fmi == 2:
            slices = found["darwin64"]
            assert slices[:4] == bytes.fromhex("cafebabe")
            (start, size) = struct.unpack_from(">8xII", slices, 8)
            found["darwin64"] = slices[start : start + size]
        for platform in platforms:
            binary = binaries.read(found[folder(platform, fmi)])  # type: ignore[arg-type]
            assert binary.machine == platform
            # zig's linker adds two labels for the header of a Mach-O file.
            exports = binary.exports - {"_mh_dylib_header", "__dso_handle"}
            assert exports == declared_functions(fmi) | {LANES}
            system = platform.partition("-")[2]
            needs = [re.fullmatch(allowed[system], library) for library in binary.needs]
            assert needs
            assert all(needs), binary.needs
            versions = {tuple(map(int, v[6:].split("."))) for v in binary.versions}
            assert (max(versions) <= (2, 17)) if system == "linux" else not versions
        here = this_platform()
        if here in platforms:
            assert_same_bits(
                run_of(path, name, fmi),
                host(name, fmi).start(NOISY[name]).run(grid(TICKS), chain()[name]),
            )
    if name == SMALL:
        monkeypatch.setenv(factory.CACHE_VARIABLE, str(tmp_path / "cache"))
        again = factory.build(name, 3, all_platforms=True)
        assert again.is_relative_to(tmp_path)
        assert again.read_bytes() == path.read_bytes()

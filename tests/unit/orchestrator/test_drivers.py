"""The drivers: for every platform, ready-made or compiled once."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from sblcosim.fmus import files
from sblcosim.fmus.build import compiler, factory
from sblcosim.fmus.build.compiler import Compiler
from sblcosim.fmus.errors import DamageWarning
from sblcosim.fmus.platforms import PLATFORMS, suffix, this_platform
from sblcosim.identification import innovations
from sblcosim.simulation.masters import c_libraries, lanes_driver, native, replay
from seams import Seam

EACH = pytest.mark.parametrize(
    "driver", [native.DRIVER, lanes_driver.DRIVER, replay.DRIVER, innovations.DRIVER],
    ids=lambda d: d.name,
)


@pytest.fixture
def units(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seam: Seam
) -> list[Sequence[factory.Unit]]:
    """What is compiled: nothing, in truth."""
    compiled: list[Sequence[factory.Unit]] = []

    def compile_shared(_: object, units: Sequence[factory.Unit], cc: Compiler) -> bytes:
        compiled.append(units)
        return cc.platform.encode()

    monkeypatch.setenv(factory.CACHE_VARIABLE, str(tmp_path / "cache"))
    monkeypatch.delenv(compiler.VARIABLE, raising=False)
    seam.instead(factory.READY, tmp_path / "ready")
    seam.instead(factory.compile_shared, compile_shared)
    return compiled


@EACH
def test_each_platform_has_its_own_library(
    driver: c_libraries.Driver, units: list[Sequence[factory.Unit]]
) -> None:
    for _ in range(2):  # the second time they are there
        for name in PLATFORMS:
            path = c_libraries.library(driver, Compiler(("cc",), "cc 1", name))
            assert path.name == f"{driver.name}{suffix(name)}"
            assert path.read_bytes() == name.encode()
    assert len(units) == len(PLATFORMS)
    assert len({c_libraries.key(driver, name) for name in PLATFORMS}) == len(PLATFORMS)
    if driver.lanes:  # 1, 2, 4 and 8 simulations at once on x86-64, 1 and 2 on ARM
        assert [len(u) for u in units] == [4 if "x86" in name else 2 for name in PLATFORMS]


@EACH
def test_what_came_along_is_used_while_the_sources_are_its_own(
    driver: c_libraries.Driver,
    units: list[Sequence[factory.Unit]],
    seam: Seam,
    tmp_path: Path,
) -> None:
    here = this_platform()
    ready = factory.READY / c_libraries.key(driver, here) / f"{driver.name}{suffix(here)}"
    files.write_sealed(ready, b"")
    assert c_libraries.library(driver) == ready
    assert c_libraries.available(driver)
    sources = driver.folder or c_libraries.FOLDER
    own = [f"{driver.name}.c", *driver.includes]
    for name in own:
        changed = tmp_path / f"{name} changed"
        shutil.copytree(sources, changed)
        (changed / name).write_text((sources / name).read_text() + "\n")
        seam.instead(c_libraries.FOLDER, changed)
        elsewhere = replace(driver, folder=driver.folder and changed)
        assert c_libraries.library(elsewhere) != ready
    assert len(units) == len(own)


def test_a_driver_is_not_available_without_a_compiler(
    units: list[Sequence[factory.Unit]], monkeypatch: pytest.MonkeyPatch, seam: Seam, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    seam.instead(compiler.zig, lambda: None)
    compiler.find.cache_clear()
    assert not c_libraries.available(native.DRIVER)


def test_a_damaged_driver_is_compiled_again_and_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seam: Seam
) -> None:
    monkeypatch.setenv(factory.CACHE_VARIABLE, str(tmp_path))
    seam.instead(factory.READY, tmp_path / "ready")
    path = c_libraries.library(native.DRIVER)
    good = path.read_bytes()
    for damaged in (b"", good[: len(good) // 2]):
        path.unlink()
        path.write_bytes(damaged)
        with pytest.warns(DamageWarning, match="it is being built again"):
            c_libraries.load.__wrapped__(native.DRIVER)
        assert path.read_bytes() == good

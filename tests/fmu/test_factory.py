"""The factory's errors, and what it does with ready-made and damaged files."""

from __future__ import annotations

import warnings
from importlib import metadata
from pathlib import Path

import pytest
from fmpy.validation import validate_fmu
from sblcosim.fmus import files
from sblcosim.fmus.build import compiler, factory
from sblcosim.fmus.errors import BuildError, DamageWarning
from seams import Seam

SMALL = "range_model"
"""The component that is built quickest."""


def test_unknown_component_gets_the_nearest_name() -> None:
    with pytest.raises(BuildError, match=r"got 'acoustic'; did you mean 'acoustics'\?"):
        factory.build("acoustic")


def test_fmi_version_must_exist() -> None:
    with pytest.raises(BuildError, match="must be 2 or 3, got 1"):
        factory.build("target", 1)  # type: ignore[arg-type]


def test_without_a_compiler_the_error_says_what_to_install(
    fresh_cache: Path, monkeypatch: pytest.MonkeyPatch, seam: Seam
) -> None:
    monkeypatch.setenv("PATH", str(fresh_cache))
    seam.instead(compiler.zig, lambda: None)
    monkeypatch.delenv(compiler.VARIABLE, raising=False)
    with pytest.raises(BuildError, match=r"install gcc or clang, or pip install 'sblcosim\[zig\]'"):
        factory.build(SMALL)


def test_without_zig_the_error_says_what_to_install(
    fresh_cache: Path, seam: Seam
) -> None:
    seam.instead(compiler.zig, lambda _: None)
    with pytest.raises(
        BuildError, match=r"all platforms needs the package ziglang: pip install 'sblcosim\[zig\]'"
    ):
        factory.build(SMALL, all_platforms=True)


def test_without_casadi_the_error_says_what_to_install(
    fresh_cache: Path, monkeypatch: pytest.MonkeyPatch, seam: Seam
) -> None:
    def version(package: str) -> str:
        if package == "casadi":
            raise metadata.PackageNotFoundError(package)
        return "1"

    seam.forgets(factory)
    monkeypatch.setattr(metadata, "version", version)
    with pytest.raises(
        BuildError, match=r"needs the package casadi: pip install 'sblcosim\[models\]'"
    ):
        factory.build(SMALL)


def test_ready_made_fmu_is_used_while_the_sources_are_its_own(
    fresh_cache: Path, monkeypatch: pytest.MonkeyPatch, seam: Seam
) -> None:
    seam.instead(factory.READY, fresh_cache / "ready")
    monkeypatch.delenv(compiler.VARIABLE, raising=False)
    ready = factory.READY / factory.key(SMALL, 2) / f"{SMALL}.fmu"
    files.write_sealed(ready, b"ready-made")
    seam.instead(compiler.Compiler.compile, lambda *_: pytest.fail("built"))
    assert factory.build(SMALL, 2) == factory.build(SMALL, 2, all_platforms=True) == ready
    with monkeypatch.context() as patch:
        patch.setenv(compiler.VARIABLE, compiler.find().command[0])
        with pytest.raises(pytest.fail.Exception):
            factory.build(SMALL, 2)
    seam.instead(compiler.FLAGS, (*compiler.FLAGS, "-g"))
    with pytest.raises(pytest.fail.Exception):
        factory.build(SMALL, 2)


DAMAGES = {
    "empty": lambda content: b"",
    "half": lambda content: content[: len(content) // 2],
    "one bit": lambda content: content[:-9] + bytes([content[-9] ^ 4]) + content[-8:],
    "longer": lambda content: content + b"0",
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("what", ["", files.SEAL])
def test_a_damaged_file_in_the_cache_is_built_again(
    what: str, damage: str, fresh_cache: Path, seam: Seam
) -> None:
    seam.instead(factory.compile_shared, lambda *_: b"compiled " * 99)
    path = factory.library("small", {"small.c": b""}, compiler=compiler.find())
    good = path.read_bytes()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert factory.library("small", {"small.c": b""}, compiler=compiler.find()) == path
    damaged = path.with_name(path.name + what)
    content = DAMAGES[damage](damaged.read_bytes())
    if what:
        content = content[:63] + b"?" + content[64:] if damage in ("one bit", "longer") else content
    damaged.write_bytes(content)
    with pytest.warns(DamageWarning, match="must be as it was written, got other bytes") as told:
        factory.library("small", {"small.c": b""}, compiler=compiler.find())
    assert len(told) == 1
    assert str(told[0].message).startswith(f"{path}: ")
    assert "\n" not in str(told[0].message)
    assert path.read_bytes() == good
    assert files.intact(path)


def test_a_file_without_its_hash_is_built_again(
    fresh_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = factory.build(SMALL, 2)
    good = path.read_bytes()
    path.write_bytes(good[:-1])
    path.with_name(path.name + files.SEAL).unlink()
    with pytest.warns(DamageWarning):
        assert factory.build(SMALL, 2) == path
    assert path.read_bytes() == good


def test_a_damaged_ready_made_file_is_built_or_the_message_says_what_to_do(
    fresh_cache: Path, monkeypatch: pytest.MonkeyPatch, seam: Seam
) -> None:
    seam.instead(factory.READY, fresh_cache / "ready")
    monkeypatch.delenv(compiler.VARIABLE, raising=False)
    ready = factory.READY / factory.key(SMALL, 2) / f"{SMALL}.fmu"
    files.write_sealed(ready, b"ready-made")
    ready.write_bytes(b"ready-maid")
    with pytest.warns(DamageWarning, match=r"pip install --force-reinstall --no-deps sblcosim"):
        built = factory.build(SMALL, 2)
    assert built.is_relative_to(fresh_cache)
    assert built != ready
    assert validate_fmu(str(built)) == []


def test_compiler_that_is_asked_for_must_be_there(
    fresh_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(compiler.VARIABLE, "no-such-compiler")
    with pytest.raises(BuildError, match=r"SBLCOSIM_CC: .* 'no-such-compiler'"):
        factory.build(SMALL)


def test_message_of_a_failing_compiler_is_shown(fresh_cache: Path) -> None:
    cc = compiler.find()
    with pytest.raises(BuildError, match=r"(?s)failed:.*undeclared_thing"):
        factory.compile_shared(
            {"x.c": b"int f(void) { return undeclared_thing; }"}, [factory.Unit("x.c")], cc
        )

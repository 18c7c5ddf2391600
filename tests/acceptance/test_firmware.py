"""Receivers as C for microcontrollers: the bits of their FMUs, here and on emulated processors.

Those of a Cortex-M are skipped where its compiler or qemu is missing.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest
import sblcosim
from sblcosim.errors import ConfigurationError
from sblcosim.fmus.build import compiler
from sblcosim.fmus.build.targets import FLAGS, TARGETS
from sblcosim.models import RECEIVERS

ARM = [name for name, target in TARGETS.items() if target.board]
SHORT = {"time.duration_s": 60.0}
MEMORY = {"memcpy", "memset", "memmove"}
HELPERS = re.compile(r"__aeabi_\w+|__stack_chk_fail|_GLOBAL_OFFSET_TABLE_")
"""Of the compiler's own library: divisions of 64 bits, and doubles in software."""


def flags() -> list[str]:
    return [*FLAGS.split(), "-Werror"]


def command() -> list[str]:
    """The project's compiler."""
    return [*compiler.find().command]


def run(words: Sequence[str], folder: Path) -> str:
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def ekf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("firmware") / "ekf"
    return sblcosim.export_firmware("ekf", "realistic-dive", path, SHORT, target="host")


def said_by(name: str, folder: Path, *more: str) -> str:
    """What the self-test says on this machine."""
    run([*command(), *flags(), *more, f"{name}.c", "selftest.c", "-o", "it"], folder)
    return run(["./it"], folder)


def test_it_is_one_file_and_a_header_that_stand_alone(ekf: Path) -> None:
    assert {path.name for path in ekf.iterdir()} == {
        "README.md", "Makefile", "manifest.json", "ekf.c", "ekf.h", "selftest.c", "recording.h",
    }
    text = (ekf / "ekf.c").read_text()
    assert {*re.findall(r"#include (\S+)", text)} <= {
        '"ekf.h"', "<stdint.h>", "<string.h>", "<immintrin.h>",
    }
    header = (ekf / "ekf.h").read_text()
    assert {*re.findall(r"#include (\S+)", header)} == {"<stdbool.h>", "<stdint.h>"}
    for variable in RECEIVERS["ekf"]:
        if variable.causality != "parameter":
            assert re.search(rf"\b{variable.name}\b", header)
        else:
            assert f"| `{variable.name}` |" in (ekf / "README.md").read_text()


def test_it_needs_nothing_but_memory_functions_and_has_no_variables(ekf: Path) -> None:
    if shutil.which("nm") is None:
        pytest.skip("needs nm")
    run([*command(), *flags(), "-c", "ekf.c", "-o", "ekf.o"], ekf)
    symbols = [line.split()[-2:] for line in run(["nm", "ekf.o"], ekf).splitlines()]
    undefined = {name for kind, name in symbols if kind == "U"}
    assert {name for name in undefined if not HELPERS.fullmatch(name)} <= MEMORY
    assert not [name for kind, name in symbols if kind in "BbDdC"]
    assert {name for kind, name in symbols if kind == "T"} == {"ekf_init", "ekf_update"}
    (ekf / "ekf.o").unlink()


@pytest.mark.parametrize("more", [(), ("-O2",), ("-DSOFT_SQRT",)], ids=["Os", "O2", "soft sqrt"])
def test_no_bit_differs_on_this_machine(ekf: Path, more: tuple[str, ...]) -> None:
    assert re.fullmatch(r"59 updates, 2950 outputs, 0 bits differ\n", said_by("ekf", ekf, *more))


def test_the_self_test_finds_a_wrong_bit(ekf: Path, tmp_path: Path) -> None:
    shutil.copytree(ekf, tmp_path / "it")
    path = tmp_path / "it/ekf.c"
    text, count = re.subn(r"out->nis = ", "out->nis = -", path.read_text())
    assert count == 1
    path.write_text(text)
    run([*command(), *flags(), "ekf.c", "selftest.c", "-o", "it"], path.parent)
    done = subprocess.run(["./it"], cwd=path.parent, capture_output=True, text=True)
    assert done.returncode == 1
    assert re.search(r" [1-9]\d* bits differ", done.stdout)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("receiver", "scenario", "changes"),
    [
        ("coupled", "realistic-dive", {"receiver.acceleration_psd_m2_s3": 0.01}),
        ("coupled", "realistic-dive", {}),
        ("coupled", "realistic-dive", {"receiver.watch": True}),
        ("coupled", "gps-buoys", {}),
        ("long_baseline", "harbour-lbl", {}),
        ("array", "usbl-boat", {}),
        ("fixed_lag", "realistic-dive", {}),
        ("sequential", "paper-scenario-1", {}),
        ("multilateration", "harbour-square", {}),
    ],
)
def test_no_bit_of_any_receiver_differs(
    receiver: str, scenario: str, changes: dict[str, object], tmp_path: Path
) -> None:
    path = sblcosim.export_firmware(
        receiver, scenario, tmp_path / "it", {**SHORT, **changes}, target="host"
    )
    name = next(path.glob("*.h")).stem if not (path / f"{receiver}.h").exists() else receiver
    assert " 0 bits differ" in said_by(name, path)


@pytest.mark.parametrize("target", ARM)
def test_no_bit_differs_on_an_emulated_processor(target: str, tmp_path: Path) -> None:
    for tool in ("make", TARGETS[target].compiler, "qemu-system-arm"):
        if shutil.which(tool) is None:
            pytest.skip(f"needs {tool}")
    path = sblcosim.export_firmware("ekf", "realistic-dive", tmp_path / "it", SHORT, target=target)
    assert "59 updates, 2950 outputs, 0 bits differ\n" in run(["make", "check"], path)
    said = run(["make", "measure"], path)
    counts = re.search(r"mean (\d+), most (\d+); stack (\d+) bytes", said)
    assert counts is not None
    mean, most, stack = map(int, counts.groups())
    assert 0 < mean < most
    assert 200 < stack < 4000
    objects = run(["arm-none-eabi-nm", "ekf.o"], path).splitlines()
    undefined = {line.split()[-1] for line in objects if " U " in line}
    assert {name for name in undefined if not HELPERS.fullmatch(name)} <= MEMORY


@pytest.mark.slow
def test_coupled_with_q_given_has_less_than_80_kb_on_a_cortex_m7(tmp_path: Path) -> None:
    if shutil.which("arm-none-eabi-gcc") is None:
        pytest.skip("needs arm-none-eabi-gcc")
    changes = {**SHORT, "receiver.acceleration_psd_m2_s3": 0.01}
    path = sblcosim.export_firmware("coupled", "realistic-dive", tmp_path / "it", changes)
    m7 = TARGETS["cortex-m7"]
    run([m7.compiler, *flags(), *m7.flags.split(), "-c", "coupled.c", "-o", "it.o"], path)
    text, data, bss = run(["arm-none-eabi-size", "it.o"], path).splitlines()[1].split()[:3]
    assert int(text) < 80_000
    assert (data, bss) == ("0", "0")


def test_an_unknown_receiver_and_target_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'coupled'"):
        sblcosim.export_firmware("couplet", path=tmp_path / "it")
    with pytest.raises(ConfigurationError, match="--target: must be cortex-m7 or"):
        sblcosim.export_firmware("ekf", path=tmp_path / "it", target="z80")
    assert not [*tmp_path.iterdir()]


def test_an_equal_folder_is_replaced_by_equal_bytes(ekf: Path, tmp_path: Path) -> None:
    again = sblcosim.export_firmware(
        "ekf", "realistic-dive", tmp_path / "it", SHORT, target="host"
    )
    for path in again.iterdir():
        if path.name != "manifest.json":
            assert path.read_bytes() == (ekf / path.name).read_bytes()

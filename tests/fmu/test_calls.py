"""Every FMI call, right, wrong, out of order and at random, under the sanitizers.

A million random calls of each FMU, with a seed of one's own (else always the same):

    SBLCOSIM_FUZZ_SEED=7 pytest -m slow -s tests/fmu/test_calls.py
"""

from __future__ import annotations

import os
import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest
from quick import one_in
from sblcosim.fmus.build import factory
from sblcosim.fmus.build.compiler import FLAGS
from sblcosim.models import COMPONENTS

HERE = Path(__file__).parent
SEED = int(os.environ.get("SBLCOSIM_FUZZ_SEED", "20210123"))
CALLS = pytest.mark.parametrize(
    "calls", [3_000, pytest.param(1_000_000, marks=pytest.mark.slow)]
)
LONG = ("array", "coupled", "fixed_lag", "long_baseline")
"""Components that take long; the code around them is that of all others."""
SLOW = {(name, fmi) for name in LONG for fmi in (2, 3)} - {("coupled", 2)}
"""What ``-m slow`` takes."""
LIBRARY_ONLY = {"-shared", "-s", "-O2", "-fvisibility=hidden"}
SANITIZE = (
    "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all", "-g", "-O0",
)


def sources_of(name: str, fmi: int, folder: Path) -> None:
    """Unpack the sources that an FMU carries."""
    with zipfile.ZipFile(factory.build(name, fmi)) as archive:  # type: ignore[arg-type]
        for file in archive.namelist():
            if file.startswith("sources/"):
                (folder / Path(file).name).write_bytes(archive.read(file))


@one_in(4)
@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc and its sanitizers")
@pytest.mark.parametrize(("name", "fmi"), [
    pytest.param(name, fmi, marks=[pytest.mark.slow] if (name, fmi) in SLOW else [])
    for name in COMPONENTS for fmi in (2, 3)
])
@CALLS
def test_every_call_is_answered_or_refused(
    name: str, fmi: int, calls: int, tmp_path: Path
) -> None:
    sources_of(name, fmi, tmp_path)
    program = tmp_path / "calls"
    flags = [flag for flag in FLAGS if flag not in LIBRARY_ONLY]
    subprocess.run(
        ["gcc", *flags, *SANITIZE, f"-I{tmp_path}", f"-I{factory.fmi_headers()}",
         str(HERE / f"calls{fmi}.c"), "-o", str(program)],
        check=True,
    )
    done = subprocess.run(
        [program, str(SEED), str(calls)], capture_output=True, text=True, check=False,
        env={**os.environ, "ASAN_OPTIONS": "detect_leaks=1", "UBSAN_OPTIONS": "print_stacktrace=1"},
    )
    print(done.stdout)
    assert done.returncode == 0, f"seed {SEED}\n{done.stdout}{done.stderr}"

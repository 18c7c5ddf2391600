"""Python code whose C is compiled with the sanitizers for addresses and undefined behaviour."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

FLAGS = """
from sblcosim.fmus.build import compiler
checks = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
compiler.FLAGS = (*(f for f in compiler.FLAGS if f != "-O2"), "-O1", *checks)
compiler.LINK_FLAGS = (*compiler.LINK_FLAGS, *checks)
"""


def is_clean(code: str, cache: Path) -> None:
    """Run code in a process of its own, with everything compiled for it.

    Parameters
    ----------
    cache
        A folder for what is compiled.
    """
    asan = subprocess.run(
        ["gcc", "-print-file-name=libasan.so"], capture_output=True, text=True, check=False
    )
    if asan.returncode:
        pytest.skip("there is no gcc with AddressSanitizer")
    done = subprocess.run(
        [sys.executable, "-c", f"{FLAGS}{code}\nprint('clean')"],
        env=os.environ | {
            "LD_PRELOAD": asan.stdout.strip(), "ASAN_OPTIONS": "detect_leaks=0",
            "PYTHONMALLOC": "malloc", "SBLCOSIM_CACHE": str(cache), "SBLCOSIM_CC": "gcc",
            "PYTHONPATH": os.pathsep.join(sys.path),
        },
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stdout == "clean\n", done.stderr[-3000:]

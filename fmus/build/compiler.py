"""The C compiler: the system's, or the one from the package ``ziglang``.

The latter compiles for every platform.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from pathlib import Path

from .. import stopping
from ..errors import BuildError
from ..platforms import PLATFORMS, WASM, ZIG_TARGETS, this_platform

VARIABLE = "SBLCOSIM_CC"
"""Environment variable that names the compiler to use, for example ``clang`` or ``zig``."""

# No contraction to fused multiply-adds and no errno: the same bits on every machine. Only the
# functions of the standard are exported, and nothing can be interposed.
FLAGS = (
    "-std=c11", "-O2", "-ffp-contract=off", "-fno-math-errno", "-fPIC", "-fvisibility=hidden",
    "-Wall", "-Wextra", "-Werror", "-Wno-psabi",
)
LINK_FLAGS = ("-shared", "-s")
# zig compiles for the processor it runs on unless told otherwise, builds the runtime of a sanitizer
# for each platform although nothing uses it, and spends most of its time on debug information that
# the linker takes out again.
_ZIG_FLAGS = ("-mcpu=baseline", "-fno-sanitize=undefined", "-g0")
# A module has neither a start nor shared code. Its memory begins with a stack of 256 KiB.
_WASM_TARGET = "wasm32-freestanding"
_WASM_LINK_FLAGS = (
    "-nostdlib", "-s", "-Wl,--no-entry", "-Wl,--export=__heap_base", "-Wl,-z,stack-size=262144",
)
_LINUX_FLAGS = ("-Wl,-Bsymbolic", "-Wl,--build-id=none")


@dataclass(frozen=True, slots=True)
class Compiler:
    """A command that compiles C.

    Attributes
    ----------
    command
        Program and first arguments.
    identity
        Changes with the compiler; part of the key of a cached FMU.
    platform
        Target platform; a name of `sblcosim.fmus.platforms`.
    """

    command: tuple[str, ...]
    identity: str
    platform: str = field(default_factory=this_platform)

    def compile(
        self, source: str, output: str, include: Sequence[Path], flags: Sequence[str], folder: Path
    ) -> None:
        """Compile a file to an object; both are names in ``folder``.

        Raises
        ------
        BuildError
            The compiler cannot be started or reports an error; the message holds its output.
        """
        # Relative names keep the path of the folder out of the object.
        folders = [f"-I{path}" for path in (".", *include)]
        general = [flag for flag in FLAGS if self.platform != WASM or flag != "-fPIC"]
        self._run([*general, *flags, *folders, "-c", source, "-o", output], folder)

    def link(self, objects: Sequence[str], output: str, folder: Path) -> None:
        """Link objects to a shared library or a module of WebAssembly; names in ``folder``.

        Raises
        ------
        BuildError
            As `compile`.
        """
        system = _LINUX_FLAGS if self.platform.endswith("-linux") else ()
        general = _WASM_LINK_FLAGS if self.platform == WASM else LINK_FLAGS
        self._run([*general, *system, *objects, "-o", output], folder)

    def _run(self, arguments: Sequence[str], folder: Path) -> None:
        try:
            done = stopping.completed(
                [*self.command, *arguments],
                cwd=folder,
                env={
                    **os.environ,
                    "SOURCE_DATE_EPOCH": "315532800",  # 1980: DLLs have a date
                    "TMPDIR": str(folder),  # a compiler that is killed leaves its files here
                },
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
        except OSError as error:
            raise BuildError(
                f"the compiler {self.command[0]!r} cannot be started: {error}"
            ) from None
        if done.returncode != 0:
            raise BuildError(f"{' '.join(self.command)} failed:\n{done.stderr.strip()}")


def zig(platform: str | None = None) -> Compiler | None:
    """The compiler of the package ``ziglang``, if it is installed.

    Parameters
    ----------
    platform
        Target platform; None: this machine.
    """
    spec = importlib.util.find_spec("ziglang")
    if spec is None:
        return None
    command = (sys.executable, "-m", "ziglang", "cc", *_ZIG_FLAGS)
    identity = f"zig {version('ziglang')}"
    if platform is None:
        return Compiler(command, identity)
    target = _WASM_TARGET if platform == WASM else ZIG_TARGETS[platform]
    return Compiler((*command, "-target", target), identity, platform)


def for_every_platform() -> tuple[Compiler, ...]:
    """A compiler for each platform.

    Raises
    ------
    BuildError
        The package ``ziglang`` is not installed.
    """
    compilers = tuple(compiler for name in PLATFORMS if (compiler := zig(name)) is not None)
    if not compilers:
        raise BuildError(
            "building for all platforms needs the package ziglang: pip install 'sblcosim[zig]'"
        )
    return compilers


def for_platform(name: str) -> Compiler:
    """A compiler for a platform: a name of `sblcosim.fmus.platforms`, or `WASM`.

    Raises
    ------
    BuildError
        The package ``ziglang`` is not installed.
    """
    compiler = zig(name)
    if compiler is None:
        raise BuildError(
            f"building for {name} needs the package ziglang: pip install 'sblcosim[zig]'"
        )
    return compiler


def system(name: str) -> Compiler | None:
    """A compiler on the search path, if there is one."""
    path = shutil.which(name)
    if path is None:
        return None
    stat = os.stat(path)
    return Compiler((path,), f"{os.path.realpath(path)} {stat.st_size} {stat.st_mtime_ns}")


@cache
def find() -> Compiler:
    """The compiler to use: ``SBLCOSIM_CC``, else the system's, else zig.

    Raises
    ------
    BuildError
        There is no compiler, or the requested one is missing.
    """
    wanted = os.environ.get(VARIABLE)
    if wanted:
        compiler = zig() if wanted == "zig" else system(wanted)
        if compiler is None:
            raise BuildError(
                f"{VARIABLE}: must name a compiler that exists, got {wanted!r}"
            )
        return compiler
    for name in ("cc", "gcc", "clang"):
        compiler = system(name)
        if compiler is not None:
            return compiler
    compiler = zig()
    if compiler is None:
        raise BuildError(
            "building FMUs needs a C compiler: install gcc or clang, or pip install 'sblcosim[zig]'"
        )
    return compiler

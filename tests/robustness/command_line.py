"""The real command line, many times: a process that has loaded everything forks one for each.

Run as a script it is that process: it reads a line of JSON per command from its standard input and
answers with one.
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SECONDS = 20.0
"""Of a processor, that a command may take."""
PATIENCE = 900.0
"""Seconds until a command hangs that waits for ever; an endless loop ends by `SECONDS`, on a
machine that has much else to do, too."""
MEGABYTES = 1000.0
"""That a command may take."""
LOADED = (
    "matplotlib.pyplot", "sblcosim.analysis", "sblcosim.estimation.after", "sblcosim.study.runner",
    "sblcosim.cli",
    "sblcosim.export.ssp", "sblcosim.fmus.conformance.receiver_contract",
    "sblcosim.fmus.conformance.kit",
    "sblcosim.report.study", "statsmodels.api",
)  # fmt: skip


@dataclass(frozen=True)
class Ended:
    """How a command has ended.

    Attributes
    ----------
    code
        Exit code, or the negative number of a signal.
    seconds
        Of a processor, with those of its children.
    megabytes
        Largest resident size of it or a child.
    """

    code: int
    hung: bool
    seconds: float
    megabytes: float
    output: str
    errors: str


class CommandLine:
    """Commands in processes of their own."""

    def __init__(self) -> None:
        self._server = subprocess.Popen(
            [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env=os.environ | {"MPLBACKEND": "Agg", "OMP_NUM_THREADS": "1",
                              "OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip

    def close(self) -> None:
        """End the process that forks."""
        assert self._server.stdin is not None
        self._server.stdin.close()
        self._server.wait()

    def __call__(
        self, arguments: Sequence[str | Path], folder: Path, environment: Mapping[str, str]
    ) -> Ended:
        """Run a command in a folder."""
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        case = {
            "arguments": [str(a) for a in arguments], "folder": str(folder),
            "environment": dict(environment),
        }  # fmt: skip
        self._server.stdin.write(json.dumps(case) + "\n")
        self._server.stdin.flush()
        return Ended(**json.loads(self._server.stdout.readline()))


@dataclass(frozen=True)
class Inputs:
    """Sound files to begin with, in a folder of their own, and the command."""

    folder: Path
    cache: Path
    run: CommandLine

    def environment(self, home: Path, cache: Path | None = None) -> dict[str, str]:
        """Of a command whose home and temporary files are in a folder."""
        return {
            "HOME": str(home / "home"), "TMPDIR": str(home / "tmp"),
            "XDG_CACHE_HOME": str(home / "home"), "SBLCOSIM_CACHE": str(cache or self.cache),
        }  # fmt: skip


def judge(ended: Ended, file: str | None) -> None:
    """See that a command has ended as it must.

    Parameters
    ----------
    file
        Name that an error must give; None: any.
    """
    from said import apart_from_compiling  # the server of this file does not find it

    assert not ended.hung
    assert ended.code in {0, 1, 2}
    assert "Traceback" not in ended.errors
    assert "must not happen" not in ended.errors
    assert ended.seconds < SECONDS
    assert ended.megabytes < MEGABYTES
    lines = apart_from_compiling(ended.errors).splitlines()
    assert all(line.startswith(("error: ", "warning: ")) for line in lines)
    assert all(len(line) < 1500 for line in lines)
    if ended.code == 2:
        wrong = [line for line in lines if line.startswith("error: ")]
        assert wrong
        # A run that is too long for the memory is no matter of one key.
        named = [line for line in wrong if file is None or file in line or ": record: " in line]
        assert named
    else:
        assert ended.output.strip()


def _serve() -> None:
    _load()
    for line in sys.stdin:
        print(json.dumps(_answer(json.loads(line))), flush=True)


def _load() -> None:
    """Import what commands do, so that none takes the time again."""
    for name in LOADED:
        importlib.import_module(name)


def _answer(case: Mapping[str, Any]) -> dict[str, Any]:
    out, err = os.memfd_create("out"), os.memfd_create("err")
    started, child = time.monotonic(), os.fork()
    if child == 0:
        _become(case, out, err)
    hung = False
    while True:
        done, status, used = os.wait4(child, os.WNOHANG)
        if done:
            break
        if time.monotonic() - started > PATIENCE:
            hung = True
            os.killpg(child, signal.SIGKILL)
        time.sleep(0.005)
    texts = []
    for stream in (out, err):
        os.lseek(stream, 0, os.SEEK_SET)
        with os.fdopen(stream, "rb") as file:
            texts.append(file.read(1_000_000).decode(errors="replace"))
    return {
        "code": os.waitstatus_to_exitcode(status),
        "hung": hung,
        "seconds": used.ru_utime + used.ru_stime,
        "megabytes": used.ru_maxrss / (1 << 10 if sys.platform != "darwin" else 1 << 20),
        "output": texts[0],
        "errors": texts[1],
    }


def _become(case: Mapping[str, Any], out: int, err: int) -> None:
    """Be the command; never returns."""
    code = 70
    try:
        os.setpgid(0, 0)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.dup2(out, 1)
        os.dup2(err, 2)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (3 * int(SECONDS),) * 2)
        resource.setrlimit(resource.RLIMIT_DATA, (4 << 30, 4 << 30))  # spares the machine
        os.chdir(case["folder"])
        os.environ.update(case["environment"])
        import tempfile

        tempfile.tempdir = None
        sys.argv = ["sblcosim", *case["arguments"]]
        for number, name in ((0, "stdin"), (1, "stdout"), (2, "stderr")):
            mode = "w" if number else "r"
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115
        from sblcosim.cli import main

        code = 0
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
        except BaseException:
            import traceback

            traceback.print_exc()
            code = 1
        sys.stdout.flush()
        sys.stderr.flush()
        import atexit

        atexit._run_exitfuncs()
    finally:
        os._exit(code)


if __name__ == "__main__":
    _serve()

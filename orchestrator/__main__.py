"""``python -m sblcosim`` is the command ``sblcosim``."""

import os
import sys

from sblcosim.fmus import stopping

_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""How many threads the libraries below NumPy use, if nobody has said it."""
_CLOSED = "error: output: must be open, got it closed\n"


def main() -> None:
    """Entry point: from here on, a signal ends the command with a line and a code."""
    _open_all()
    for name in _THREADS:  # our matrices are small: more threads mostly wait for each other
        os.environ.setdefault(name, "1")
    try:
        with stopping.stoppable(command=True):
            from .cli import main as command

            command()
    except KeyboardInterrupt as stop:  # during imports, or after everything is printed
        from .cli.common.outcome import stopped, stopped_line

        print(stopped_line(stop), file=sys.stderr)
        sys.exit(stopped(stop))
    finally:
        # With `-m`, CPython ends by the signal, and not with our code, if the last text that was
        # executed was interrupted, such as the methods of a dataclass during an import.
        exec("")


def _open_all() -> None:
    """Open the closed standard streams: otherwise the next file would get their number."""
    closed = [number for number in range(3) if not _is_open(number)]
    for number in closed:  # a new file gets the lowest free number
        os.open(os.devnull, os.O_RDONLY if number == 0 else os.O_WRONLY)
    if 2 in closed:
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115
    if 0 in closed:
        sys.stdin = open(os.devnull)  # noqa: SIM115
    if 1 in closed:
        sys.stderr.write(_CLOSED)
        sys.exit(2)


def _is_open(number: int) -> bool:
    try:
        os.fstat(number)
    except OSError:
        return False
    return True


if __name__ == "__main__":
    main()

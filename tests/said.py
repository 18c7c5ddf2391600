"""What commands say on standard error, whatever the cache holds."""

from __future__ import annotations


def apart_from_compiling(errors: str) -> str:
    """Standard error without the lines about FMUs and libraries that the cache lacked."""
    lines = errors.splitlines(keepends=True)
    return "".join(line for line in lines if not line.startswith(("compiling ", "compiled in ")))

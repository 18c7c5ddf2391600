"""The time that a receiver needs for its first fix."""

from __future__ import annotations

from typing import Any


def first_fix_s(run: Any) -> float:
    """Time from the start to the epoch of the first estimate [s]; NaN without one."""
    epochs = run.judged.epoch_s[~run.judged.broken]
    return float(epochs[0] - run.record.time_ns[0] / 1e9) if len(epochs) else float("nan")


RESPONSES = (("first_fix_s", "time to the first fix", first_fix_s),)

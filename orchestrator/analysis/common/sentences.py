"""Sentences that all analyses share."""

from __future__ import annotations


def left_out(dropped: int, common: bool) -> list[str]:
    """The number of runs that do not count, if there are any."""
    if not dropped:
        return []
    why = ", or an incomplete replicate" if common else ""
    return [f"{dropped} runs are left out: they have no finite response{why}."]

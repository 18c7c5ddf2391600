"""Processors that receivers are compiled for without FMI."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Target:
    """What a receiver is compiled for.

    Attributes
    ----------
    words
        The processor, in a few words.
    compiler, flags
        Command, and what it is told of the processor.
    board
        The board that qemu emulates; empty: the self-test runs on this machine.
    """

    words: str
    compiler: str
    flags: str
    board: str = ""


_ARM = "arm-none-eabi-gcc"
TARGETS: Mapping[str, Target] = {
    "cortex-m7": Target(
        "Cortex-M7 with a floating-point unit for doubles", _ARM,
        "-mcpu=cortex-m7 -mthumb -mfpu=fpv5-d16 -mfloat-abi=hard", "mps2-an500",
    ),
    "cortex-m4": Target(
        "Cortex-M4, whose floating-point unit has no doubles: they are computed in software", _ARM,
        "-mcpu=cortex-m4 -mthumb -mfpu=fpv4-sp-d16 -mfloat-abi=hard", "mps2-an386",
    ),
    "host": Target("the machine that compiles it", "cc", ""),
}
FLAGS = "-std=c11 -Os -ffp-contract=off -fno-math-errno -Wall -Wextra"
"""Flags for every target. Only ``-ffp-contract=off`` matters for the numbers."""

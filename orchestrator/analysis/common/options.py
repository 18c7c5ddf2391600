"""Options of a factorial analysis, and their checks."""

from __future__ import annotations

from dataclasses import dataclass
from math import log
from typing import Literal, get_args

import numpy as np

from ...errors import ConfigurationError, check_choice

Seeding = Literal["independent", "common"]
Transform = Literal["none", "log", "spread"]
Error = Literal["pure", "residual"]
Method = Literal["ols", "replicates", "lenth"]


@dataclass(frozen=True)
class Options:
    """Checked options of `sblcosim.analysis.analyse`.

    Raises
    ------
    ConfigurationError
        An option is invalid, or two options contradict each other.
    """

    seeding: Seeding
    transform: Transform
    error: Error
    practical: float | None
    confidence: float
    unit: str
    replicate: str
    run_order: str

    def __post_init__(self) -> None:
        check_choice("seeding", self.seeding, get_args(Seeding))
        check_choice("transform", self.transform, get_args(Transform))
        check_choice("error", self.error, get_args(Error))
        if self.seeding == "common" and self.error != "pure":
            raise ConfigurationError(
                f"error: must be pure with common random numbers, which compare effects between "
                f"replicates, got {self.error!r}"
            )
        if not 0 < self.confidence < 1:
            raise ConfigurationError(
                f"confidence: must be between 0 and 1, got {self.confidence}"
            )
        least = 1.0 if self.is_ratio else 0.0
        if self.practical is not None and not least < self.practical < np.inf:
            what = "a ratio above 1" if self.is_ratio else "above 0"
            raise ConfigurationError(f"practical: must be {what}, got {self.practical}")

    @property
    def is_ratio(self) -> bool:
        """Whether effects are differences of logarithms."""
        return self.transform != "none"

    @property
    def limit(self) -> float | None:
        """Smallest effect that matters, in units of the effects."""
        if self.practical is None or not self.is_ratio:
            return self.practical
        return log(self.practical)

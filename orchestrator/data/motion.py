"""What receivers learned about the diver's motion during a run."""

from __future__ import annotations

import numpy as np

from .estimates import Floats
from .record import Record

PORT = "motion_psd"
"""Output of receivers that can learn: the density q of the diver's white acceleration [m²/s³]."""


def motion_psd(record: Record, receiver: str) -> Floats | None:
    """q of the diver's motion at each update of a receiver [m²/s³]; None if it does not say."""
    values = record.values.get(f"{receiver}.{PORT}")
    if values is None:
        return None
    count = record.values[f"{receiver}.update_count"].astype(np.int64)
    new = (np.diff(count, prepend=0) != 0) & record.valid(receiver)
    known = values[new].astype(np.float64)
    known = known[np.isfinite(known)]
    return known if len(known) else None

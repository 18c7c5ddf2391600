"""White noise."""

from __future__ import annotations

from ...declaration import parameter
from ...draws import Draw
from ..range_error import RangeError

RANGE_ERROR = RangeError(
    number=1,
    words="the noise of the ranges",
    parameters=(
        parameter("range_std", "Standard deviation of the range's white noise", "m", start=0.1,
                  min=0.0),
    ),
    error=lambda p, w: p.range_std * w.noise,
    draws=(Draw("noise", "normal", "tick", 1, ("range_std",)),),
    random=(("range_std",),),
    modelled=True,
)

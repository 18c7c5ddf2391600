"""The water around a platform: a receiver's error at each place, and the possible error there.

>>> found = sblcosim.map_area("realistic-dive", "60x60", 5.0, limit_m=4.0)  # doctest: +SKIP
>>> found.save("runs/map")                                                   # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .. import lazy

if TYPE_CHECKING:
    from .distance import map_distance
    from .distance_result import DistanceCurve
    from .result import AreaMap
    from .survey import map_area

__all__ = ["AreaMap", "DistanceCurve", "map_area", "map_distance"]

if not TYPE_CHECKING:  # a type checker would accept any name
    __getattr__, __dir__ = lazy.names(__name__, {
        "AreaMap": "result", "DistanceCurve": "distance_result", "map_area": "survey",
        "map_distance": "distance",
    })  # fmt: skip

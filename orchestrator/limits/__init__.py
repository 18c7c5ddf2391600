"""What is possible: dilution of precision, a closed form, and the reference for every run.

>>> from sblcosim import limits                                            # doctest: +SKIP
>>> limits.hdop([15.0, 0.0, 5.0], limits.cross(3.0))                       # doctest: +SKIP
>>> sblcosim.run("realistic-dive", "coupled").limits.reference             # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .. import lazy

if TYPE_CHECKING:
    from .fisher import fisher_factor
    from .geometry import Dilution, cross, hdop
    from .parameters import conditions
    from .path import path_psd
    from .run import reference
    from .steady import ClosedForm, Conditions, closed_form
    from .verdict import Limits, Possible

__all__ = [
    "ClosedForm", "Conditions", "Dilution", "Limits", "Possible", "closed_form", "conditions",
    "cross", "fisher_factor", "hdop", "path_psd", "reference",
]  # fmt: skip

if not TYPE_CHECKING:  # a checker would accept any name as one of ours
    __getattr__, __dir__ = lazy.names(
        __name__,
        {
            "ClosedForm": "steady", "Conditions": "steady", "Dilution": "geometry",
            "Limits": "verdict", "Possible": "verdict", "closed_form": "steady",
            "conditions": "parameters", "cross": "geometry", "fisher_factor": "fisher",
            "hdop": "geometry", "path_psd": "path", "reference": "run",
        },
    )  # fmt: skip

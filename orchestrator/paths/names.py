"""Names of paths that are safe in file names and in topics of ROS 2, all different."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable

_LONGEST = 80


def safe(names: Iterable[str]) -> list[str]:
    """For each name, another of ASCII letters, digits and single underscores.

    It begins with a letter, and differs from all others also without regard to case.
    """
    found: list[str] = []
    taken: set[str] = set()
    for name in names:
        wanted = _plain(name)
        own, number = wanted, 1
        while own.casefold() in taken:
            number += 1
            own = f"{wanted}_{number}"
        taken.add(own.casefold())
        found.append(own)
    return found


def _plain(name: str) -> str:
    ascii_ = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    words = re.sub(r"[^A-Za-z0-9]+", "_", ascii_)[:_LONGEST].strip("_")
    return words if words[:1].isalpha() else f"path_{words}".rstrip("_")

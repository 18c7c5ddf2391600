"""Lists and plurals in sentences."""

from __future__ import annotations

from collections.abc import Sequence


def listed(
    names: Sequence[str],
    last: str = "and",
    *,
    most: int | None = None,
    shown: int | None = None,
    rest: str = "more",
) -> str:
    """``a``, ``a and b``, ``a, b and c``, ``a, b and 4 more``.

    Parameters
    ----------
    last
        Word before the last name.
    most
        Largest number of names for which all are shown; None: no limit.
    shown
        Number of names shown from a longer list, by default `most`.
    rest
        Word for the others.
    """
    if most is not None and len(names) > most:
        first = names[: most if shown is None else shown]
        return f"{', '.join(first)} and {len(names) - len(first)} {rest}"
    *others, end = names
    return f"{', '.join(others)} {last} {end}" if others else end


def first_of(names: Sequence[str], most: int, mark: str = ", ") -> str:
    """``a, b, c``: the first names, at most that many, then the number of the others."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return mark.join(names[:most]) + more


def plural(number: int, one: str, many: str = "") -> str:
    """The form that fits a number: ``run`` or ``runs``, ``is`` or ``are``."""
    return one if number == 1 else many or f"{one}s"


def counted(number: int, noun: str) -> str:
    """``1 run``, ``2,000 runs``."""
    return f"{number:,} {plural(number, noun)}"


def doing(number: int, verb: str) -> str:
    """``1 fails``, ``3 fail``."""
    return f"{number} {plural(number, f'{verb}s', verb)}"

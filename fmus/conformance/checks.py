"""All dynamic checks: see `CHECKS`. To add one, write a function, and a row here.

Each check runs in processes of its own with only the standard library, as these must start quickly.
It returns a line about what it saw, or raises one of the exceptions of `bench` with a reason.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from . import life, references, resources, robustness, state, steps
from .bench import Bench, Clauses

_WISH: Clauses = (None, None)
"""No section: whatever an FMU does here is lawful."""


@dataclass(frozen=True, slots=True)
class Check:
    """A dynamic check.

    Attributes
    ----------
    what
        The promise, as shown to people.
    steps
        Functions of the check, each run in a process of its own.
    clauses
        Sections of the standard that make the promise. Breaking it is a violation if there is one,
        otherwise a warning.
    """

    name: str
    what: str
    steps: tuple[Callable[[Bench], str], ...]
    clauses: Clauses


LOADING = Check("loading", "it can be loaded and instantiated", (life.loading,), ("2.1.5", "2.3.1"))
"""The part that `sblcosim check` runs."""

CHECKS = (
    Check(
        "functions", "every function of the standard is exported", (life.functions,), ("2.3", "2.5")
    ),
    Check(
        "life cycle",
        "it lives from instantiation to its end, and again",
        (life.find_level, life.live_again, life.free_any_time),
        ("4.2.4", "2.3"),
    ),
    Check("reset", "an instance after a reset is a fresh one", (life.reset,), ("2.1.6", "2.3.1")),
    Check(
        "save and restore",
        "a run goes on from a saved state",
        (state.save_and_restore,),
        ("2.1.8", "2.2.7.4"),
    ),
    Check(
        "serialise",
        "a run goes on from a serialised state",
        (state.serialise,),
        ("2.1.8", "2.2.7.4"),
    ),
    Check(
        "new process",
        "a run goes on from a state that another process has serialised",
        (state.write_state, state.go_on_from_state),
        ("2.1.8", "2.2.7.4"),
    ),
    Check(
        "step sizes",
        "results do not depend on how an interval is cut",
        (steps.step_sizes,),
        ("4.2.2", "4.2.1"),
    ),
    Check(
        "instances",
        "instances of one process do not disturb each other",
        (life.instances,),
        ("2.1.5", "2.3.1"),
    ),
    Check(
        "threads",
        "instances in several threads do not disturb each other",
        (life.threads,),
        ("2.1", None),  # FMI 3 speaks of several processes only
    ),
    Check(
        "derivatives",
        "directional derivatives are limits of differences",
        (steps.derivatives,),
        ("2.1.9", "2.2.12.1"),
    ),
    Check(
        "illegal calls",
        "calls out of order are answered, without a crash",
        (robustness.illegal_calls,),
        _WISH,
    ),
    Check(
        "unknown references",
        "references of no variable are refused, without a crash",
        (references.unknown_references,),
        _WISH,
    ),
    Check(
        "invalid values", "impossible values are answered", (robustness.invalid_values,), _WISH
    ),
    Check(
        "null pointers",
        "null pointers are answered, without a crash",
        (robustness.null_pointers,),
        _WISH,
    ),
    Check(
        "leaks",
        f"no memory is lost over {resources.LIVES:,} instantiations",
        (resources.leaks,),
        ("2.1.5", "2.3.1"),
    ),
)
"""All dynamic checks, in their order; those after the life cycle need its result."""

"""Included scenarios, studies and receivers, by name."""

from __future__ import annotations

from sblcosim.models import RECEIVERS

from .shown import Listing


def scenarios() -> Listing:
    """The scenarios for `sblcosim.run`: their names, each with its title."""
    from .scenario.scenario import load, shipped

    return Listing({name: load(name).title for name in shipped()})


def studies() -> Listing:
    """The studies for `sblcosim.study.load`: their names, each with its title."""
    from .study.study import load, shipped

    return Listing({name: load(name).title for name in shipped()})


def questions() -> Listing:
    """The questions for `sblcosim.require.load`: their names, each with its title."""
    from .require.question import load, shipped

    return Listing({name: load(name).study.title for name in shipped()})


def receivers() -> Listing:
    """The receivers that `sblcosim.run` knows by name, each with its description and purpose."""
    from .scenario.doubts import PURPOSES

    return Listing({
        name: component.description + (f"; for {PURPOSES[name]}" if name in PURPOSES else "")
        for name, component in RECEIVERS.items()
    })  # fmt: skip

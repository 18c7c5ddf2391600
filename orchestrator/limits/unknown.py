"""Errors of a scenario that the reference does not include: with them less is possible."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..scenario.arrangement import has_own_errors
from ..scenario.error_sources import SURVEY, UNMODELLED

if TYPE_CHECKING:
    from ..scenario.scenario import Scenario

_PLATFORM = "platform."


def left_out(scenario: Scenario) -> tuple[str, ...]:
    """Keys of nonzero errors that the reference does not include.

    Those of ``[platform]`` are without the name of the table.
    """
    known = {SURVEY} if has_own_errors(scenario.platform) else set()
    idle = {".".join(key) for key in scenario.idle()}
    return tuple(
        key.removeprefix(_PLATFORM) for key in UNMODELLED
        if _not_zero(_value(scenario, key)) and key not in known and key not in idle
    )


def _value(scenario: Scenario, key: str) -> Any:
    table, _, name = key.partition(".")
    return getattr(getattr(scenario, table), name)


def _not_zero(value: Any) -> bool:
    return any(value) if isinstance(value, tuple) else bool(value)

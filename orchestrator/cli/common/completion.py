"""Completions for the shell; where nothing fits, it offers files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cache
from textwrap import shorten
from typing import Any

LONGEST = 70
"""Longest explanation [characters]; a longer one would be wrapped, which zsh does not accept."""
Offers = list[tuple[str, str]]
"""Words, each with its explanation; bash shows the words only."""


def words(*choices: str) -> Callable[[str], Offers]:
    """Offer some words."""
    return lambda incomplete: starting([(choice, "") for choice in choices], incomplete)


def scenarios(incomplete: str) -> Offers:
    """Offer the scenarios that are included."""
    from ...scenario.library import shipped

    return starting(((name, "") for name in shipped("sblcosim.scenario")), incomplete)


def studies(incomplete: str) -> Offers:
    """Offer the studies that are included."""
    from ...scenario.library import shipped

    return starting(((name, "") for name in shipped("sblcosim.study")), incomplete)


def questions(incomplete: str) -> Offers:
    """Offer the questions that are included."""
    from ...scenario.library import shipped

    return starting(((name, "") for name in shipped("sblcosim.require")), incomplete)


def likes(incomplete: str) -> Offers:
    """Offer the kinds of system that a new scenario can begin with."""
    from ...scenario.likes import LIKES

    return starting(((name, it.about) for name, it in LIKES.items()), incomplete)


def answers(question: str) -> Callable[[str], Offers]:
    """Offer the names that answer a question of a new scenario."""

    def offers(incomplete: str) -> Offers:
        from ...scenario.decisions import DECISIONS

        return starting(((name, "") for name in DECISIONS[question].names), incomplete)

    return offers


def receivers(incomplete: str) -> Offers:
    """Offer our receivers."""
    from sblcosim.models import RECEIVERS

    return starting(((name, it.description) for name, it in RECEIVERS.items()), incomplete)


def responses(incomplete: str) -> Offers:
    """Offer the responses for which less is better."""
    from ...comparison.tournament.run import lesser

    return starting(lesser().items(), incomplete)


def components(incomplete: str) -> Offers:
    """Offer our components."""
    from sblcosim.models import COMPONENTS

    return starting(((name, it.description) for name, it in COMPONENTS.items()), incomplete)


def keys(incomplete: str) -> Offers:
    """Offer ``KEY=`` and, for a single key, its choices or its default."""
    offers: Offers = []
    last: dict[str, Any] = {}
    for key, schema in _every_key():
        start = f"{key}="
        if start.startswith(incomplete) or incomplete.startswith(start):
            offers.append((start, schema.get("description", "")))
            last = schema
    if len(offers) == 1:  # at least two words, or bash would add a space
        start, explained = offers[0]
        offers += [(f"{start}{value}", explained) for value in _values(last)]
    return starting(offers, incomplete)


@cache
def _every_key() -> tuple[tuple[str, dict[str, Any]], ...]:
    from ...scenario.file_schema import scenario_schema

    return tuple(_keys(scenario_schema()["properties"]))


def _keys(properties: dict[str, Any], above: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    for name, schema in properties.items():
        if not above and "properties" in schema:
            yield from _keys(schema["properties"], f"{name}.")
        else:
            yield f"{above}{name}", schema


def _values(schema: dict[str, Any]) -> Iterator[str]:
    from ...scenario.schema import TRUE, toml

    if schema.get("type") == "boolean":
        yield from ("true", "false")
        return
    words = [value for one in (schema, *schema.get("anyOf", ())) for value in one.get("enum", ())]
    yield from (str(value) for value in words if value != TRUE)  # a word of TOML
    if "default" in schema and schema["default"] not in words:
        yield toml(schema["default"])


def starting(offers: Iterable[tuple[str, str]], incomplete: str) -> Offers:
    """The offers that begin with what was typed."""
    return [
        (word, shorten(explained, LONGEST, placeholder="…"))
        for word, explained in offers
        if word.startswith(incomplete)
    ]

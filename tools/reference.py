"""Write the parts of the reference that follow from the sources into the pages of ``docs``.

    python tools/reference.py

A page says where with a pair of comments, which no reader sees: ``<!-- made: KIND ARGUMENT -->``
and ``<!-- end -->``. Between them stands what a function of `KINDS` makes. A test compares the
pages with it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from sblcosim.cli.common.app import app
from sblcosim.cli.documents.by_command import DOCUMENTS, schema
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.declaration import (
    INT32_MAX,
    Component,
    Condition,
    Variable,
    noise_keys,
)
from sblcosim.models.ports import BEACONS
from sblcosim.models.settings.assumptions import SOURCES
from sblcosim.models.settings.keys import default
from sblcosim.results import more
from sblcosim.scenario.likes import LIKES
from sblcosim.scenario.scenario import Scenario, load
from sblcosim.scenario.schema import (
    COMMON,
    CORE_COMPONENTS,
    range_of,
    rows,
    toml,
)
from sblcosim.scenario.settings import description
from sblcosim.scenario.units import unit_of
from typer.main import get_command

# --- Keys of scenario files ----------------------------------------------------------------------

_STEP = ("time.sampling_time_s",)
_UPDATE = (*_STEP, "time.ekf_ratio")
FOLLOWS: Mapping[str, Sequence[str]] = {
    **{f"{name}.sampling_time_s": _STEP for name in CORE_COMPONENTS},
    **{f"{name}.interval_s": ("acoustics.sampling_time_s",) for name in CORE_COMPONENTS},
    **{f"{name}.seed": ("seed",) for name in CORE_COMPONENTS},
    **{f"{name}.fmi": ("fmi",) for name in (*CORE_COMPONENTS, "receiver")},
    "target.waypoint_count": ("target.waypoint_m",),
    "target.track_count": ("target.track_time_s",),
    "target.track_time_s": ("target.track_file",),
    "target.track_m": ("target.track_file",),
    "platform.track_count": ("platform.track_time_s",),
    "platform.track_time_s": ("platform.track_file",),
    "platform.track_m": ("platform.track_file",),
    "platform.track_heading_deg": ("platform.track_file",),
    **{
        f"place.{key}": ("target.track_file", "platform.track_file")
        for key in ("latitude_deg", "longitude_deg")
    },
    "receiver.update_interval_s": _UPDATE,
    "receiver.interval_s": ("receiver.update_interval_s",),
    "receiver.range_std_m": ("acoustics.range_std_m",),
    "receiver.depth_std_m": ("target.depth_std_m",),
    **{f"receiver.{key}": sources for key, sources in SOURCES.items()},
}
"""Keys whose default follows from other keys, and these."""
_DERIVED = "derived"
NOISE = {variable.key for variable in noise_keys()}
"""Keys that have an effect if any of a component's many random errors is there."""


def tables() -> list[str]:
    """The tables of a scenario file; the first is that of the keys outside any table."""
    fields = Scenario.model_fields.items()
    return ["", *(name for name, field in fields if hasattr(field.annotation, "variables"))]


def keys(table: str) -> list[str]:
    """The keys of a table of a scenario file, those that all tables have at the end."""
    if not table:
        return [key for key in Scenario.model_fields if key not in tables()]
    fields: Any = Scenario.model_fields[table].annotation
    return sorted(fields.model_fields, key=lambda key: key in COMMON)


def entries(table: str = "") -> Iterator[str]:
    """The keys of a table of a scenario file, a row each; without a name those in no table."""
    receiver = table == "receiver"
    last = ["of"] if receiver else []
    yield from _head("key", "what it is", "unit", "default", "values", *last)
    for key in keys(table):
        takers = _takers(table, key)
        name = f"{table}.{key}" if table else key
        facts = dict(_facts(name, takers) if takers else _facts_of(name))
        text = f"{_plain(_schema(table).model_fields[key].description)}."
        if "Used if" in facts:
            text += f" Used if {facts['Used if']}."
        if name in FOLLOWS:
            text += f" Derived from {_listed([f'`{key}`' for key in FOLLOWS[name]], 'and')}."
        values = facts.get("One of") or facts.get("Bounds", "")
        of = [facts.get("Of", "all")] if receiver else []
        yield _row(f"`{name}`", text, facts.get("Unit", ""), facts.get("Default", ""), values, *of)


def _schema(table: str) -> Any:
    return Scenario.model_fields[table].annotation if table else Scenario


def _takers(table: str, key: str) -> dict[str, tuple[Component, Variable]]:
    """The components with this parameter, by the names under which people choose them."""
    ours: Mapping[str, Component] = (
        RECEIVERS if table == "receiver" else {table: COMPONENTS[table]}
        if table in CORE_COMPONENTS else {}
    )
    return {
        name: (component, variable)
        for name, component in ours.items()
        for variable in component.of("parameter") if variable.key == key
    }


def _facts(name: str, takers: dict[str, tuple[Component, Variable]]) -> Iterator[tuple[str, str]]:
    """What the declarations say; by component, where they differ."""
    if name.startswith("receiver."):
        others = RECEIVERS.keys() - takers
        named = ", ".join(f"`{taker}`" for taker in takers)
        yield "Of", "all of ours" if not others else (
            f"all but `{others.pop()}`" if len(others) == 1 else named
        )
    for fact, of in (("Unit", _unit), ("One of", _choices), ("Default", _default),
                     ("Bounds", _bounds), ("Used if", _effect)):
        if fact == "Default" and name in FOLLOWS:
            yield fact, _DERIVED
            continue
        texts: dict[str, list[str]] = {}
        for taker, (component, variable) in takers.items():
            texts.setdefault(of(component, variable), []).append(f"`{taker}`")
        if set(texts) == {""}:
            continue
        several = len(texts) > 1
        yield fact, "; ".join(
            f"{', '.join(who)}: {text or 'always'}" if several else text
            for text, who in texts.items()
        )


def _facts_of(name: str) -> Iterator[tuple[str, str]]:
    """What the schema says of a key that is no parameter."""
    table, _, key = name.rpartition(".")
    said = _schema(table).model_json_schema()["properties"][key]
    kinds = [kind for kind in said.get("anyOf", ()) if kind != {"type": "null"}]
    said = (kinds[0] if len(kinds) == 1 else {}) | said
    if unit_of(key):
        yield "Unit", unit_of(key)
    if "enum" in said:
        yield "One of", ", ".join(f"`{toml(value)}`" for value in said["enum"])
    if name in FOLLOWS:
        yield "Default", _DERIVED
    elif said.get("default") is not None:
        yield "Default", f"`{toml(said['default'])}`"
    if "minimum" in said and said["maximum"] != INT32_MAX:
        yield "Bounds", f"{_short(said['minimum'])} to {_short(said['maximum'])}"


def _unit(component: Component, variable: Variable) -> str:
    return unit_of(variable.key)


def _choices(component: Component, variable: Variable) -> str:
    return ", ".join(f"`{name}`" for name in (variable.choices or {}).values())


def _default(component: Component, variable: Variable) -> str:
    return f"`{toml(rows(variable, default(component, variable)))}`"


def _bounds(component: Component, variable: Variable) -> str:
    if variable.choices is not None or variable.type == "Boolean":
        return ""
    names = "".join(f", or `{toml(name)}`" for name in variable.named or ())
    low, high = (
        None if bound is None or bound == INT32_MAX else _short(bound)
        for bound in range_of(variable)
    )
    if high is None:
        return names.removeprefix(", or ") if low is None else f"at least {low}{names}"
    return f"at most {high}{names}" if low is None else f"{low} to {high}{names}"


def _short(number: float) -> str:
    """``1e-6``, where Python has 1e-06."""
    return re.sub(r"e([+-])0*", lambda e: "e" + e[1].strip("+"), f"{number:g}")


def _effect(component: Component, variable: Variable) -> str:
    """When a parameter has an effect: at least one condition of each group holds."""
    if variable.key in NOISE:
        return "something of the component is random" if variable.needs else ""
    return "; and ".join(_any_of(component, group) for group in variable.needs)


def _any_of(component: Component, group: Sequence[Condition]) -> str:
    names: dict[str, list[str]] = {}
    for condition in group:
        other = component[condition.parameter]
        names.setdefault(_met(other, condition), []).append(f"`{other.key}`")
    return " or ".join(f"{_listed(keys, 'or')} {holds}" for holds, keys in names.items())


def _met(other: Variable, condition: Condition) -> str:
    """What the other parameter must be; if it can be most things, what it must not be."""
    if other.type == "Boolean":
        return f"is `{toml(condition.values in ((), (1,)))}`"
    if not condition.values:
        return "is not 0"
    if not other.choices:
        return f"is {_listed([toml(v) for v in condition.values], 'or')}"
    choices = other.choices
    names = [choices.get(v, toml(v)) for v in condition.values]
    others = [name for name in choices.values() if name not in names]
    if 0 < len(others) < len(names):
        return f"is not {_listed([f'`{name}`' for name in others], 'or')}"
    return f"is {_listed([f'`{name}`' for name in names], 'or')}"


def _listed(words: Sequence[str], last: str) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"


# --- Commands ------------------------------------------------------------------------------------


def commands() -> dict[str, Any]:
    """The commands by what is typed before their arguments, ``export ssp``."""
    return dict(_commands(get_command(app), ""))


def _commands(group: Any, above: str) -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands(command, f"{above}{name} ")
        else:
            yield f"{above}{name}", command


def command_pages() -> Iterator[str]:
    """All commands, in the order of the help, each with its arguments and options."""
    for name, command in commands().items():
        context = command.make_context(name, [], resilient_parsing=True)
        usage = re.sub("[{}]", "", " ".join(command.collect_usage_pieces(context)))
        yield from (f"## {name}", "", f"    sblcosim {name} {usage}", "", _plain(command.help), "")
        records = [parameter.get_help_record(context) for parameter in command.params]
        yield from _head("argument or option", "what it is")
        for typed, words in filter(None, records):
            shown = re.sub(r" <[^ ]+>$", "", typed)  # without an argument's type
            yield _row(f"`{shown}`", _plain(words))
        yield ""


# --- JSON ----------------------------------------------------------------------------------------


def json_pages() -> Iterator[str]:
    """Markdown of all documents, and of their parts."""
    parts: dict[str, Any] = {}
    for command, document in DOCUMENTS.items():
        said = schema(command)
        parts |= said.get("$defs", {})
        same = next(name for name, other in DOCUMENTS.items() if other is document)
        yield from (f"## {command}", "")
        yield from (_json(said) if same == command else [f"As of `{same}`.", ""])
    yield from ("## Parts", "")
    for name, part in sorted(parts.items()):
        yield from (f"### {name}", "", *_json(part), "")


def _json(said: Mapping[str, Any]) -> Iterator[str]:
    """What an object is, and a line for each of its names."""
    yield from (_plain(said["description"]), "")
    for name, field in said["properties"].items():
        text = field.get("description", "").rstrip(".")
        yield f"- `{name}` ({_json_type(field)}){f': {_plain(text)}.' if text else ''}"
    yield ""


def _json_type(said: Mapping[str, Any]) -> str:
    """The type of a value, with references to parts; an arrow leads from names to values."""
    if "$ref" in said:
        name = said["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    if "anyOf" in said:
        return _listed([_json_type(one) for one in said["anyOf"]], "or")
    if "enum" in said:
        return _listed([f"`{value}`" for value in said["enum"]], "or")
    if said["type"] == "array":
        return f"list of {_json_type(said['items'])}"
    if said["type"] == "object":
        names = _json_type(said.get("propertyNames", {"type": "name"}))
        return f"{names} → {_json_type(said['additionalProperties'])}"
    return str(said["type"])


# --- Columns of tables ---------------------------------------------------------------------------


def columns(name: str) -> Iterator[str]:
    """Markdown of the columns of a table; those with the same text share the last's row."""
    module, _, name = name.rpartition(".")
    declared = getattr(import_module(module), name)
    alike: dict[tuple[str, str], list[str]] = {}
    for column in (*declared.index, *declared.columns):
        one_of = ", ".join(f"`{word}`" for word in column.choices)
        words = _plain(column.description)
        if one_of:
            words = f"{words.removesuffix('.')}: {one_of}"
        others = alike.pop((column.unit, words), [])
        alike[column.unit, words] = [*others, f"`{column.name}`"]
    yield from _head("column", "unit", "what it is")
    for (unit, words), names in alike.items():
        yield _row(", ".join(names), unit, words)
    if declared.more:
        yield _row("…", "", declared.more)


# --- Systems to begin with -----------------------------------------------------------------------


def likes() -> Iterator[str]:
    """Markdown of the systems that a scenario may begin like."""
    yield from _head("`--like`", "what it is", "receiver")
    for name, it in LIKES.items():
        shipped = f" (`{it.source}`)" if isinstance(it.source, str) else ""
        receiver = load(it.source).receiver.type
        yield _row(f"`{name}`", f"{_plain(it.about)}{shipped}", f"`{receiver}`")


def _plain(text: str) -> str:
    """A help text as Markdown that shows it as it is; options and double backticks are code."""
    marked = re.sub(r"(?<![\w`-])(--[a-z][\w-]*)", r"``\1``", text.replace("\b", ""))
    parts = marked.split("``")
    return "".join(
        f"`{part}`" if i % 2 else re.sub(r"([<*_`])", r"\\\1", part)
        for i, part in enumerate(parts)
    )


# --- Responses and figures that are a file each --------------------------------------------------


def further() -> Iterator[str]:
    """Markdown of the responses and figures in ``results/more``."""
    rows = [(name, "a response", words) for name, words, _ in more.rows("RESPONSES")]
    rows += [
        (it.name, "a figure of a run", str(it.plot.__doc__).partition("\n")[0])
        for it in more.rows("FIGURES")
    ]
    yield from _head("name", "what it is", "what it says")
    for name, of, words in rows:
        yield _row(f"`{name}`", of, _plain(words).rstrip("."))


# --- Start values --------------------------------------------------------------------------------


def computed() -> Iterator[str]:
    """Markdown of the parameters that the settings module computes, and of what they depend on."""
    found = description(int(BEACONS))
    alike: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for name, keys in found["depends"].items():
        component, _, parameter = name.partition(".")
        alike.setdefault((parameter, tuple(keys)), []).append(component)
    yield from _head("parameter", "of", "depends on")
    for (parameter, keys), components in alike.items():
        shown = ", ".join(f"`{it}`" for it in keys)
        yield _row(f"`{parameter}`", ", ".join(f"`{it}`" for it in components), shown)


def without_module() -> Iterator[str]:
    """Markdown of the keys that the settings module does not take, by table."""
    found = description(int(BEACONS))
    taken = {it.partition("[")[0] for it in found["keys"]} | {*found["copies"].values()}
    yield from _head("table", "keys")
    for table in tables():
        own = [key for key in keys(table) if (f"{table}.{key}" if table else key) not in taken]
        if own:
            yield _row(f"`{table}`" if table else "none", ", ".join(f"`{key}`" for key in own))


# --- Names of Python -----------------------------------------------------------------------------


def names(module: str) -> Iterator[str]:
    """The public names of a package, each with the first sentence of what it says of itself."""
    package = import_module(module)
    yield from _head("name", "what it is")
    for name in package.__all__:
        said = getattr(getattr(package, name), "__doc__", None) or ""
        if not name.startswith("__"):
            first = " ".join(said.partition("\n\n")[0].split())
            yield _row(f"`{name}`", _plain(first.replace("`", "")))


# --- Pages ---------------------------------------------------------------------------------------


def _head(*words: str) -> tuple[str, str]:
    return _row(*words), "|" + "---|" * len(words)


def _row(*cells: str) -> str:
    """A row of a table; a bar in a cell does not end it."""
    escaped = (cell.replace("|", "\\|") for cell in cells)
    return f"| {' | '.join(escaped)} |"


KINDS: Mapping[str, Callable[..., Iterator[str]]] = {
    "keys": entries, "commands": command_pages, "json": json_pages, "columns": columns,
    "likes": likes, "more": further, "names": names, "computed": computed,
    "without_module": without_module,
}  # fmt: skip
PAGES = sorted(
    path for path in (Path(__file__).parents[1] / "docs").rglob("*.md") if "made" not in path.parts
)
_MADE = re.compile(r"(<!-- made: (\w+)(?: (\S+))? -->\n).*?(<!-- end -->)", re.DOTALL)


def current(text: str) -> str:
    """The text of a page with all that is made of the sources as it is now."""

    def made(found: re.Match[str]) -> str:
        lines = KINDS[found[2]](*filter(None, [found[3]]))
        return f"{found[1]}\n" + "\n".join(lines).strip("\n") + f"\n\n{found[4]}"

    return _MADE.sub(made, text)


if __name__ == "__main__":
    for page in PAGES:
        page.write_text(current(page.read_text("utf-8")), "utf-8")

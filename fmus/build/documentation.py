"""The documentation page inside an FMU."""

from __future__ import annotations

import re
from collections.abc import Sequence
from importlib.resources import files
from typing import TYPE_CHECKING

import jinja2
from markdown_it import MarkdownIt
from markdown_it.rules_inline import StateInline
from sblcosim.models import COMPONENTS, module_of
from sblcosim.models.declaration import Variable

from ..standard import Fmi
from .description import literal

if TYPE_CHECKING:
    from sblcosim.models.equations import Model

_HEADINGS = {"parameter": "Parameters", "input": "Inputs", "output": "Outputs"}
_FORMULA = re.compile(r"(?P<fence>\${1,2})(?P<formula>.+?)(?P=fence)", re.DOTALL)


def index_html(model: Model, fmi: Fmi) -> str:
    """Return documentation/index.html: one file that is readable offline."""
    component = model.component
    template = files(__package__).joinpath("documentation.html.jinja").read_text("utf-8")
    environment = jinja2.Environment(
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
    )
    return environment.from_string(template).render(
        component=component,
        fmi=fmi,
        groups=[
            (heading, [_row(v) for v in component.of(causality)])  # type: ignore[arg-type]
            for causality, heading in _HEADINGS.items()
        ],
        feedthrough=sorted(model.feedthrough),
        readme=_readme(model),
    )


def _row(variable: Variable) -> dict[str, str]:
    return {
        "name": variable.name,
        "type": variable.type + "".join(f"[{size}]" for size in variable.shape),
        "variability": str(variable.variability),
        "unit": variable.unit or "",
        "start": "" if variable.causality == "output" else _starts(variable),
        "range": _range(variable),
        "description": variable.legend,
    }


def _starts(variable: Variable) -> str:
    return ", ".join(_once([literal(variable, value) for value in variable.starts]))


def _once(texts: Sequence[str]) -> Sequence[str]:
    """A value common to all elements is shown once."""
    return texts[:1] if len(set(texts)) == 1 else texts


def _range(variable: Variable) -> str:
    low, high = (
        None if bound is None else literal(variable, bound)
        for bound in (variable.min, variable.max)
    )
    if low is not None and high is not None:
        return f"{low} … {high}"
    if low is not None:
        return f"≥ {low}"
    return "" if high is None else f"≤ {high}"


def _readme(model: Model) -> str:
    """Return the README of the component's folder as HTML, its headings one level down."""
    if model.readme is not None:
        return markdown(model.readme)
    for name, known in COMPONENTS.items():
        if known.name == model.component.name:
            path = files(f"sblcosim.models.{module_of(name)[0]}").joinpath("README.md")
            return markdown(path.read_text("utf-8")) if path.is_file() else ""
    return ""


def markdown(text: str) -> str:
    """Return the HTML of a Markdown text, its headings one level down, formulas as typed."""
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    parser.inline.ruler.before("escape", "formula", _formula)
    tokens = parser.parse(text)
    for token in tokens:
        if token.type in ("heading_open", "heading_close"):
            token.tag = f"h{min(int(token.tag[1:]) + 1, 6)}"
    return str(parser.renderer.render(tokens, parser.options, {}))


def _formula(state: StateInline, silent: bool) -> bool:
    """Show a formula between dollar signs as code: emphasis and escapes would garble it."""
    match = _FORMULA.match(state.src, state.pos)
    if match is None:
        return False
    if not silent:
        state.push("code_inline", "code", 0).content = match["formula"].strip()
    state.pos = match.end()
    return True

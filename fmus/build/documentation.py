"""The documentation page inside an FMU."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from importlib.resources import files
from typing import TYPE_CHECKING

import jinja2
from sblcosim.models import COMPONENTS, module_of
from sblcosim.models.declaration import Variable

from ..standard import Fmi
from .description import literal
from .formulas import FONTS, Symbol, linked, mathml, of_page, parser, used
from .ingredients import pages

if TYPE_CHECKING:
    from sblcosim.models.equations import Model

_HEADINGS = {"parameter": "Parameters", "input": "Inputs", "output": "Outputs"}
_ELSEWHERE = re.compile(r"<!-- not in the FMU -->.*?<!-- in the FMU -->", re.DOTALL)
_COMMENT = re.compile(r"<!--.*?-->\n?", re.DOTALL)


def index_html(model: Model, fmi: Fmi) -> str:
    """Return documentation/index.html: one file that is readable offline."""
    component = model.component
    readme, symbols = _readme(model)
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
        fonts=FONTS,
        groups=[
            (heading, [_row(v) for v in component.of(causality)])  # type: ignore[arg-type]
            for causality, heading in _HEADINGS.items()
        ],
        feedthrough=sorted(model.feedthrough),
        readme=readme,
        symbols=symbols,
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


def _readme(model: Model) -> tuple[str, list[dict[str, str]]]:
    """What is written about a component as HTML, and the symbols in its formulas."""
    if model.readme is not None:
        return markdown(model.readme), []
    for name, known in COMPONENTS.items():
        if known.name == model.component.name:
            folder = module_of(name)[0]
            return _with_symbols(told(name), of_page(folder, name))
    return "", []


def told(name: str) -> str:
    """What is written about a component, without what is about other things than its FMU."""
    texts = {page: content.decode("utf-8") for page, content in pages(name).items()}
    for page in texts.keys() - {"README.md", f"{name}.md"}:  # its heading is another's name
        texts[page] = texts[page].partition("\n")[2]
    return _COMMENT.sub("", _ELSEWHERE.sub("", "\n\n".join(texts.values())))


def _with_symbols(
    text: str, known: Mapping[str, Symbol]
) -> tuple[str, list[dict[str, str]]]:
    rows: dict[str, Symbol] = {}

    def render(latex: str, display: bool) -> str:
        rows.update({it.place: it for _, it in used(latex, known) if it is not None})
        return linked(latex, display, known, "#{}".format)

    html, plain = markdown(text, render), parser(mathml)
    return html, [
        {
            "place": it.place, "symbol": mathml(it.latex), "unit": it.unit,
            "words": plain.renderInline(it.words),
        }
        for it in known.values() if it.place in rows
    ]  # fmt: skip


def markdown(text: str, render: Callable[[str, bool], str] = mathml) -> str:
    """The HTML of a Markdown text, its headings one level down, formulas as MathML."""
    parse = parser(render)
    tokens = parse.parse(text)
    for token in tokens:
        if token.type in ("heading_open", "heading_close"):
            token.tag = f"h{min(int(token.tag[1:]) + 1, 6)}"
    return str(parse.renderer.render(tokens, parse.options, {}))

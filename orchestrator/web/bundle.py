"""JavaScript modules as one script: pages hold it, so they need no network and no other file.

The modules are those of ``js/``, as browsers read them. Of their syntax, only two forms are
bundled: ``import { a, b } from "./other.js";`` and ``export`` before a function, class or constant.
"""

from __future__ import annotations

import re
from importlib import resources

_IMPORT = re.compile(
    r'^import \{\s*(\w+(?:,\s*\w+)*,?)\s*\} from "\./(\w+)\.js";\n', re.MULTILINE
)
_EXPORT = re.compile(r"^export (?=(?:async function|function|class|const) (\w+))", re.MULTILINE)
_OTHER = re.compile(r"^(?:import|export)\b.*", re.MULTILINE)


def source(name: str) -> str:
    """Text of a file of this room."""
    return (resources.files("sblcosim.web") / name).read_text("utf-8")


def bundled(main: str) -> str:
    """A module and all that it imports, each in a function of its own, as one script.

    Parameters
    ----------
    main
        Name of a module without its ending, as in ``replay``.

    Raises
    ------
    ValueError
        A module imports or exports in another form, or modules import each other.
    """
    done: dict[str, str] = {}
    _add(main, done, ())
    return "\n".join(['"use strict";', "const modules = {};", *done.values()])


def _add(name: str, done: dict[str, str], above: tuple[str, ...]) -> None:
    """Add a module after those that it imports."""
    if name in above:
        raise ValueError(f"modules must not import each other, got {' → '.join([*above, name])}")
    text = source(f"js/{name}.js")
    for _, other in _IMPORT.findall(text):
        if other not in done:
            _add(other, done, (*above, name))
    names = _EXPORT.findall(text)
    text = _IMPORT.sub(r"const { \1 } = modules.\2;\n", text)
    text = _EXPORT.sub("", text)
    if wrong := _OTHER.search(text):
        raise ValueError(f"{name}.js: must be written as only two forms allow, got {wrong[0]}")
    done[name] = f"modules.{name} = (() => {{\n{text}return {{ {', '.join(names)} }};\n}})();"

"""JavaScript modules as one script: pages hold it, so they need no network and no other file.

The modules are those of this package, as browsers read them. Of their syntax, only two forms are
bundled: ``import { a, b } from "./other.js";``, also from another folder, and ``export`` before a
function, class or constant.
"""

from __future__ import annotations

import re
from importlib import resources
from posixpath import dirname, join, normpath

_IMPORT = re.compile(
    r'^import \{\s*([\w$]+(?:,\s*[\w$]+)*,?)\s*\} from "(\.{1,2}/[\w/.]+)\.js";\n', re.MULTILINE
)
_EXPORT = re.compile(r"^export (?=(?:async function|function|class|const) ([\w$]+))", re.MULTILINE)
_OTHER = re.compile(r"^(?:import|export)\b.*", re.MULTILINE)


def source(name: str) -> str:
    """Text of a file of this room."""
    return (resources.files("sblcosim.web") / name).read_text("utf-8")


def module(path: str) -> str:
    """Text of a module, by its path in this package without its ending: ``web/js/replay``."""
    return resources.files("sblcosim").joinpath(f"{path}.js").read_text("utf-8")


def bundled(main: str) -> str:
    """A module and all that it imports, each in a function of its own, as one script.

    Parameters
    ----------
    main
        Path of a module in this package without its ending, as in ``web/js/replay``.

    Raises
    ------
    ValueError
        A module imports or exports in another form, or a name that is not exported, or modules
        import each other.
    """
    done: dict[str, str] = {}
    _add(main, done, ())
    return "\n".join(['"use strict";', "const modules = {};", *done.values()])


def _add(path: str, done: dict[str, str], above: tuple[str, ...]) -> None:
    """Add a module after those that it imports."""
    if path in above:
        raise ValueError(f"modules must not import each other, got {' → '.join([*above, path])}")
    text = module(path)

    def imported(found: re.Match[str]) -> str:
        return f"const {{ {found[1]} }} = modules.{_name(_from(path, found[2]))};\n"

    for wanted, other in _IMPORT.findall(text):
        if (there := _from(path, other)) not in done:
            _add(there, done, (*above, path))
        if missing := {*re.findall(r"[\w$]+", wanted)} - {*_EXPORT.findall(module(there))}:
            raise ValueError(f"{there}.js: must export {min(missing)}, which {path}.js imports")
    names = _EXPORT.findall(text)
    text = _EXPORT.sub("", _IMPORT.sub(imported, text))
    if wrong := _OTHER.search(text):
        raise ValueError(f"{path}.js: must be written as only two forms allow, got {wrong[0]}")
    inner = f"(() => {{\n{text}return {{ {', '.join(names)} }};\n}})()"
    done[path] = f"modules.{_name(path)} = {inner};"


def _from(path: str, other: str) -> str:
    """Path of a module that another one imports."""
    return normpath(join(dirname(path), other))


def _name(path: str) -> str:
    """Name of a module in the script: that of ``web/js/map`` is ``web_map``."""
    return path.replace("/js/", "/").replace("/", "_")

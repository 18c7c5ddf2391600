"""Faults of the environment: things that an FMU needs and this machine does not have.

They are no verdict on the FMU, because another machine may have them. A loader's message is
certain. For an FMU's own log, the words are the only evidence.
"""

from __future__ import annotations

import re
from pathlib import Path

_LOADER = (
    (r"(\S+): cannot open shared object file", "it needs {}, which is not on this machine"),
    (r"Library not loaded: (\S+)", "it needs {}, which is not on this machine"),
    (r"WinError 126|Could not find module .* \(or one of its dependencies\)",
     "it needs another library, which is not on this machine"),
    (r"version [`']([^']+)' not found \(required by",
     "it needs {}, and the system's library is older"),
    (r"symbol (\S+), version \S+ not defined in file",
     "it needs {}, which the system's library does not have"),
    (r"undefined symbol: _?(Py[A-Z_]\w*)", "it needs {} of a Python interpreter's library"),
    (r"failed to map segment from shared object",
     "programs may not be run from the folder for temporary files"),
    (r"cannot enable executable stack", "the system does not let it have an executable stack"),
    (r"cannot allocate memory in static TLS block", "the process has no room for its variables"),
)  # fmt: skip
"""Messages of the loaders of Linux, macOS and Windows, and what they mean."""

_TOOLS = (
    "python|java|jvm|jre|matlab|octave|julia|wine|docker|interpreter|runtime|executable|program|"
    "solver|server|daemon|broker|proxy|tool|package|module|librar(?:y|ies)|display"
)
_FAILED = "(?:could ?n[o']t|can ?n?[o']t|failed to|unable to)"
_LOGGED = (
    (r"\blicen[cs]|\blizenz|flex(?:lm|net)|\blmgrd\b|\bdongle\b", "a licence"),
    (r"No module named|ModuleNotFoundError|ImportError", "a Python module"),
    (r"cannot open shared object file|Library not loaded|error while loading shared libraries",
     "a shared library"),
    (r"connection (?:refused|timed out)|could not resolve host|name or service not known|"
     r"network is unreachable", "a server"),
    (r"command not found|not installed|No space left on device|"
     rf"\b(?:{_TOOLS})\b.{{0,80}}(?:not found|not available|unavailable|is missing)|"
     rf"{_FAILED} (?:be )?(?:find|locate|start|launch|load|open|reach|contact|connect to)\b"
     rf".{{0,80}}\b(?:{_TOOLS})\b", "something"),
)  # fmt: skip
"""Messages of FMUs, and what they lack."""


def of_loader(text: str, folder: Path) -> str | None:
    """What is missing, from the loader's message about a library; None: it is the FMU's fault.

    Parameters
    ----------
    folder
        Folder of the unpacked FMU: a library inside it is present but was not found.
    """
    for pattern, meaning in _LOADER:
        match = re.search(pattern, text)
        if match is None:
            continue
        name = Path(match[1]).name if match.groups() else ""
        if name and any(path.name == name for path in folder.rglob("*")):
            return None
        return meaning.format(*match.groups()) + _documented(folder)
    return None


def _documented(folder: Path) -> str:
    """Pointer to the FMU's list of dependencies, if any (FMI 2.0.5, 2.3; FMI 3.0.2, 2.5.1)."""
    for name in ("externalDependencies.txt", "externalDependencies.html"):
        if (folder / "documentation" / name).is_file():
            return f"; see documentation/{name} in the FMU"
    return ""


def of_log(text: str) -> str | None:
    """What is missing, from an FMU's log when it refused a call that must succeed."""
    for pattern, what in _LOGGED:
        if re.search(pattern, text, re.IGNORECASE):
            return f"{what} is missing"
    return None

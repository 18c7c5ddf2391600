"""Co-simulation of a short-baseline acoustic positioning system for divers.

>>> import sblcosim                                            # doctest: +SKIP
>>> result = sblcosim.run("paper-scenario-1", receiver="ekf")  # doctest: +SKIP
>>> print(result)                                              # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import analysis, study
    from .api import run
    from .errors import ConfigurationError, FmuError, SblcosimError
    from .export import export_fmu, export_ssp
    from .result import Result
    from .scenario import Scenario, load

__all__ = [
    "ConfigurationError",
    "FmuError",
    "Result",
    "SblcosimError",
    "Scenario",
    "__version__",
    "analysis",
    "export_fmu",
    "export_ssp",
    "load",
    "run",
    "study",
]

_HOMES = {
    "ConfigurationError": "errors",
    "FmuError": "errors",
    "Result": "result",
    "SblcosimError": "errors",
    "Scenario": "scenario",
    "export_fmu": "export",
    "export_ssp": "export",
    "load": "scenario",
    "run": "api",
}
_MODULES = ("analysis", "study")


def __getattr__(name: str) -> Any:
    # Imported when first used: `sblcosim --help` must not wait for pandas and matplotlib.
    if name == "__version__":
        from importlib.metadata import version

        return version("sblcosim")
    from importlib import import_module

    if name in _MODULES:
        return import_module(f".{name}", __name__)
    if name in _HOMES:
        return getattr(import_module(f".{_HOMES[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__

"""Co-simulation of a short-baseline acoustic positioning system for divers.

>>> import sblcosim                                            # doctest: +SKIP
>>> result = sblcosim.run("paper-scenario-1", receiver="ekf")  # doctest: +SKIP
>>> print(result)                                              # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from . import lazy

if TYPE_CHECKING:
    from sblcosim.models.declaration import Variable

    from . import analysis, limits, require, research, study
    from .api import run
    from .areas.distance import map_distance
    from .areas.survey import map_area
    from .comparison.budget.run import budget
    from .comparison.many.run import run_many
    from .comparison.tournament.run import compare
    from .errors import ConfigurationError, FmuError, SblcosimError
    from .estimation.after import Smoothed, smooth
    from .export.container import export_fmu
    from .export.firmware import export_firmware
    from .export.ssp import export_ssp
    from .identification.result import Identified
    from .identification.run import identify
    from .listings import questions, receivers, scenarios, studies
    from .logs.contents import log
    from .logs.log import Log
    from .logs.read import read_log
    from .processing.processed import Processed
    from .processing.workflow import process
    from .results.result import Result
    from .scenario.keys import Overrides
    from .scenario.scenario import Scenario, load
    from .simulation.receiver import Depth, Estimate, Range, Receiver
    from .simulation.system import PythonComponent

    __version__: str

__all__ = [
    "ConfigurationError",
    "Depth",
    "Estimate",
    "FmuError",
    "Identified",
    "Log",
    "Overrides",
    "Processed",
    "PythonComponent",
    "Range",
    "Receiver",
    "Result",
    "SblcosimError",
    "Scenario",
    "Smoothed",
    "Variable",
    "__version__",
    "analysis",
    "budget",
    "compare",
    "export_firmware",
    "export_fmu",
    "export_ssp",
    "identify",
    "limits",
    "load",
    "log",
    "map_area",
    "map_distance",
    "process",
    "questions",
    "read_log",
    "receivers",
    "require",
    "research",
    "run",
    "run_many",
    "scenarios",
    "smooth",
    "studies",
    "study",
]

if not TYPE_CHECKING:  # a type checker would accept any name
    _get, __dir__ = lazy.names(
        __name__,
        {
            "ConfigurationError": "errors",
            "Depth": "simulation.receiver",
            "Estimate": "simulation.receiver",
            "FmuError": "errors",
            "Identified": "identification.result",
            "Log": "logs.log",
            "Overrides": "scenario.keys",
            "Processed": "processing.processed",
            "PythonComponent": "simulation.system",
            "Range": "simulation.receiver",
            "Receiver": "simulation.receiver",
            "Result": "results.result",
            "SblcosimError": "errors",
            "Scenario": "scenario.scenario",
            "Smoothed": "estimation.after",
            "Variable": "models.declaration",
            "__version__": "",
            "analysis": "",
            "budget": "comparison.budget.run",
            "compare": "comparison.tournament.run",
            "export_firmware": "export.firmware",
            "export_fmu": "export.container",
            "export_ssp": "export.ssp",
            "identify": "identification.run",
            "limits": "",
            "load": "scenario.scenario",
            "log": "logs.contents",
            "map_area": "areas.survey",
            "map_distance": "areas.distance",
            "process": "processing.workflow",
            "questions": "listings",
            "read_log": "logs.read",
            "receivers": "listings",
            "require": "",
            "research": "",
            "run": "api",
            "run_many": "comparison.many.run",
            "scenarios": "listings",
            "smooth": "estimation.after",
            "studies": "listings",
            "study": "",
        },
    )

    def __getattr__(name: str) -> Any:
        if name == "__version__":
            from importlib.metadata import version

            return version("sblcosim")
        return _get(name)

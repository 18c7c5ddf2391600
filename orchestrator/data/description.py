"""Metadata of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .. import artifacts
from ..shown import Shown


@dataclass(frozen=True, eq=False, repr=False)
class RunDescription(Shown):
    """Metadata of a run, in addition to its record.

    Attributes
    ----------
    scenario_name
        Name of the scenario.
    scenario
        The scenario as run, with all defaults: a pydantic model or plain data.
    receivers
        Names of the receivers, the main one first.
    fmus
        Identity of each component's FMU (its SHA-256), by component.
    seeds
        Seeds by component.
    origins
        Origin of each receiver: ``type``, ``fmu`` or ``python`` with a name, and further facts.
    remarks
        Remarks on the run, in sentences.
    asked
        The scenario before the receivers were chosen: `scenario` has only the keys of the first.
        None: it is the same.
    """

    scenario_name: str
    scenario: Any
    receivers: Sequence[str]
    fmus: Mapping[str, Any] = field(default_factory=dict)
    seeds: Mapping[str, int] = field(default_factory=dict)
    origins: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    remarks: Sequence[str] = ()
    asked: Any = None

    def _gist(self) -> str:
        return f"of {self.scenario_name}: {', '.join(self.receivers)}"

    def manifest(self) -> dict[str, Any]:
        """The part of the folder's manifest that describes the run; the same for equal runs."""
        scenario = self.scenario
        if hasattr(scenario, "model_dump"):
            scenario = scenario.model_dump(mode="json")
            for table in scenario.values():
                if isinstance(table, dict) and table.get("fmu"):
                    table["fmu"] = Path(table["fmu"]).name
        return {
            "scenario_name": self.scenario_name,
            "receivers": [
                {"label": name, **artifacts.plain(self.origins.get(name, {}))}
                for name in self.receivers
            ],
            "remarks": list(self.remarks),
            "seeds": artifacts.plain(self.seeds),
            "fmus": artifacts.plain(self.fmus),
            "scenario": artifacts.plain(scenario),
        }

"""What is known about a run beside its record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .. import artifacts


@dataclass(frozen=True, eq=False)
class RunDescription:
    """What is known about a run beside its record.

    Attributes
    ----------
    scenario_name
        What the run is called.
    scenario
        The scenario as it was run, with defaults: a pydantic model, or plain data.
    receivers
        Names of the receivers, the main one first.
    fmus
        What identifies each component's FMU (its SHA-256), by component.
    seeds
        Seeds by component.
    origins
        What each receiver was: ``type``, ``fmu`` or ``python`` with a name, and further facts.
    remarks
        What else there is to know about the run, in sentences.
    """

    scenario_name: str
    scenario: Any
    receivers: Sequence[str]
    fmus: Mapping[str, Any] = field(default_factory=dict)
    seeds: Mapping[str, int] = field(default_factory=dict)
    origins: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    remarks: Sequence[str] = ()

    def manifest(self) -> dict[str, Any]:
        """The run's part of the manifest of its folder; equal for equal runs."""
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

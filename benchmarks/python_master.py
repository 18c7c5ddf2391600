"""Time per step of the Python master, compared with the same loop written with FMPy's methods.

Both run target, platform, acoustics and ekf, with every component stepped every 0.1 s, all
connected inputs set and all outputs read and kept at each step. Initialisation is left out of both:
the master's figure is the difference between a long and a short run.

Run by hand: ``python benchmarks/python_master.py``
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

import fmpy
from alternating import alternated, ratio
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from sblcosim.fmus.build.factory import build
from sblcosim.models import COMPONENTS
from sblcosim.models.declaration import Type, Variable
from sblcosim.simulation.masters.python import execute
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import ComponentSpec, Connection, System

INTERVAL_NS = 100_000_000
STEPS = 4000
REPEATS = 9
NAMES = ("target", "platform", "acoustics", "ekf")
CONNECTIONS = (
    ("target.position", "acoustics.target_position"),
    ("target.velocity", "acoustics.target_velocity"),
    ("platform.beacon_position", "acoustics.beacon_position"),
    ("platform.reported_beacon_position", "acoustics.reported_beacon_position"),
    *((f"acoustics.{v.name}", f"ekf.{v.name}") for v in COMPONENTS["ekf"].of("input")
      if not v.name.startswith("depth")),
    ("target.depth", "ekf.depth"),
    ("target.depth_epoch", "ekf.depth_epoch"),
)  # fmt: skip


def master(fmi: int, steps: int) -> float:
    """Seconds that the master takes for a run."""
    system = System(
        components={name: ComponentSpec(build(name, fmi), INTERVAL_NS) for name in NAMES},
        connections=tuple(Connection(*pair) for pair in CONNECTIONS),
        stop_ns=steps * INTERVAL_NS,
    )
    plan = resolve(system)
    began = time.perf_counter()
    execute(plan)
    return time.perf_counter() - began


class Bare:
    """The same, as written by hand with FMPy; reads all outputs or only the wanted ones."""

    def __init__(self, fmi: int, folder: Path, wanted: Collection[str] | None = None) -> None:
        self.fmi = fmi
        self.descriptions = {
            name: fmpy.read_model_description(build(name, fmi), validate=False) for name in NAMES
        }
        self.fmus = {name: self._instance(name, folder / f"{name}{fmi}") for name in NAMES}
        self.gets, self.sets = [], []
        for name in NAMES:
            outputs = [
                v for v in COMPONENTS[name].of("output")
                if wanted is None or f"{name}.{v.name}" in wanted
            ]
            for kind in ("Float64", "Int32", "Boolean"):
                group = [v for v in outputs if v.type == kind]
                if group:
                    labels = [e for v in group for e in self._labels(name, v)]
                    get = self._method(self.fmus[name], "get", kind)
                    self.gets.append((get, self._references(name, group), labels))
        for name in NAMES:
            feeds = [(a, b) for a, b in CONNECTIONS if b.startswith(f"{name}.")]
            for kind in ("Float64", "Int32"):
                pairs = [(self._variable(a), self._variable(b), a) for a, b in feeds]
                pairs = [pair for pair in pairs if pair[0].type == kind]
                if pairs:
                    labels = [
                        e for a, _, path in pairs for e in self._labels(path.split(".")[0], a)
                    ]
                    set_ = self._method(self.fmus[name], "set", kind)
                    references = self._references(name, [b for _, b, _ in pairs])
                    self.sets.append((set_, references, labels))

    def _instance(self, name: str, folder: Path) -> Any:
        description = self.descriptions[name]
        slave = (FMU2Slave if self.fmi == 2 else FMU3Slave)(
            guid=description.guid,
            unzipDirectory=str(fmpy.extract(build(name, self.fmi), folder)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        slave.instantiate()
        return slave

    def start(self) -> None:
        """Bring all FMUs to step mode."""
        for slave in self.fmus.values():
            slave.reset()
            if self.fmi == 2:
                slave.setupExperiment(startTime=0.0)
            slave.enterInitializationMode()
            slave.exitInitializationMode()

    def _variable(self, path: str) -> Variable:
        component, name = path.split(".")
        return COMPONENTS[component][name]

    def _labels(self, component: str, variable: Variable) -> Iterator[str]:
        return (f"{component}.{element}" for element in variable.elements)

    def _references(self, component: str, variables: list[Variable]) -> list[int]:
        by_name = {v.name: v.valueReference for v in self.descriptions[component].modelVariables}
        if self.fmi == 3:
            return [by_name[v.name] for v in variables]
        return [by_name[e] for v in variables for e in v.elements]

    def _method(self, slave: Any, verb: str, kind: Type) -> Callable[..., Any]:
        names = {"Float64": "Real", "Int32": "Integer", "Boolean": "Boolean"}
        return getattr(slave, verb + (names[kind] if self.fmi == 2 else kind))

    def run(self, steps: int) -> float:
        """Seconds for all steps."""
        self.start()
        rows, values = [], {}
        fmi3 = self.fmi == 3
        began = time.perf_counter()
        for step in range(steps + 1):
            now = step * INTERVAL_NS / 1e9
            for get, references, labels in self.gets:
                got = get(references, len(labels)) if fmi3 else get(references)
                values.update(zip(labels, got, strict=True))
            rows.append(tuple(values.values()))
            if step < steps:
                for set_, references, labels in self.sets:
                    set_(references, [values[label] for label in labels])
                for slave in self.fmus.values():
                    slave.doStep(now, INTERVAL_NS / 1e9)
        return time.perf_counter() - began


def main() -> None:
    for fmi in (2, 3):
        master(fmi, STEPS)  # builds, loads and warms everything
        with tempfile.TemporaryDirectory() as folder:
            bare = Bare(fmi, Path(folder))
            ours, theirs = alternated(
                lambda fmi=fmi: (master(fmi, STEPS + 1) - master(fmi, 1)) / STEPS * 1e6,
                lambda bare=bare: bare.run(STEPS) / STEPS * 1e6,
                REPEATS,
            )
        for label, times in (("Python master", ours), ("bare FMPy calls", theirs)):
            print(
                f"FMI {fmi}  {label:16} min {min(times):6.1f} µs  "
                f"median {statistics.median(times):6.1f} µs per step"
            )
        print(f"FMI {fmi}  FMPy's calls/master: {ratio(ours, theirs)}")


if __name__ == "__main__":
    main()

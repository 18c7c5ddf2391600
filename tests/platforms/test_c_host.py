"""A master in plain C gives the record of ours, to the last bit, on every platform that runs here.

On this machine always; on Windows (wine) and ARM (qemu) by hand, with ``tests/platforms/run.sh``.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import sblcosim
from numpy.typing import NDArray
from sblcosim.fmus.build import c_files, compiler, factory
from sblcosim.fmus.host.instances import DTYPES
from sblcosim.fmus.platforms import folder, suffix, this_platform
from sblcosim.fmus.read.ports import Fmu
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.scenario.wiring import connect
from sblcosim.simulation import execution
from sblcosim.simulation.plans.plan import Plan, PlannedComponent
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import ComponentSpec, Connection, System

HOST = Path(__file__).with_name("host.c")
TYPES = ("Float64", "Int32", "Boolean")
LIBRARIES = "/usr/aarch64-linux-gnu"  # of Debian's libc6-arm64-cross


@dataclass(frozen=True)
class Machine:
    """What runs programs of a platform, and whether ours were built by zig for all platforms."""

    platform: str
    command: tuple[str, ...] = ()
    zig: bool = True


HERE = Machine(this_platform(), zig=False)
ELSEWHERE = (
    Machine("x86_64-linux"),
    Machine("aarch64-linux", ("qemu-aarch64", "-L", LIBRARIES)),
    Machine("x86_64-windows", ("wine64",)),
)


def whole(scenario: str, fmi: int, seconds: float | None, all_platforms: bool) -> Plan:
    """A scenario with every component there is."""
    overrides = {} if seconds is None else {"time.duration_s": seconds}
    system: System = connect(sblcosim.load(scenario, overrides), tuple(RECEIVERS), fmi=fmi)
    interval = system.components["platform"].interval_ns
    components = {**system.components, "range_model": ComponentSpec(Path(), interval)}
    components = {
        name: replace(spec, fmu=factory.build(name, fmi, all_platforms))  # type: ignore[arg-type]
        for name, spec in components.items()
    }
    connections = (
        *system.connections,
        Connection("target.position", "range_model.position"),
        Connection("platform.beacon_position", "range_model.beacon_position"),
    )
    return resolve(replace(system, components=components, connections=connections))


def bits(values: NDArray[np.generic]) -> str:
    return " ".join(f"{b:016x}" for b in np.ravel(values).astype(np.float64).view(np.uint64))


def job(plan: Plan, ending: str, prefix: str) -> Iterator[str]:
    """The plan as host.c reads it."""
    yield f"{plan.start_ns} {len(plan.instants)}"
    yield " ".join(map(str, plan.instants))
    yield " ".join(str(plan.sizes.get(kind, 0)) for kind in TYPES)
    yield str(len(plan.components))
    for c in plan.components:
        assert isinstance(c.source, Fmu)
        yield f"{c.source.fmi} {c.name} {c.source.token} {prefix}{c.name}{ending} {c.interval_ns}"
        yield str(len(c.settings))
        for s in c.settings:
            values = np.array(s.values, DTYPES[s.port.type])
            yield f"{_access(s.port.type, s.port.references, len(s.values))} {bits(values)}"
        yield str(len(c.reads))
        for r in c.reads:
            yield f"{_access(r.type, r.references, r.stop - r.start)} {r.start}"
        yield str(len(c.writes))
        for w in c.writes:
            sources = " ".join(map(str, w.sources))
            yield f"{_access(w.type, w.references, len(w.sources))} {sources}"
        yield _types(c) if c.source.fmi == 2 else "-"


def _access(kind: str, references: tuple[int, ...], size: int) -> str:
    return f"{TYPES.index(kind)} {len(references)} {' '.join(map(str, references))} {size}"


def _types(component: PlannedComponent) -> str:
    return "".join(v.type[0] * v.size for v in COMPONENTS[component.name])


def run(plan: Plan, machine: Machine, place: Path) -> tuple[NDArray[np.uint64], str]:
    """All outputs at all instants, by the host: (instants, values); and what it says."""
    ending = suffix(machine.platform)
    program = "host.exe" if ending == ".dll" else "host"
    cc = compiler.zig(machine.platform) if machine.zig else compiler.find()
    assert cc is not None
    sources = {"host.c": HOST.read_bytes(), **c_files.engine_headers()}
    for name, text in sources.items():
        (place / name).write_bytes(text)
    subprocess.run(
        [*cc.command, *compiler.FLAGS, f"-I{factory.fmi_headers()}", "host.c", "-o", program,
         *(["-ldl"] if "linux" in machine.platform else [])],
        cwd=place, check=True,
    )
    for c in plan.components:
        assert isinstance(c.source, Fmu)
        inside = f"binaries/{folder(machine.platform, c.source.fmi)}/{c.source.identifier}{ending}"
        with zipfile.ZipFile(c.source.path) as archive:
            (place / f"{c.name}{ending}").write_bytes(archive.read(inside))
    (place / "job").write_text("\n".join(job(plan, ending, "" if ending == ".dll" else "./")))
    done = subprocess.run(
        [*machine.command, str(place / program), "job"],
        cwd=place, capture_output=True, text=True, check=False,
        env={**os.environ, "WINEPREFIX": str(place.parent / "wine"), "WINEDEBUG": "-all"},
    )
    assert done.returncode == 0, done.stderr
    rows = np.array([int(word, 16) for word in done.stdout.split()], np.uint64)
    return rows.reshape(len(plan.instants), -1), done.stderr


def expected(plan: Plan) -> NDArray[np.uint64]:
    """The same from our own master."""
    record = execution.execute(plan)
    columns: Mapping[str, list[NDArray[np.float64]]] = {kind: [] for kind in TYPES}
    for c in sorted(plan.columns, key=lambda c: c.start):
        values = record.values[c.name].reshape(len(record), -1)
        columns[c.type].append(values.astype(np.float64))
    return np.hstack([block for kind in TYPES for block in columns[kind]]).view(np.uint64)


def assert_same(plan: Plan, machine: Machine, place: Path, lanes: int) -> None:
    found, said = run(plan, machine, place)
    wanted = expected(plan)
    assert np.unique(wanted, axis=0).shape[0] == len(wanted)  # something happens all the time
    np.testing.assert_array_equal(found, wanted)
    assert int(said.rpartition("widest:")[2]) >= lanes
    print(f"{machine.platform}: {found.size} values, {said.splitlines()[-1]}")


@pytest.mark.parametrize("fmi", [2, 3])
def test_plain_c_host_gives_our_record(fmi: int, tmp_path: Path) -> None:
    assert_same(whole("realistic-dive", fmi, 20.0, False), HERE, tmp_path, 2 if fmi == 2 else 0)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["paper-scenario-1", "harbour-random", "realistic-dive"])
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("machine", ELSEWHERE, ids=lambda m: m.platform)
def test_every_platform_gives_our_record(
    machine: Machine, fmi: int, scenario: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    if machine.command and shutil.which(machine.command[0]) is None:
        pytest.skip(f"needs {machine.command[0]}, see tests/platforms/run.sh")
    place = tmp_path_factory.mktemp("host")
    assert_same(whole(scenario, fmi, None, True), machine, place, 2 if fmi == 2 else 0)

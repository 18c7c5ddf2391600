"""Time per step of the native master, compared with the Python master, bare FMPy and libcosim.

All run target, platform, acoustics and ekf, with the same connections and every component stepped
every 0.1 s. The estimate is recorded (libcosim records nothing: it has no observers). The time is
that of the whole system for one step, including the work inside the FMUs. Starting is left out: the
masters' figures are the difference between a long and a short run. ``the loop alone`` is the native
master with functions that do nothing instead of the FMUs'.

Run by hand: ``python benchmarks/native_master.py``; libcosim takes part in FMI 2 if installed
(``pip install libcosimpy``).
"""

from __future__ import annotations

import ctypes
import statistics
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path

from alternating import ratio
from python_master import CONNECTIONS, INTERVAL_NS, NAMES, Bare
from sblcosim.fmus.build.factory import build, library
from sblcosim.fmus.host.nanoseconds import SECOND
from sblcosim.models import COMPONENTS
from sblcosim.simulation.execution import execute
from sblcosim.simulation.masters import native
from sblcosim.simulation.masters.python import chosen, initialised
from sblcosim.simulation.plans.plan import Plan
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import ComponentSpec, Connection, System

ESTIMATE = ("ekf.epoch", "ekf.update_count", "ekf.position")
REPEATS = 9
STEPS = {"native": 100_000, "libcosim": 10_000, "Python master": 4000, "bare FMPy calls": 4000}

NOTHING = b"""
#ifdef _WIN32
__declspec(dllexport)
#else
__attribute__((visibility("default")))
#endif
int nothing(void) { return 0; }
"""

Benchmark = Callable[[int], float]
"""Function from a number of steps to seconds."""


def plan(fmi: int, steps: int) -> Plan:
    """The four-FMU system."""
    system = System(
        components={name: ComponentSpec(build(name, fmi), INTERVAL_NS) for name in NAMES},
        connections=tuple(Connection(*pair) for pair in CONNECTIONS),
        stop_ns=steps * INTERVAL_NS,
    )
    return resolve(system)


def master(fmi: int, name: str) -> Benchmark:
    """One of our masters."""

    def seconds(steps: int) -> float:
        ready = plan(fmi, steps)
        began = time.perf_counter()
        execute(ready, record=ESTIMATE, master=name)
        return time.perf_counter() - began

    return lambda steps: seconds(steps + 1) - seconds(1)


def loop_alone(fmi: int) -> Benchmark:
    """The native master's loop, with the same calls of functions that do nothing."""
    nothing = ctypes.CDLL(str(library("nothing", {"nothing.c": NOTHING})))
    address = ctypes.cast(nothing.nothing, ctypes.c_void_p).value

    def seconds(steps: int) -> float:
        ready = plan(fmi, steps)
        with ExitStack() as stack:
            instances = [initialised(c, 0, stack) for c in ready.components]
            program = native._Program(ready, instances, chosen(ready, ESTIMATE))
            n = len(program.labels)
            for call in (native._Call * n).from_address(program.run.calls):
                call.function = address
            began = time.perf_counter()
            native.library().native_run(ctypes.byref(program.run))
            return time.perf_counter() - began

    return lambda steps: seconds(steps + 1) - seconds(1)


def libcosim(folder: Path) -> Benchmark:
    """The same FMI 2 FMUs in libcosim's fixed-step algorithm, all steps in one call."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level

    log_output_level(CosimLogLevel.WARNING)
    step = INTERVAL_NS / SECOND
    simulators = "".join(
        f'<Simulator name="{name}" source="{build(name)}" stepSize="{step}"/>' for name in NAMES
    )
    connections = "".join(
        "<VariableConnection>"
        + "".join(f'<Variable simulator="{c}" name="{e}"/>' for c, e in ends)
        + "</VariableConnection>"
        for source, target in CONNECTIONS
        for ends in zip(_elements(source), _elements(target), strict=True)
    )
    (folder / "OspSystemStructure.xml").write_text(
        '<OspSystemStructure version="0.1" '
        'xmlns="http://opensimulationplatform.com/MSMI/OSPSystemStructure">'
        f"<StartTime>0</StartTime><BaseStepSize>{step}</BaseStepSize><Algorithm>fixedStep"
        f"</Algorithm><Simulators>{simulators}</Simulators>"
        f"<Connections>{connections}</Connections></OspSystemStructure>"
    )

    def seconds(steps: int) -> float:
        execution = CosimExecution.from_osp_config_file(str(folder))
        execution.real_time_simulation_enabled(False)
        assert execution.step(1)  # initialises
        began = time.perf_counter()
        assert execution.step(steps)
        return time.perf_counter() - began

    return seconds


def _elements(end: str) -> list[tuple[str, str]]:
    component, variable = end.split(".")
    return [(component, element) for element in COMPONENTS[component][variable].elements]


def main() -> None:
    for fmi in (2, 3):
        with tempfile.TemporaryDirectory() as folder:
            wanted = {source for source, _ in CONNECTIONS} | set(ESTIMATE)
            rivals: dict[str, Benchmark] = {
                "native": master(fmi, "native"),
                "  the loop alone": loop_alone(fmi),
                "Python master": master(fmi, "python"),
                "bare FMPy calls": Bare(fmi, Path(folder), wanted).run,
            }
            if fmi == 2 and find_spec("libcosimpy"):
                rivals["libcosim"] = libcosim(Path(folder))
            times: dict[str, list[float]] = {name: [] for name in rivals}
            for _ in range(REPEATS):
                for name, benchmark in rivals.items():
                    steps = STEPS.get(name, STEPS["native"])
                    times[name].append(benchmark(steps) / steps * 1e6)
        for name, found in times.items():
            median = statistics.median(found)
            print(
                f"FMI {fmi}  {name:17} min {min(found):7.2f} µs  median {median:7.2f} µs per step"
                + (f"  times native {ratio(times['native'], found)}" if name != "native" else "")
            )
        if fmi == 2 and "libcosim" not in times:
            print("FMI 2  libcosim is not there: pip install libcosimpy")


if __name__ == "__main__":
    main()

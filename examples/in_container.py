"""Run the whole system as a single FMU, here in FMPy; any importer of FMI 2 can do this.

    pip install fmpy fmu-manipulation-toolbox
    sblcosim export fmu paper-scenario-1
    python examples/in_container.py paper-scenario-1.fmu

Prints the epoch of each estimate and the position: north, east, down.
"""

import sys
import zipfile

try:
    from fmpy import read_model_description, simulate_fmu
except ImportError:
    sys.exit("this example needs FMPy: pip install fmpy")


def estimates(fmu):
    """Return (epoch, north, east, down) of each estimate."""
    try:
        description = read_model_description(fmu)
    except (OSError, zipfile.BadZipFile, KeyError) as error:
        sys.exit(f"{fmu}: must be an FMU, got {error}")
    counts = [v.name for v in description.modelVariables if v.name.endswith(".update_count")]
    if not counts:
        sys.exit(f"{fmu}: must have a component with update_count, got none")
    receiver = counts[0].removesuffix(".update_count")
    names = [f"{receiver}.{x}" for x in ("epoch", "position[1]", "position[2]", "position[3]")]
    experiment = description.defaultExperiment
    rows = simulate_fmu(
        fmu,
        stop_time=float(experiment.stopTime),
        output_interval=float(experiment.stepSize),
        output=[counts[0], *names],
        logger=lambda *message: None,  # the container logs even if nothing is wrong
    )
    found, count = [], 0
    for row in rows:
        if row[counts[0]] != count:
            count = row[counts[0]]
            found.append(tuple(float(row[name]) for name in names))
    return found


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python examples/in_container.py SYSTEM.fmu")
    for estimate in estimates(sys.argv[1]):
        print(*estimate)

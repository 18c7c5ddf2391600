"""Run the whole system as a single FMU, here in FMPy; any importer of FMI 2 does.

    pip install fmpy fmu-manipulation-toolbox
    sblcosim export fmu paper-scenario-1
    python examples/in_container.py paper-scenario-1.fmu

Prints the epoch of each estimate and the position: north, east, down.
"""

import sys

try:
    from fmpy import read_model_description, simulate_fmu
except ImportError:
    sys.exit("this example needs FMPy: pip install fmpy")


def estimates(fmu):
    """Return (epoch, north, east, down) of each estimate."""
    experiment = read_model_description(fmu).defaultExperiment
    names = ("ekf.epoch", "ekf.position[1]", "ekf.position[2]", "ekf.position[3]")
    rows = simulate_fmu(
        fmu,
        stop_time=float(experiment.stopTime),
        output_interval=float(experiment.stepSize),
        output=["ekf.update_count", *names],
        logger=lambda *message: None,  # the container talks, even if nothing is wrong
    )
    found, count = [], 0
    for row in rows:
        if row["ekf.update_count"] != count:
            count = row["ekf.update_count"]
            found.append(tuple(float(row[name]) for name in names))
    return found


if __name__ == "__main__":
    for estimate in estimates(sys.argv[1]):
        print(*estimate)

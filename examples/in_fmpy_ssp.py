"""Run the system in FMPy as an SSP package, with FMPy's own master.

    pip install fmpy
    sblcosim export ssp paper-scenario-1 --bake
    python examples/in_fmpy_ssp.py paper-scenario-1.ssp

FMPy does not look at the package's parameter sets: it must be baked. Prints the epoch of each
estimate and the position: north, east, down.
"""

import sys
import zipfile
from xml.etree import ElementTree

try:
    from fmpy.ssp.simulation import simulate_ssp
except ImportError:
    sys.exit("this example needs FMPy: pip install fmpy")


def estimates(package):
    """Return (epoch, north, east, down) of each estimate."""
    with zipfile.ZipFile(package) as archive:
        structure = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
    stop = float(structure.find("{*}DefaultExperiment").get("stopTime"))
    step = float(structure.find(".//{*}FixedStepAlgorithm").get("baseStepSize"))
    rows = simulate_ssp(package, stop_time=stop, step_size=step)
    found, count = [], 0
    for row in rows:
        if row["ekf.update_count"] != count:
            count = row["ekf.update_count"]
            names = ("ekf.epoch", "ekf.position[1]", "ekf.position[2]", "ekf.position[3]")
            found.append(tuple(float(row[name]) for name in names))
    return found


if __name__ == "__main__":
    for estimate in estimates(sys.argv[1]):
        print(*estimate)

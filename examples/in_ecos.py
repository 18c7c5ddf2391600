"""Run the system in ecos.

    pip install ecospy
    apt-get install libtbb12        (Debian and Ubuntu: ecos needs it on Linux)
    sblcosim export ssp paper-scenario-1
    python examples/in_ecos.py paper-scenario-1.ssp

Prints the epoch of each estimate and the position: north, east, down.
"""

import sys
import zipfile
from xml.etree import ElementTree

try:
    from ecospy import EcosSimulation
except (ImportError, OSError) as error:
    sys.exit(f"this example needs ecos: pip install ecospy, apt-get install libtbb12 ({error})")


def estimates(package):
    """Return (epoch, north, east, down) of each estimate."""
    with zipfile.ZipFile(package) as archive:
        structure = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
    stop = float(structure.find("{*}DefaultExperiment").get("stopTime"))
    step = float(structure.find(".//{*}FixedStepAlgorithm").get("baseStepSize"))
    names = ("ekf::epoch", "ekf::position[1]", "ekf::position[2]", "ekf::position[3]")
    found, count = [], 0
    with EcosSimulation(step, ssp_path=str(package)) as simulation:
        simulation.init(parameter_set="scenario")  # the name of the package's parameter sets
        for _ in range(round(stop / step)):
            simulation.step()
            updates = simulation.get_integer("ekf::update_count")
            if updates != count:
                count = updates
                found.append(tuple(simulation.get_real(name) for name in names))
        simulation.terminate()
    return found


if __name__ == "__main__":
    for estimate in estimates(sys.argv[1]):
        print(*estimate)

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


def structure_of(package):
    """Return the XML that describes the package, and the name of its (first) receiver."""
    try:
        with zipfile.ZipFile(package) as archive:
            structure = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
    except (OSError, zipfile.BadZipFile, KeyError) as error:
        sys.exit(f"{package}: must be an SSP package, got {error}")
    receiver = structure.find(".//{*}Connector[@name='update_count']/../..")
    if receiver is None:
        sys.exit(f"{package}: must have a component with update_count, got none")
    return structure, receiver.get("name")


def estimates(package):
    """Return (epoch, north, east, down) of each estimate."""
    structure, receiver = structure_of(package)
    stop = float(structure.find("{*}DefaultExperiment").get("stopTime"))
    step = float(structure.find(".//{*}FixedStepAlgorithm").get("baseStepSize"))
    names = ("epoch", "position[1]", "position[2]", "position[3]")
    found, count = [], 0
    with EcosSimulation(step, ssp_path=str(package)) as simulation:
        simulation.init(parameter_set="scenario")  # the package's parameter sets, if any
        for _ in range(round(stop / step)):
            simulation.step()
            updates = simulation.get_integer(f"{receiver}::update_count")
            if updates != count:
                count = updates
                found.append(tuple(simulation.get_real(f"{receiver}::{name}") for name in names))
        simulation.terminate()
    return found


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python examples/in_ecos.py PACKAGE.ssp")
    for estimate in estimates(sys.argv[1]):
        print(*estimate)

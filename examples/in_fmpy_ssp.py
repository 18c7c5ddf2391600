"""Run the system in FMPy as an SSP package, with FMPy's own master.

    pip install fmpy
    sblcosim export ssp paper-scenario-1 --bake
    python examples/in_fmpy_ssp.py paper-scenario-1-baked.ssp

FMPy ignores the package's parameter sets, so it must be baked. Prints the epoch of each estimate
and the position: north, east, down.
"""

import sys
import zipfile
from xml.etree import ElementTree

try:
    from fmpy.ssp.simulation import simulate_ssp
except ImportError:
    sys.exit("this example needs FMPy: pip install fmpy")


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
    if structure.find(".//{*}ParameterBinding") is not None:
        sys.exit(f"{package}: FMPy ignores its parameter sets; export it with --bake")
    stop = float(structure.find("{*}DefaultExperiment").get("stopTime"))
    step = float(structure.find(".//{*}FixedStepAlgorithm").get("baseStepSize"))
    rows = simulate_ssp(package, stop_time=stop, step_size=step)
    names = ("epoch", "position[1]", "position[2]", "position[3]")
    found, count = [], 0
    for row in rows[: round(stop / step)]:  # FMPy may take one step past the stop time
        if row[f"{receiver}.update_count"] != count:
            count = row[f"{receiver}.update_count"]
            found.append(tuple(float(row[f"{receiver}.{name}"]) for name in names))
    return found


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python examples/in_fmpy_ssp.py PACKAGE.ssp")
    for estimate in estimates(sys.argv[1]):
        print(*estimate)

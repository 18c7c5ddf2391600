"""Run the system in OMSimulator.

    pip install OMSimulator
    sblcosim export ssp paper-scenario-1
    python examples/in_omsimulator.py paper-scenario-1.ssp

OMSimulator in Python ignores the step size in the package, so it is set here. Prints the epoch of
each estimate and the position: north, east, down.
"""

import os
import sys
import zipfile
from xml.etree import ElementTree

try:
    from OMSimulator import SSP, CRef
except (ImportError, OSError) as error:
    sys.exit(f"this example needs OMSimulator: pip install OMSimulator ({error})")


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
    system = structure.find("{*}System").get("name")
    stop = float(structure.find("{*}DefaultExperiment").get("stopTime"))
    step = float(structure.find(".//{*}FixedStepMaster").get("stepSize"))
    names = ("epoch", "position[1]", "position[2]", "position[3]")
    updates, *values = (CRef(system, receiver, name) for name in ("update_count", *names))
    model = SSP(str(package)).instantiate()
    model.setResultFile("")
    model.setFixedStepSize(step)
    model.initialize()
    found, count = [], 0
    for k in range(round(stop / step)):
        model.stepUntil((k + 0.5) * step)  # takes whole steps, so this is one
        if model.getValue(updates) != count:
            count = model.getValue(updates)
            found.append(tuple(model.getValue(value) for value in values))
    model.terminate()
    model.delete()
    return found


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python examples/in_omsimulator.py PACKAGE.ssp")
    with os.fdopen(os.dup(1), "w") as output:
        os.dup2(2, 1)  # otherwise OMSimulator's messages would mix with the estimates
        for estimate in estimates(sys.argv[1]):
            print(*estimate, file=output)

"""Run the system in FMPy, FMU by FMU, in your own loop.

    pip install fmpy
    sblcosim export ssp paper-scenario-1 --bake
    python examples/in_fmpy.py paper-scenario-1-baked.ssp

An SSP package is a ZIP archive that holds the FMUs and their connections. These FMUs are baked:
they start with the scenario's numbers, so there is nothing to set. Prints the epoch of each
estimate and the position: north, east, down.
"""

import shutil
import sys
import zipfile
from pathlib import Path
from tempfile import mkdtemp
from xml.etree import ElementTree

try:
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave
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


def estimates(package, gauss_seidel=False):
    """Return (epoch, north, east, down) of each estimate.

    With `gauss_seidel`, each FMU gets what the FMUs before it have just computed. This is a
    different kind of master, and it gives different numbers: see docs/howto/other-tools.md.
    """
    structure, receiver = structure_of(package)
    if structure.find(".//{*}ParameterBinding") is not None:
        sys.exit(f"{package}: FMPy ignores its parameter sets; export it with --bake")
    stop = float(structure.find("{*}DefaultExperiment").get("stopTime"))
    step = float(structure.find(".//{*}FixedStepAlgorithm").get("baseStepSize"))
    ends = ("startElement", "startConnector", "endElement", "endConnector")
    connections = [[c.get(end) for end in ends] for c in structure.findall(".//{*}Connection")]
    folder = Path(mkdtemp())
    with zipfile.ZipFile(package) as archive:
        archive.extractall(folder)
    fmus, variables = {}, {}
    for component in structure.findall(".//{*}Component"):
        name, file = component.get("name"), folder / component.get("source")
        description = read_model_description(file)
        fmu = fmus[name] = FMU2Slave(
            guid=description.guid,
            unzipDirectory=extract(file, folder / name),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        variables[name] = {v.name: v for v in description.modelVariables}
        fmu.instantiate()
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()

    def get(name, output):
        variable = variables[name][output]
        return getattr(fmus[name], f"get{variable.type}")([variable.valueReference])[0]

    def transfer(to=None):
        chosen = [c for c in connections if to in (None, c[2])]
        values = [get(source, output) for source, output, _, _ in chosen]
        for (_, _, target, input_), value in zip(chosen, values, strict=True):
            variable = variables[target][input_]
            getattr(fmus[target], f"set{variable.type}")([variable.valueReference], [value])

    found, count = [], 0
    for k in range(round(stop / step)):
        if not gauss_seidel:
            transfer()  # all inputs of this instant, before anything moves
        for name, fmu in fmus.items():
            if gauss_seidel:
                transfer(to=name)
            fmu.doStep(currentCommunicationPoint=k * step, communicationStepSize=step)
        if get(receiver, "update_count") != count:
            count = get(receiver, "update_count")
            names = ("epoch", "position[1]", "position[2]", "position[3]")
            found.append(tuple(get(receiver, name) for name in names))
    for fmu in fmus.values():
        fmu.terminate()
        fmu.freeInstance()
    shutil.rmtree(folder)
    return found


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python examples/in_fmpy.py PACKAGE.ssp")
    for estimate in estimates(sys.argv[1]):
        print(*estimate)

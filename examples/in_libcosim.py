"""Run the system in libcosim, the master of the Open Simulation Platform.

    pip install libcosimpy
    sblcosim export ssp paper-scenario-1
    python examples/in_libcosim.py paper-scenario-1.ssp

Prints the epoch of each estimate and the position: north, east, down.
"""

import sys
import zipfile
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

try:
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver
except (ImportError, OSError):
    sys.exit("this example needs libcosim: pip install libcosimpy")


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
    log_output_level(CosimLogLevel.WARNING)
    with TemporaryDirectory() as folder, zipfile.ZipFile(package) as archive:
        archive.extractall(folder)  # libcosim takes the package unpacked
        execution = CosimExecution.from_ssp_file(folder)
        observer = CosimObserver.create_last_value()
        execution.add_observer(observer)
        slave = execution.slave_index_from_instance_name(receiver)
        references = {v.name.decode(): v.reference for v in execution.slave_variables(slave)}
        names = ("epoch", "position[1]", "position[2]", "position[3]")
        found, count = [], 0
        for _ in range(round(stop / step)):
            execution.step()
            (updates,) = observer.last_integer_values(slave, [references["update_count"]])
            if updates != count:
                count = updates
                values = observer.last_real_values(slave, [references[name] for name in names])
                found.append(tuple(values))
        return found


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python examples/in_libcosim.py PACKAGE.ssp")
    for estimate in estimates(sys.argv[1]):
        print(*estimate)

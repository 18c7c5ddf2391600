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


def estimates(package):
    """Return (epoch, north, east, down) of each estimate."""
    log_output_level(CosimLogLevel.WARNING)
    with TemporaryDirectory() as folder, zipfile.ZipFile(package) as archive:
        archive.extractall(folder)  # libcosim takes the package unpacked
        structure = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
        stop = float(structure.find("{*}DefaultExperiment").get("stopTime"))
        step = float(structure.find(".//{*}FixedStepAlgorithm").get("baseStepSize"))

        execution = CosimExecution.from_ssp_file(folder)
        observer = CosimObserver.create_last_value()
        execution.add_observer(observer)
        ekf = execution.slave_index_from_instance_name("ekf")
        references = {v.name.decode(): v.reference for v in execution.slave_variables(ekf)}
        names = ("epoch", "position[1]", "position[2]", "position[3]")
        found, count = [], 0
        for _ in range(round(stop / step)):
            execution.step()
            (updates,) = observer.last_integer_values(ekf, [references["update_count"]])
            if updates != count:
                count = updates
                found.append(tuple(observer.last_real_values(ekf, [references[n] for n in names])))
        return found


if __name__ == "__main__":
    for estimate in estimates(sys.argv[1]):
        print(*estimate)

"""Run the system in FMPy, FMU by FMU, in a loop of one's own.

    pip install fmpy
    sblcosim export ssp paper-scenario-1 --bake
    python examples/in_fmpy.py paper-scenario-1.ssp

An SSP package is a ZIP archive with the FMUs in it; these are baked: they start with the scenario's
numbers, so there is nothing to set. Prints the epoch of each estimate and the position: north,
east, down.
"""

import shutil
import sys
import zipfile
from pathlib import Path
from tempfile import mkdtemp

try:
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave
except ImportError:
    sys.exit("this example needs FMPy: pip install fmpy")

# Outputs and the inputs of the same shape that they go to: name, number of elements.
CONNECTIONS = [
    ("target", "position", "acoustics", "target_position", (3,)),
    ("target", "velocity", "acoustics", "target_velocity", (3,)),
    ("platform", "beacon_position", "acoustics", "beacon_position", (4, 3)),
    ("platform", "reported_beacon_position", "acoustics", "reported_beacon_position", (4, 3)),
    ("acoustics", "range", "ekf", "range", (4,)),
    ("acoustics", "range_epoch", "ekf", "range_epoch", (4,)),
    ("acoustics", "reception_count", "ekf", "reception_count", (4,)),
    ("acoustics", "ping_beacon_position", "ekf", "ping_beacon_position", (4, 3)),
    ("acoustics", "packet_beacon_position", "ekf", "packet_beacon_position", (4, 3)),
    ("target", "depth", "ekf", "depth", ()),
    ("target", "depth_epoch", "ekf", "depth_epoch", ()),
]


def estimates(package, gauss_seidel=False):
    """Return (epoch, north, east, down) of each estimate.

    With `gauss_seidel`, each FMU gets what the FMUs before it have just computed. That is another
    kind of master, and it gives other numbers: see "Use the FMUs in another tool" in the README.
    """
    folder = Path(mkdtemp())
    with zipfile.ZipFile(package) as archive:
        archive.extractall(folder)
    fmus, references = {}, {}
    for name in ("target", "platform", "acoustics", "ekf"):
        file = folder / "resources" / f"{name}.fmu"
        description = read_model_description(file)
        fmu = fmus[name] = FMU2Slave(
            guid=description.guid,
            unzipDirectory=extract(file, folder / name),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        references[name] = {v.name: v.valueReference for v in description.modelVariables}
        fmu.instantiate()
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        stop, step = (getattr(description.defaultExperiment, k) for k in ("stopTime", "stepSize"))

    def values(name, variable, shape=()):
        get = fmus[name].getInteger if variable.endswith("count") else fmus[name].getReal
        return get([references[name][element] for element in elements(variable, shape)])

    def transfer(to=None):
        fresh = [(link, values(link[0], link[1], link[4])) for link in CONNECTIONS]
        for (_, variable, target, input_, shape), numbers in fresh:
            if to in (None, target):
                fmu = fmus[target]
                set_ = fmu.setInteger if variable.endswith("count") else fmu.setReal
                set_([references[target][element] for element in elements(input_, shape)], numbers)

    found, count = [], 0
    for k in range(round(float(stop) / float(step))):
        if not gauss_seidel:
            transfer()  # all inputs of this instant, before anything moves
        for name, fmu in fmus.items():
            if gauss_seidel:
                transfer(to=name)
            fmu.doStep(currentCommunicationPoint=k * float(step), communicationStepSize=float(step))
        if values("ekf", "update_count") != [count]:
            (count,) = values("ekf", "update_count")
            found.append((*values("ekf", "epoch"), *values("ekf", "position", (3,))))
    for fmu in fmus.values():
        fmu.terminate()
        fmu.freeInstance()
    shutil.rmtree(folder)
    return found


def elements(variable, shape):
    """Names of the elements of an array in FMI 2: x[1], x[2] or x[1,1], x[1,2]."""
    if len(shape) == 1:
        return [f"{variable}[{i + 1}]" for i in range(shape[0])]
    if len(shape) == 2:
        return [f"{variable}[{i + 1},{j + 1}]" for i in range(shape[0]) for j in range(shape[1])]
    return [variable]


if __name__ == "__main__":
    for estimate in estimates(sys.argv[1]):
        print(*estimate)

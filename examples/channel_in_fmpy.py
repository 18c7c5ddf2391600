"""Run the acoustic channel alone in FMPy, as an FMU for FMI 3 with a diver of one's own.

    pip install fmpy
    sblcosim build acoustics --fmi 3
    python examples/channel_in_fmpy.py fmus/fmi3/acoustics.fmu

Prints each range as it arrives: time of the ping, beacon, range, true range.
"""

import shutil
import sys

try:
    from fmpy import extract, read_model_description
    from fmpy.fmi3 import FMU3Slave
except ImportError:
    sys.exit("this example needs FMPy: pip install fmpy")

BEACONS = [3.0, 0.0, 1.5, 0.0, 3.0, 1.5, -3.0, 0.0, 1.5, 0.0, -3.0, 1.5]  # row by row: x, y, z
STEP = 0.1  # the sampling time of the channel [s]


def diver(t):
    """Position [m] and velocity [m/s] of the diver: north, east, down."""
    return [15.0 - 0.3 * t, 5.0, 8.0], [-0.3, 0.0, 0.0]


def ranges(file, stop=5.0):
    """Return (ping [s], beacon, range [m], true range [m]) of each reception."""
    description = read_model_description(file)
    numbers = {v.name: v.valueReference for v in description.modelVariables}
    folder = extract(file)
    fmu = FMU3Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="channel",
    )
    fmu.instantiate()
    fmu.setFloat64([numbers["sampling_time"]], [STEP])
    fmu.setFloat64([numbers["range_std"]], [0.1])
    fmu.setInt32([numbers["seed"]], [7])
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    found, heard = [], [0, 0, 0, 0]
    for k in range(round(stop / STEP)):
        position, velocity = diver(k * STEP)  # inputs are those of the step's start
        fmu.setFloat64([numbers["target_position"]], position)
        fmu.setFloat64([numbers["target_velocity"]], velocity)
        fmu.setFloat64([numbers["beacon_position"]], BEACONS)
        fmu.setFloat64([numbers["reported_beacon_position"]], BEACONS)
        fmu.doStep(currentCommunicationPoint=k * STEP, communicationStepSize=STEP)
        counts = fmu.getInt32([numbers["reception_count"]], nValues=4)
        names = ("range_epoch", "range", "true_range")
        epoch, measured, true = (fmu.getFloat64([numbers[name]], nValues=4) for name in names)
        new = [i for i in range(4) if counts[i] != heard[i]]
        found.extend((epoch[i], i + 1, measured[i], true[i]) for i in new)
        heard = counts
    fmu.terminate()
    fmu.freeInstance()
    shutil.rmtree(folder)
    return found


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python examples/channel_in_fmpy.py acoustics.fmu")
    for ping in ranges(sys.argv[1]):
        print("{:.1f} s  beacon {}  {:.2f} m  {:.2f} m".format(*ping))

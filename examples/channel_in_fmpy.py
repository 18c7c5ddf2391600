"""Run the acoustic channel alone in FMPy, with a diver of one's own, as an FMU for FMI 2 or 3.

    pip install fmpy
    sblcosim build acoustics
    python examples/channel_in_fmpy.py fmus/fmi3/acoustics.fmu

In FMI 3 an array is one variable, in FMI 2 it is a variable for each element, row by row.
Prints each range as it arrives: time of the ping, beacon, range, true range.
"""

import shutil
import sys

try:
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave
except ImportError:
    sys.exit("this example needs FMPy: pip install fmpy")

BEACONS = [3.0, 0.0, 1.5, 0.0, 3.0, 1.5, -3.0, 0.0, 1.5, 0.0, -3.0, 1.5]  # row by row: x, y, z
STEP = 0.1  # the sampling time of the channel [s]


def diver(t):
    """Position [m] and velocity [m/s] of the diver: north, east, down."""
    return [15.0 - 0.3 * t, 5.0, 8.0], [-0.3, 0.0, 0.0]


class Channel:
    """An instance of the FMU, whose variables are set and got by name."""

    def __init__(self, file):
        description = read_model_description(file)
        self.references = {}
        for variable in description.modelVariables:
            name = variable.name.partition("[")[0]  # FMI 2: beacon_position[2,3]
            self.references.setdefault(name, []).append(variable.valueReference)
        self.is_fmi2 = description.fmiVersion == "2.0"
        self.folder = extract(file)
        self.fmu = (FMU2Slave if self.is_fmi2 else FMU3Slave)(
            guid=description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="channel",
        )
        self.fmu.instantiate()

    def set(self, name, values, integer=False):
        """Set a variable, or all elements of an array."""
        names = ("setReal", "setInteger") if self.is_fmi2 else ("setFloat64", "setInt32")
        getattr(self.fmu, names[integer])(self.references[name], values)

    def get(self, name, integer=False):
        """Get the elements of an array with a number for each beacon."""
        if self.is_fmi2:
            return getattr(self.fmu, ("getReal", "getInteger")[integer])(self.references[name])
        get = getattr(self.fmu, ("getFloat64", "getInt32")[integer])
        return get(self.references[name], nValues=len(BEACONS) // 3)


def ranges(file, stop=5.0):
    """Return (ping [s], beacon, range [m], true range [m]) of each reception."""
    channel = Channel(file)
    fmu = channel.fmu
    if channel.is_fmi2:
        fmu.setupExperiment(startTime=0.0)
    channel.set("sampling_time", [STEP])
    channel.set("range_std", [0.1])
    channel.set("seed", [7], integer=True)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    found, heard = [], [0, 0, 0, 0]
    for k in range(round(stop / STEP)):
        position, velocity = diver(k * STEP)  # inputs are those of the step's start
        channel.set("target_position", position)
        channel.set("target_velocity", velocity)
        channel.set("beacon_position", BEACONS)
        channel.set("reported_beacon_position", BEACONS)
        fmu.doStep(currentCommunicationPoint=k * STEP, communicationStepSize=STEP)
        counts = channel.get("reception_count", integer=True)
        names = ("range_epoch", "range", "true_range")
        epoch, measured, true = (channel.get(name) for name in names)
        new = [i for i in range(4) if counts[i] != heard[i]]
        found.extend((epoch[i], i + 1, measured[i], true[i]) for i in new)
        heard = counts
    fmu.terminate()
    fmu.freeInstance()
    shutil.rmtree(channel.folder)
    return found


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python examples/channel_in_fmpy.py acoustics.fmu")
    for ping in ranges(sys.argv[1]):
        print("{:.1f} s  beacon {}  {:.2f} m  {:.2f} m".format(*ping))

"""Run the acoustic channel alone in OMSimulator, for a diver at rest.

    pip install OMSimulator
    sblcosim build acoustics --fmi 2
    python examples/channel_in_omsimulator.py fmus/fmi2/acoustics.fmu

OMSimulator takes no arrays, so the FMU is that for FMI 2, whose variables are single numbers.
Prints each range as it arrives: time of the ping, beacon, range, true range.
"""

import os
import sys

try:
    from OMSimulator import SSP, CRef
except (ImportError, OSError) as error:
    sys.exit(f"this example needs OMSimulator: pip install OMSimulator ({error})")

BEACONS = [[3.0, 0.0, 1.5], [0.0, 3.0, 1.5], [-3.0, 0.0, 1.5], [0.0, -3.0, 1.5]]
DIVER = [15.0, 5.0, 8.0]
STEP = 0.1  # the sampling time of the channel [s]


def ranges(file, stop=5.0):
    """Return (ping [s], beacon, range [m], true range [m]) of each reception."""

    def of(name):
        return CRef("default", "channel", name)

    package = SSP()
    package.addResource(str(file), new_name="resources/acoustics.fmu")
    package.addComponent(CRef("default", "channel"), "resources/acoustics.fmu")
    package.setValue(of("sampling_time"), STEP)
    package.setValue(of("range_std"), 0.1)
    for j, value in enumerate(DIVER, 1):
        package.setValue(of(f"target_position[{j}]"), value)
    for i, beacon in enumerate(BEACONS, 1):
        for j, value in enumerate(beacon, 1):
            package.setValue(of(f"beacon_position[{i},{j}]"), value)
            package.setValue(of(f"reported_beacon_position[{i},{j}]"), value)
    model = package.instantiate()
    model.setResultFile("")
    model.setFixedStepSize(STEP)
    model.initialize()
    found, heard = [], [0, 0, 0, 0]
    for k in range(round(stop / STEP)):
        model.stepUntil((k + 0.5) * STEP)  # takes whole steps, so this is one
        for i in range(4):
            count = model.getValue(of(f"reception_count[{i + 1}]"))
            if count != heard[i]:
                heard[i] = count
                names = ("range_epoch", "range", "true_range")
                epoch, *both = (model.getValue(of(f"{name}[{i + 1}]")) for name in names)
                found.append((epoch, i + 1, *both))
    model.terminate()
    model.delete()
    return found


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python examples/channel_in_omsimulator.py acoustics.fmu")
    with os.fdopen(os.dup(1), "w") as output:
        os.dup2(2, 1)  # OMSimulator's messages would stand among the ranges
        for ping in ranges(sys.argv[1]):
            print("{:.1f} s  beacon {}  {:.2f} m  {:.2f} m".format(*ping), file=output)

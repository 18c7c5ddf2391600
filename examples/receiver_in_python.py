"""A receiver in Python, as an FMU made with PythonFMU.

    pip install pythonfmu numpy
    pythonfmu build -f examples/receiver_in_python.py
    sblcosim check LinearFix.fmu
    sblcosim run paper-scenario-1 --receiver ekf --receiver LinearFix.fmu

The circles around four beacons, at the sensor's depth, differ by straight lines. Their
least-squares intersection is the position. The same as receiver_in_c.

An FMU of PythonFMU can only be loaded inside a Python process (FMPy, the masters of sblcosim).
Other programs on Linux cannot load it.
"""

import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real


class LinearFix(Fmi2Slave):
    """Horizontal position from the differences of four ranges, depth from the sensor."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        # Ports have the names listed by `sblcosim check`; arrays are scalars name[i] and name[i,j].
        self.values = {
            "range": np.zeros(4),
            "range_epoch": np.zeros(4),
            "reception_count": np.zeros(4, int),
            "ping_beacon_position": np.zeros((4, 3)),
            "depth": np.zeros(()),
            "epoch": np.zeros(()),
            "position": np.zeros(3),
            "update_count": np.zeros((), int),
        }
        self.seen = 0
        for name, array in self.values.items():
            output = name in ("epoch", "position", "update_count")
            for index in np.ndindex(array.shape):
                self.register_variable(
                    (Integer if array.dtype == int else Real)(
                        name + (f"[{','.join(str(i + 1) for i in index)}]" if index else ""),
                        causality=Fmi2Causality.output if output else Fmi2Causality.input,
                        variability=Fmi2Variability.discrete,
                        getter=lambda array=array, index=index: array[index],
                        setter=lambda value, array=array, index=index: array.__setitem__(
                            index, value
                        ),
                    )
                )

    def do_step(self, current_time, step_size):
        v = self.values
        if v["reception_count"].min() == 0 or v["reception_count"].sum() == self.seen:
            return True
        self.seen = v["reception_count"].sum()
        beacon = v["ping_beacon_position"]
        squared = v["range"] ** 2 - (v["depth"] - beacon[:, 2]) ** 2  # horizontal distances
        right = (beacon[:, :2] ** 2).sum(axis=1) - squared
        left = 2 * (beacon[:, :2] - beacon[:, :2].mean(axis=0))
        horizontal = np.linalg.lstsq(left, right - right.mean(), rcond=None)[0]
        v["position"][:] = [*horizontal, v["depth"]]
        v["epoch"][...] = v["range_epoch"].max()
        v["update_count"] += 1
        return True

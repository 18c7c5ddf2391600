"""A host for the FMUs: FMPy, with whole variables by name in place of value references."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from typing import Any

import numpy as np
from fmpy import extract, fmi2, fmi3, read_model_description
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray
from sblcosim.fmus.build import factory
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.declaration import Variable

Array = NDArray[np.float64]
Values = Mapping[str, Any]
"""Values by variable name; anything `numpy.broadcast_to` takes to the variable's shape."""

T = 0.1
"""Time between ticks in all tests, in s."""
TICKS = 100
"""Length of `chain`."""

DISCARD, ERROR = 2, 3

_C_TYPES: Mapping[str, Any] = {"Float64": ctypes.c_double, "Int32": ctypes.c_int32}
_NAMES = {
    2: {"Float64": "fmi2{}Real", "Int32": "fmi2{}Integer", "Boolean": "fmi2{}Boolean"},
    3: {"Float64": "fmi3{}Float64", "Int32": "fmi3{}Int32", "Boolean": "fmi3{}Boolean"},
}
_unpacked = TemporaryDirectory(prefix="sblcosim-test-")


class _Access:
    """Prepared calls that get or set some variables, one per type."""

    def __init__(self, host: Host, verb: str, variables: Sequence[Variable]) -> None:
        self.variables = variables
        self.place = {}
        stop = 0
        for v in variables:
            self.place[v.name] = slice(stop, stop + v.size)
            stop += v.size
        self.size = stop
        self.parts = []
        for kind in ("Float64", "Int32", "Boolean"):
            chosen = [v for v in variables if v.type == kind]
            if not chosen:
                continue
            references = [r for v in chosen for r in host.references(v)]
            where = np.concatenate([np.arange(stop)[self.place[v.name]] for v in chosen])
            boolean: Any = ctypes.c_bool if host.fmi == 3 else ctypes.c_int32
            buffer = (_C_TYPES.get(kind, boolean) * len(where))()
            call = getattr(host.slave, _NAMES[host.fmi][kind].format(verb))
            arguments = (
                (ctypes.c_uint * len(references))(*references), len(references), buffer,
                *((len(where),) if host.fmi == 3 else ()),
            )
            self.parts.append((call, arguments, where, np.frombuffer(buffer, buffer._type_)))


class Host:
    """One instance of an FMU.

    Parameters
    ----------
    name
        Key of `sblcosim.models.COMPONENTS`.
    fmi
        Version of the standard.
    path
        The FMU; by default the one of the cache.
    """

    def __init__(self, name: str, fmi: int, path: Path | None = None, label: str = "") -> None:
        self.component, self.fmi = COMPONENTS[name], fmi
        self.messages: list[str] = []
        self.name = f"{name}{label}"
        path = path or factory.build(name, fmi)  # type: ignore[arg-type]
        description, folder = _unpack(path)
        self._references = {v.name: v.valueReference for v in description.modelVariables}
        kind = fmi2.FMU2Slave if fmi == 2 else fmi3.FMU3Slave
        self.slave = kind(
            guid=description.guid, unzipDirectory=folder, instanceName=self.name,
            modelIdentifier=description.coSimulation.modelIdentifier,
        )
        if fmi == 2:
            self._callbacks = fmi2.fmi2CallbackFunctions()
            self._callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._log2)
            self.slave.instantiate(callbacks=self._callbacks)
        else:
            self.slave.instantiate(logMessage=self._log3)
        self._accesses: dict[tuple[str, tuple[str, ...]], _Access] = {}
        self.output_names = tuple(v.name for v in self.component.of("output"))
        self.input_names = tuple(v.name for v in self.component.of("input"))
        self.outputs_at = self._access("Get", self.output_names).place

    def _log2(self, _: Any, instance: bytes, status: int, category: bytes, text: bytes) -> None:
        self.messages.append(text.decode())

    def _log3(self, _: Any, status: int, category: bytes, text: bytes) -> None:
        self.messages.append(text.decode())

    def references(self, variable: Variable) -> list[int]:
        """Value references of a variable: one, or in FMI 2 one per element."""
        names = variable.elements if self.fmi == 2 else (variable.name,)
        return [self._references[name] for name in names]

    def _access(self, verb: str, names: tuple[str, ...]) -> _Access:
        access = self._accesses.get((verb, names))
        if access is None:
            access = _Access(self, verb, [self.component[name] for name in names])
            self._accesses[verb, names] = access
        return access

    def start(self, parameters: Values = {}, start: float = 0.0, inputs: Array | None = None  # noqa: B006
              ) -> Host:
        """Reset, set, initialise."""
        self.slave.reset()
        self.set(parameters)
        if self.fmi == 2:
            self.slave.setupExperiment(startTime=start)
            self.slave.enterInitializationMode()
        else:
            self.slave.enterInitializationMode(startTime=start)
        if inputs is not None:
            self.set_inputs(inputs)
        self.slave.exitInitializationMode()
        return self

    def set(self, values: Values) -> None:
        access = self._access("Set", tuple(values))
        self._write(access, np.concatenate(
            [np.ravel(_shaped(self.component[name], value)) for name, value in values.items()]
            or [np.zeros(0)]
        ))

    def set_inputs(self, values: Array) -> None:
        """Set all inputs; `values` holds them one after another, in the order of declaration."""
        self._write(self._access("Set", self.input_names), values)

    def _write(self, access: _Access, values: Array) -> None:
        assert len(values) == access.size
        for call, arguments, where, view in access.parts:
            view[:] = values[where]
            call(self.slave.component, *arguments)

    def outputs(self) -> Array:
        """All outputs, one after another."""
        return self._read(self._access("Get", self.output_names))

    def get(self, name: str) -> Array:
        return self._read(self._access("Get", (name,))).reshape(self.component[name].shape)

    def _read(self, access: _Access) -> Array:
        result = np.empty(access.size)
        for call, arguments, where, view in access.parts:
            call(self.slave.component, *arguments)
            result[where] = view
        return result

    def step(self, time: float, size: float) -> None:
        self.slave.doStep(time, size)

    def run(self, times: Sequence[float], inputs: Array | None = None) -> Array:
        """Step through `times` and return the outputs at all of them but the first.

        Parameters
        ----------
        inputs : (len(times) - 1, number of inputs)
            What is set before each step.
        """
        rows = []
        for i, (time, end) in enumerate(pairwise(times)):
            if inputs is not None:
                self.set_inputs(inputs[i])
            self.step(time, end - time)
            rows.append(self.outputs())
        return np.array(rows)

    def column(self, record: Array, name: str) -> Array:
        """One output of a record: (rows, *shape)."""
        return record[:, self.outputs_at[name]].reshape(len(record), *self.component[name].shape)

    def save(self) -> bytes:
        """The state, serialised."""
        state = self.slave.getFMUState()
        try:
            return bytes(self.slave.serializeFMUState(state))
        finally:
            self.slave.freeFMUState(state)

    def restore(self, saved: bytes) -> None:
        state = self.slave.deserializeFMUState(saved)
        try:
            self.slave.setFMUState(state)
        finally:
            self.slave.freeFMUState(state)


@cache
def _unpack(path: Path) -> tuple[Any, str]:
    # Never into a folder twice: what is loaded must not be written to.
    folder = mkdtemp(prefix=f"{path.stem}-", dir=_unpacked.name)
    extract(str(path), folder)
    return read_model_description(str(path)), folder


def _shaped(variable: Variable, value: Any) -> Array:
    array = np.asarray(value, float)
    shape = variable.shape if array.size in (1, variable.size) else ()
    return array.reshape(shape) if array.size > 1 else np.broadcast_to(array, shape)


@cache
def host(name: str, fmi: int = 2, number: int = 0) -> Host:
    """An instance for everybody: instances are few, because FMPy does not live through many."""
    return Host(name, fmi, label=f"_{number}" if number else "")


def grid(steps: int, size: float = T, start: float = 0.0) -> list[float]:
    """Communication points, each computed on its own."""
    return [start + i * size for i in range(steps + 1)]


NOISY: Mapping[str, Values] = {
    "target": {"trajectory": 6, "speed": 1.0, "leg_length": 1.5, "depth_end": 9.0, "seed": 11,
               "depth_bias": 0.02},
    "platform": {
        "seed": 12, "mean_heading": 0.3, "arm_length": 3.0,
        **{f"{axis}_amplitude": 0.1 for axis in ("roll", "pitch", "yaw", "heave", "surge")},
        "gps_horizontal_std": 0.2, "gps_vertical_std": 0.3, "gps_horizontal_bias_std": 0.5,
        "gps_horizontal_markov_std": 0.4, "imu_tilt_std": 0.002, "imu_heading_markov_std": 0.01,
        "imu_heading_drift": 1e-4, "imu_correlation_time": 2.0,
    },
    "acoustics": {"seed": 13, "loss_probability": 0.2, "outlier_probability": 0.05,
                  "clock_drift": 1e-6},
    "ekf": {"acceleration_psd": 0.1},
    "sequential": {"acceleration_psd": 0.1},
    "coupled": {"acceleration_psd": 0.1},
    "fixed_lag": {"acceleration_psd": 0.1, "lag": 0.4},
    "long_baseline": {"acceleration_psd": 0.1, "beacon_error_std": 0.3},
    "array": {"acceleration_psd": 0.1},
    "multilateration": {},
    "range_model": {},
}
"""Parameters of a run in which everything moves and is noisy."""


@cache
def chain() -> Mapping[str, Array | None]:
    """Inputs of every component at each tick of such a run of the whole system.

    Row `i` is what the component sees while it steps from ``i T`` to ``(i + 1) T``.
    """
    ports: dict[str, Array] = {}
    inputs: dict[str, Array | None] = {}
    for name in ("target", "platform", "acoustics", *RECEIVERS, "range_model"):
        instance = host(name)
        declared = instance.component.of("input")
        inputs[name] = np.concatenate(
            [ports[v.name].reshape(TICKS, -1) for v in declared], axis=1
        ) if declared else None
        instance.start(NOISY[name])
        record = np.concatenate(
            [[instance.outputs()], instance.run(grid(TICKS), inputs[name])]
        )[:-1]
        for v in instance.component.of("output"):
            ports.setdefault(v.name, instance.column(record, v.name))
            if name == "target":
                ports[f"target_{v.name}"] = instance.column(record, v.name)
    return inputs


def bits(values: Array) -> NDArray[np.int64]:
    """The values as they lie in memory: equal means equal to the last bit."""
    return np.ascontiguousarray(values, np.float64).view(np.int64)


def assert_same_bits(actual: Array, expected: Array) -> None:
    np.testing.assert_array_equal(bits(actual), bits(expected))


def refused(call: Any, *arguments: Any) -> int:
    """The status with which a call is refused."""
    try:
        call(*arguments)
    except FMICallException as error:
        return int(error.status)
    raise AssertionError(f"{call} was not refused")

"""Receivers in a few lines of Python: new samples in, an estimate out.

A receiver is a class with a method `Receiver.update`::

    class LastBeacon(sblcosim.Receiver):
        def update(self, samples):
            heard = [s for s in samples if isinstance(s, sblcosim.Range)]
            return sblcosim.Estimate(heard[-1].epoch, heard[-1].beacon_position) if heard else None

`Receiver` turns it into a `sblcosim.simulation.system.PythonComponent` with the ports of the plug
contract (`sblcosim.models.ports`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus.host.nanoseconds import SECOND, nanoseconds
from sblcosim.models import RECEIVERS
from sblcosim.models.declaration import Variable, noise_keys, parameter
from sblcosim.models.ports import (
    BEACONS,
    DEPTH,
    ESTIMATE,
    PING_POSE,
    RECEPTION,
    REQUIRED_ESTIMATE,
    SYSTEM,
    ports,
)

from ..errors import ConfigurationError, instance, nearest, quoted
from ..shown import Shown
from .code.user_code import InFile, PythonSource
from .system import PythonComponent

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Range:
    """A range to a beacon.

    Attributes
    ----------
    epoch
        Time of the ping [s].
    beacon
        Index of the beacon, from 0.
    range
        Range [m].
    beacon_position
        Position of the beacon in the packet that gave the range: NED [m], shape (3,).
    platform_position, platform_attitude
        Position of the platform in that packet, NED [m], and its roll, pitch and yaw [rad]; shape
        (3,). Zeros if the packets do not hold them.
    arrival_epoch
        Time at which the packet arrived [s].
    """

    epoch: float
    beacon: int
    range: float
    beacon_position: Floats
    platform_position: Floats
    platform_attitude: Floats
    arrival_epoch: float


@dataclass(frozen=True, slots=True)
class Depth:
    """A reading of the depth sensor [m], at its epoch [s]."""

    epoch: float
    depth: float


Sample = Range | Depth

_RANGE_PORTS = {
    "range_epoch": "epoch", "range": "range", "ping_beacon_position": "beacon_position",
    "ping_platform_position": "platform_position", "ping_platform_attitude": "platform_attitude",
    "arrival_epoch": "arrival_epoch",
}  # fmt: skip
"""Input ports with one element or row per beacon, and their fields in `Range`."""
_INPUTS = {*_RANGE_PORTS, "reception_count", *(v.name for v in DEPTH)}
_OUTPUTS = (*ESTIMATE, *SYSTEM)
_OPTIONAL = {v.name: v for v in _OUTPUTS if v.name not in (*REQUIRED_ESTIMATE, "valid")}
_POSITIONS = np.ix_((0, 2, 4), (0, 2, 4))
_KNOWN = {
    v.name: v for named in (False, True) for receiver in RECEIVERS.values()
    for v in receiver.of("parameter") if bool(v.named) is named
}
_GIVEN = {
    **{name: _KNOWN[name] for name in ("update_interval", "range_std", "depth_std")},
    "seed": noise_keys()[0],
}
"""Parameters that every receiver gets."""


class Estimate(Shown):
    """An estimate of the diver's state.

    Parameters
    ----------
    epoch
        Time to which it belongs [s]: that of the newest sample used.
    position
        NED [m].
    outputs
        Outputs listed in `Receiver.outputs`: ``velocity`` [m/s]; ``covariance``, 3×3 of the
        position or 6×6 of (x, vx, y, vy, z, vz), SI; and other ports of ``ESTIMATE`` and ``SYSTEM``
        in `sblcosim.models.ports`.
    """

    def __init__(self, epoch: float, position: Any, **outputs: Any) -> None:
        self.values = {"epoch": epoch, "position": position, **outputs}

    def _gist(self) -> str:
        return f"at {self.values['epoch']} s: {', '.join(self.values)}"


class Receiver:
    """Base class of receivers.

    All parameters are attributes of the object: ``update_interval`` [s], ``range_std`` [m] and
    ``depth_std`` [m] from the scenario; ``seed``, the run's seed, for anything random; and the
    class's own `parameters`.

    Attributes
    ----------
    parameters
        The class's own parameters and their start values: numbers, switches, or arrays of numbers.
        The scenario sets them with ``[receiver] parameters = {…}``. A name that one of our
        receivers has, such as ``acceleration_psd``, is set with that receiver's key. A number that
        may be given by a name there, such as ``"learned"``, must begin with the value of the name
        (−1) in a class that takes it. Otherwise the class keeps its start value.
    outputs
        Outputs of an estimate besides position and epoch, for example ``("velocity",
        "covariance")``.
    beacons
        Number of beacons, set by the scenario.
    """

    parameters: ClassVar[Mapping[str, Any]] = {}
    outputs: ClassVar[Sequence[str]] = ()
    beacons: int = int(BEACONS)

    update_interval: float
    range_std: float
    depth_std: float
    seed: int

    def start(self) -> None:
        """Prepare the run. The parameters are set."""

    def update(self, samples: Sequence[Sample]) -> Estimate | None:
        """Use new samples; called at the update interval if there are any.

        Parameters
        ----------
        samples
            Oldest first; at equal epochs the depth first. Each sample appears once.

        Returns
        -------
        estimate
            None: no new estimate.
        """
        raise ConfigurationError(f"{type(self).__name__}: must have a method update, got none")

    def fix(self, samples: Iterable[Sample]) -> Floats | None:
        """Least-squares position, as a starting point.

        Parameters
        ----------
        samples
            The newest range to each beacon and the newest depth count, from these and earlier
            calls.

        Returns
        -------
        position
            NED [m]; None with fewer than three beacons or without a depth.
        """
        from scipy.optimize import least_squares  # takes 0.3 s, so only if a fix is requested

        newest = self._plug.newest
        newest |= {s.beacon if isinstance(s, Range) else -1: s for s in samples}
        ranges = [s for _, s in sorted(newest.items()) if isinstance(s, Range)]
        depth = newest.get(-1)
        if not isinstance(depth, Depth) or len(ranges) < 3:
            return None
        beacons = np.array([r.beacon_position for r in ranges])
        lengths = np.array([r.range for r in ranges])

        def residuals(x: Floats) -> Floats:
            return np.append(np.linalg.norm(x - beacons, axis=1) - lengths, x[2] - depth.depth)

        first = np.append(beacons[lengths.argmin(), :2], depth.depth)
        solved: Floats = least_squares(residuals, first).x
        return solved

    # --- The component it becomes
    # ---------------------------------------------------------------------

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Parameters, inputs and outputs."""
        self._check_attributes()
        given = {"valid", *REQUIRED_ESTIMATE, *self.outputs}
        if "covariance" in given:
            given.add("position_std")
        return (
            *_GIVEN.values(),
            *self._own(),
            *(
                replace(v, shape=(self.beacons, *v.shape[1:])) if v.rows else v
                for v in ports((*RECEPTION, *PING_POSE, *DEPTH), "input")
                if v.name in _INPUTS
            ),
            *(v for v in _OUTPUTS if v.name in given),
        )

    def initialise(
        self, start_ns: int, parameters: Mapping[str, NDArray[Any]]
    ) -> Mapping[str, Any]:
        for name, value in parameters.items():
            setattr(self, name, value.copy() if value.shape else value.item())
        outputs = [v for v in self.variables if v.causality == "output"]
        self._plug = _Plug(start_ns, nanoseconds(self.update_interval), outputs)
        self.start()
        return self._plug.outputs

    def do_step(
        self, time_ns: int, step_ns: int, inputs: Mapping[str, NDArray[Any]]
    ) -> Mapping[str, Any]:
        plug = self._plug
        samples = plug.new(inputs) if plug.ticks(time_ns) else []
        estimate = self.update(samples) if samples else None
        if estimate is not None:
            count = plug.outputs["update_count"] + 1
            plug.outputs = {**self._filled(estimate), "valid": True, "update_count": count}
        return plug.outputs

    def _check_attributes(self) -> None:
        """Refuse attributes of the class of a wrong type.

        Raises
        ------
        ConfigurationError
            It names the attribute.
        """
        where, outputs = type(self).__name__, self.outputs
        for method in ("start", "update", "fix"):
            if not callable(getattr(self, method)):
                raise ConfigurationError(
                    f"{where}: {method} must be a method, got {instance(getattr(self, method))}"
                )
        if isinstance(outputs, str) or not isinstance(outputs, Collection):
            example = (outputs,) if isinstance(outputs, str) else ("covariance",)
            raise ConfigurationError(
                f"{where}: outputs must be a tuple, as {example!r}, got {instance(outputs)}"
            )
        for name in outputs:
            if not isinstance(name, str) or name not in _OPTIONAL:
                raise ConfigurationError(
                    f"{where}: outputs must be some of {', '.join(_OPTIONAL)}, got "
                    f"{instance(name)}{nearest(str(name), _OPTIONAL)}"
                )
        if not isinstance(self.beacons, int):
            raise ConfigurationError(
                f"{where}: beacons must be a whole number, got {instance(self.beacons)}"
            )

    def _own(self) -> Iterator[Variable]:
        """The class's own parameters as variables."""
        where = f"{type(self).__name__}: parameters"
        if not isinstance(self.parameters, Mapping):
            raise ConfigurationError(
                f"{where} must be names with start values, got {instance(self.parameters)}"
            )
        for name, start in self.parameters.items():
            if not str(name).isidentifier() or name in _GIVEN or hasattr(type(self), name):
                raise ConfigurationError(
                    f"{where} must have names of their own, got {quoted(name)}"
                )
            try:
                values = np.asarray(start)
            except (TypeError, ValueError):  # a list whose rows differ in length
                values = np.asarray(None)
            kind = {"b": "Boolean", "i": "Int32", "f": "Float64"}.get(values.dtype.kind)
            if kind is None or values.ndim > 2:
                raise ConfigurationError(
                    f"{where} must be numbers or arrays of numbers, got {instance(start)} as {name}"
                )
            if values.shape:
                kind, values = "Float64", values.astype(float)
            starts = tuple(values.ravel().tolist()) if values.shape else values.item()
            if name in _KNOWN:
                known = _KNOWN[name]
                learns = starts in (known.named or {}).values()
                yield replace(known if learns else known.unnamed, start=starts)
            else:
                yield parameter(name, name, shape=values.shape, start=starts, type=kind)

    def _filled(self, estimate: Any) -> dict[str, Any]:
        """The outputs for an estimate."""
        if not isinstance(estimate, Estimate):
            raise ConfigurationError(
                f"{type(self).__name__}.update: must return an Estimate or None, got "
                f"{instance(estimate)}"
            )
        where = f"{type(self).__name__}.update: the estimate must have"
        filled = {}
        wanted = ("epoch", "position", *self.outputs)
        if estimate.values.keys() != set(wanted):
            raise ConfigurationError(
                f"{where} {', '.join(wanted)}, as listed in the class's outputs, got "
                f"{', '.join(estimate.values)}"
            )
        for variable in _OUTPUTS:
            if variable.name in wanted:
                value = np.asarray(estimate.values[variable.name])
                if variable.name == "covariance" and value.shape == (3, 3):
                    value = _of_position(value)
                if value.shape != variable.shape or value.dtype.kind not in "biuf":
                    size = "×".join(map(str, variable.shape)) or "one number"
                    size = "3×3 or 6×6" if variable.name == "covariance" else size
                    article = "an" if variable.name[0] in "aeiou" else "a"
                    raise ConfigurationError(
                        f"{where} {article} {variable.name} of {size}, got {value.dtype} of shape "
                        f"{value.shape}"
                    )
                if not np.isfinite(value).all():
                    raise ConfigurationError(
                        f"{where} a finite {variable.name}, got {value.tolist()}"
                    )
                filled[variable.name] = value
        if "covariance" in filled:
            variances = np.diag(filled["covariance"])[[0, 2, 4]]
            filled["position_std"] = np.sqrt(np.maximum(variances, 0.0))
        return filled


def _of_position(covariance: Floats) -> Floats:
    """Covariance of the whole state, with zeros for the velocity."""
    whole = np.zeros((6, 6))
    whole[_POSITIONS] = covariance
    return whole


class _ForBeacons:
    """Makes a receiver from a class for a number of beacons."""

    def __init__(self, maker: Callable[[], Any], beacons: int) -> None:
        self._maker = maker
        self.beacons = beacons
        self.file = maker if isinstance(maker, InFile) else None
        self.__name__ = getattr(maker, "__name__", "receiver")
        self.__qualname__ = getattr(maker, "__qualname__", self.__name__)

    def __call__(self) -> Receiver:
        made: Receiver = self._maker()
        made.beacons = self.beacons
        return made


def for_beacons(
    source: Callable[[], PythonComponent], beacons: int
) -> Callable[[], PythonComponent]:
    """A receiver's class for a number of beacons; one that declares its ports is unchanged.
    """
    maker = source.maker if isinstance(source, PythonSource) else source
    derived = isinstance(maker, type) and issubclass(maker, Receiver)
    if isinstance(maker, InFile):
        derived = maker.is_receiver
    if beacons == BEACONS or not derived:
        return source
    sized = _ForBeacons(maker, beacons)
    if isinstance(source, PythonSource):
        return PythonSource(sized, source.origin, source.sha256)
    return sized


class _Plug:
    """What a receiver has seen on its inputs, and its outputs so far."""

    def __init__(self, start_ns: int, tick_ns: int, outputs: Iterable[Variable]) -> None:
        self._start_ns, self._tick_ns = start_ns, tick_ns
        self._counts: Any = 0
        self._depth_epoch = start_ns / SECOND
        self.newest: dict[int, Sample] = {}
        self.outputs: dict[str, Any] = {v.name: np.zeros(v.shape) for v in outputs}
        self.outputs |= {v.name: 0 for v in outputs if v.type == "Int32"} | {"valid": False}

    def ticks(self, time_ns: int) -> bool:
        """Whether a step that begins now contains an update; there is none at the start."""
        passed = time_ns - self._start_ns
        return passed > 0 and passed % self._tick_ns == 0

    def new(self, inputs: Mapping[str, NDArray[Any]]) -> list[Sample]:
        """The samples since the last call, in order."""
        samples: list[tuple[float, int, Sample]] = []
        epoch = float(inputs["depth_epoch"])
        if epoch != self._depth_epoch:
            self._depth_epoch = epoch
            samples.append((epoch, -1, Depth(epoch, float(inputs["depth"]))))
        counts = inputs["reception_count"].copy()
        for beacon in np.flatnonzero(counts != self._counts).tolist():
            fields = {field: _element(inputs[port][beacon]) for port, field in _RANGE_PORTS.items()}
            samples.append((fields["epoch"], beacon, Range(beacon=beacon, **fields)))
        self._counts = counts
        return [sample for _, _, sample in sorted(samples, key=lambda s: s[:2])]


def _element(value: Any) -> Any:
    """A number, or a row unchanged."""
    return value.copy() if value.shape else value.item()

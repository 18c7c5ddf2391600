"""Small Python components for tests of the orchestrator."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sblcosim.models.declaration import Variable, input_, output, parameter


class Clock:
    """Puts out the number of its steps and the time in ns; takes no inputs."""

    variables = (
        output("count", "Number of steps", type="Int32"),
        output("now", "Time", "s"),
        output("odd", "Whether that number is odd", type="Boolean"),
    )

    def initialise(self, start_ns: int, parameters: Mapping[str, Any]) -> dict[str, Any]:
        self.count = 0
        return {"count": 0, "now": start_ns / 1e9, "odd": False}

    def do_step(self, time_ns: int, step_ns: int, inputs: Mapping[str, Any]) -> dict[str, Any]:
        self.count += 1
        return {
            "count": self.count,
            "now": (time_ns + step_ns) / 1e9,
            "odd": self.count % 2 == 1,
        }


class Relay:
    """Puts out at the end of a step what was on its input during the step."""

    variables = (
        parameter("first", "Output at the start", type="Int32", start=-1),
        Variable("count", "", "input", type="Int32", start=-7),
        output("relayed", "", type="Int32"),
    )

    def initialise(self, start_ns: int, parameters: Mapping[str, Any]) -> dict[str, Any]:
        return {"relayed": parameters["first"]}

    def do_step(self, time_ns: int, step_ns: int, inputs: Mapping[str, Any]) -> dict[str, Any]:
        return {"relayed": inputs["count"]}


class Arrays:
    """A matrix in, doubled out; with bounds, units and all types."""

    variables = (
        parameter("scale", "", "m", shape=(2, 3), start=1.0, min=0.0, max=10.0),
        parameter("mode", "", type="Int32", start=0, min=0, max=3),
        parameter("on", "", type="Boolean", start=False),
        input_("matrix", "", "m", shape=(2, 3)),
        output("doubled", "", "m", shape=(2, 3)),
        output("flat", "", "m", shape=(6,)),
        output("speed", "", "m/s", shape=(2, 3)),
        output("plain", "", shape=(2, 3)),
    )

    def initialise(self, start_ns: int, parameters: Mapping[str, Any]) -> dict[str, Any]:
        return self._outputs(parameters["scale"])

    def do_step(self, time_ns: int, step_ns: int, inputs: Mapping[str, Any]) -> dict[str, Any]:
        return self._outputs(2 * inputs["matrix"])

    def _outputs(self, matrix: Any) -> dict[str, Any]:
        return {"doubled": matrix, "flat": matrix.ravel(), "speed": matrix, "plain": matrix}


class Sampler:
    """Has a tick interval, an input and outputs with the names of the acoustics'."""

    variables = (
        parameter("sampling_time", "", "s", start=0.1),
        input_("position", ""),
        output("range_epoch", "", "s"),
    )

    def initialise(self, start_ns: int, parameters: Mapping[str, Any]) -> dict[str, Any]:
        return {"range_epoch": 0.0}

    def do_step(self, time_ns: int, step_ns: int, inputs: Mapping[str, Any]) -> dict[str, Any]:
        return {"range_epoch": 0.0}


class Updater(Sampler):
    """The same for a receiver."""

    variables = (
        parameter("update_interval", "", "s", start=0.4),
        input_("range_epoch", "", "s"),
        output("epoch", "", "s"),
    )

    def initialise(self, start_ns: int, parameters: Mapping[str, Any]) -> dict[str, Any]:
        return {"epoch": 0.0}


class Source(Sampler):
    """Has a tick interval and no inputs."""

    variables = (
        parameter("sampling_time", "", "s", start=0.1),
        output("position", ""),
    )

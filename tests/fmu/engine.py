"""A component's generated C as a shared library, for one lane or several."""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus.build import compiler, factory
from sblcosim.fmus.build.generator import state_indices
from sblcosim.models.equations import Model
from sblcosim.models.loading import load

DRIVER = Path(__file__).with_name("engine_driver.c")
Array = NDArray[np.float64]


def cpu_flags(lanes: int) -> tuple[str, ...]:
    """Instruction set worth having for a number of lanes, if this machine has it."""
    info = Path("/proc/cpuinfo")
    present = set(info.read_text().split()) if info.exists() else set()
    if lanes == 8 and {"avx512f", "avx512dq"} <= present:
        return ("-mavx512f", "-mavx512dq")
    if lanes >= 4 and "avx2" in present:
        return ("-mavx2",)
    return ()


@cache
def model(name: str) -> Model:
    return load(name)


class Engine:
    """The engine of a component.

    Parameters
    ----------
    name
        Key of `sblcosim.models.COMPONENTS`.
    lanes
        Number of simulations side by side.
    """

    def __init__(
        self, name: str, folder: Path, lanes: int = 1, cc: compiler.Compiler | None = None
    ) -> None:
        self.model = model(name)
        sources = {**factory.engine_sources(self.model), "driver.c": DRIVER.read_bytes()}
        binary = factory.compile_shared(
            sources,
            [factory.Unit("driver.c", (f"-DLANES={lanes}", *cpu_flags(lanes)))],
            cc or compiler.find(),
        )
        label = "default" if cc is None else cc.identity.replace("/", "_").replace(" ", "_")
        path = folder / f"{name}-{lanes}-{label}.so"
        path.write_bytes(binary)
        self.library = ctypes.CDLL(str(path))
        sizes = (ctypes.c_int * 6)()
        self.library.sizes(sizes)
        self.lanes, self.n_p, self.n_u, self.n_x, self.n_w, self.n_y = sizes
        self.places = state_indices(self.model)

    def parameters(self, **values: object) -> Array:
        """One column of parameters: declared starts and what is given."""
        declared = self.model.component.of("parameter")
        unknown = set(values) - {v.name for v in declared}
        assert not unknown, unknown
        columns = [
            np.ravel(np.broadcast_to(np.asarray(values.get(v.name, v.starts), float), (v.size,)
                     if np.size(values.get(v.name, v.starts)) in (1, v.size) else ()))
            for v in declared
        ]
        return np.concatenate(columns) if columns else np.zeros(0)

    def drive(
        self, p: Array, u: Array, interval_ns: int, step_ns: int, variant: int = 0
    ) -> tuple[Array, Array]:
        """Run all lanes.

        Parameters
        ----------
        p : (n_p, lanes)
        u : (steps, n_u, lanes)

        Returns
        -------
        (steps + 1, n_y, lanes) array of outputs and (steps + 1, n_x, lanes) array of states
        """
        p, u = np.ascontiguousarray(p, float), np.ascontiguousarray(u, float)
        assert p.shape == (self.n_p, self.lanes), p.shape
        assert u.shape[1:] == (self.n_u, self.lanes), u.shape
        y = np.empty((len(u) + 1, self.n_y, self.lanes))
        x = np.empty((len(u) + 1, self.n_x, self.lanes))
        done = self.library.drive(
            ctypes.c_int(variant), _pointer(p), _pointer(u), ctypes.c_int64(interval_ns),
            ctypes.c_int64(step_ns), ctypes.c_int(len(u)), _pointer(y), _pointer(x),
        )
        assert done, "a loop found no end"
        return y, x[:, self.places]

    def call(self, function: str, *arguments: int | float | Array) -> Array:
        """One of the generated functions, of a build for one lane; returns what it writes."""
        arguments = tuple(a.copy() if isinstance(a, np.ndarray) else a for a in arguments)
        x, c = np.zeros(self.n_x), np.empty(1)
        if function == "initial":
            arguments = (*arguments, x)
        else:  # the first array is the state
            place = next(i for i, a in enumerate(arguments) if isinstance(a, np.ndarray))
            x[self.places] = arguments[place]
            arguments = (*arguments[:place], x, *arguments[place + 1 :])
        if function.endswith("guard"):
            arguments = (*arguments, c)
        getattr(self.library, f"call_{function}")(
            *(
                _pointer(a) if isinstance(a, np.ndarray)
                else ctypes.c_double(a) if isinstance(a, float) else ctypes.c_int(a)
                for a in arguments
            )
        )
        if function.endswith("guard"):
            return c
        return x[: self.n_y] if function == "output" else x[self.places]

    def outputs(self, y: Array, name: str) -> Array:
        """The rows of one output."""
        start = 0
        for variable in self.model.component.of("output"):
            if variable.name == name:
                return y[..., start : start + variable.size, :]
            start += variable.size
        raise KeyError(name)


def _pointer(array: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)

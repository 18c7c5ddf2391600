"""The functions of FMI 2 and FMI 3 as called by ctypes: one table for every host.

It needs only the standard library, because each conformance check is a process of its own, which
must start quickly. `tests/unit/fmus/test_signatures.py` compares it with the standard's headers.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any, NamedTuple

from ..standard import FMI2_TYPES

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
"""The statuses, the same in both versions; fmi2Pending is not in FMI 3."""
_STATUSES = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")

_P, _N, _D, _I = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double, ctypes.c_int
_B, _S, _R = ctypes.c_bool, ctypes.c_char_p, ctypes.c_uint32  # _R: a value reference

C_TYPES: Mapping[int, Mapping[str, Any]] = {
    2: {"Real": _D, "Integer": ctypes.c_int32, "Boolean": _I, "String": _S},
    3: {
        "Float64": _D, "Float32": ctypes.c_float, "Int8": ctypes.c_int8, "UInt8": ctypes.c_uint8,
        "Int16": ctypes.c_int16, "UInt16": ctypes.c_uint16, "Int32": ctypes.c_int32,
        "UInt32": ctypes.c_uint32, "Int64": ctypes.c_int64, "UInt64": ctypes.c_uint64,
        "Boolean": _B, "String": _S,
    },
}  # fmt: skip
"""C types of the variables' values, by version and kind (the end of the functions' names)."""


class Signature(NamedTuple):
    """Argument types and result of a function; pointers and arrays are plain addresses."""

    arguments: tuple[Any, ...]
    result: Any = _I


def _signatures(rows: Mapping[str, tuple[Any, ...]]) -> dict[str, Signature]:
    """Signatures of functions that return a status, from their argument types."""
    return {name: Signature(arguments) for name, arguments in rows.items()}


_COMMON = {
    "GetVersion": Signature((), _S),
    "FreeInstance": Signature((_P,), None),
    **_signatures({"ExitInitializationMode": (_P,), "Terminate": (_P,), "Reset": (_P,)}),
}
_STATE = _signatures({
    "GetFMUState": (_P, _P), "SetFMUState": (_P, _P), "FreeFMUState": (_P, _P),
    "SerializedFMUStateSize": (_P, _P, _P), "SerializeFMUState": (_P, _P, _P, _N),
    "DeserializeFMUState": (_P, _P, _N, _P),
})  # fmt: skip


def state_function(fmi: int, name: str) -> str:
    """The name of a function that handles states in a version, from its name in FMI 3."""
    if fmi == 3:
        return name
    return name.replace("FMUState", "FMUstate").replace("Deserialize", "DeSerialize")


SIGNATURES: Mapping[int, Mapping[str, Signature]] = {
    2: {
        **_COMMON,
        **{state_function(2, name): signature for name, signature in _STATE.items()},
        "GetTypesPlatform": Signature((), _S),
        "Instantiate": Signature((_S, _I, _S, _S, _P, _I, _I), _P),
        **_signatures({
            "SetDebugLogging": (_P, _I, _N, _P),
            "SetupExperiment": (_P, _I, _D, _D, _I, _D),
            "EnterInitializationMode": (_P,),
            "DoStep": (_P, _D, _D, _I),
            "CancelStep": (_P,),
            "GetStatus": (_P, _I, _P),
            **{f"Get{kind}Status": (_P, _I, _P) for kind in C_TYPES[2]},
            "GetDirectionalDerivative": (_P, _P, _N, _P, _N, _P, _P),
            "SetRealInputDerivatives": (_P, _P, _N, _P, _P),
            "GetRealOutputDerivatives": (_P, _P, _N, _P, _P),
            **{verb + kind: (_P, _P, _N, _P) for verb in ("Get", "Set") for kind in C_TYPES[2]},
        }),
    },
    3: {
        **_COMMON,
        **_STATE,
        "InstantiateCoSimulation": Signature(
            (_S, _S, _S, _B, _B, _B, _B, _P, _N, _P, _P, _P), _P
        ),
        **_signatures({
            "SetDebugLogging": (_P, _B, _N, _P),
            "EnterInitializationMode": (_P, _B, _D, _D, _B, _D),
            "DoStep": (_P, _D, _D, _B, _P, _P, _P, _P),
            "EnterEventMode": (_P,),
            "EnterStepMode": (_P,),
            "EnterConfigurationMode": (_P,),
            "ExitConfigurationMode": (_P,),
            "UpdateDiscreteStates": (_P, _P, _P, _P, _P, _P, _P),
            "GetDirectionalDerivative": (_P, _P, _N, _P, _N, _P, _N, _P, _N),
            "GetAdjointDerivative": (_P, _P, _N, _P, _N, _P, _N, _P, _N),
            "GetOutputDerivatives": (_P, _P, _N, _P, _P, _N),
            "GetNumberOfVariableDependencies": (_P, _R, _P),
            "GetVariableDependencies": (_P, _R, _P, _P, _P, _P, _N),
            **{verb + kind: (_P, _P, _N, _P, _N) for verb in ("Get", "Set") for kind in C_TYPES[3]},
            **{f"{verb}Binary": (_P, _P, _N, _P, _P, _N) for verb in ("Get", "Set")},
            **{f"{verb}Clock": (_P, _P, _N, _P) for verb in ("Get", "Set")},
        }),
    },
}  # fmt: skip
"""The functions in use, by version and by name without the prefix ``fmi2`` or ``fmi3``."""

LOGGERS: Mapping[int, tuple[Any, ...]] = {2: (_P, _S, _I, _S, _S), 3: (_P, _I, _S, _S)}
"""Arguments of the loggers. In FMI 2 the message is a format, and its values follow it."""


def accessor(fmi: int, verb: str, kind: str) -> str:
    """The function, without prefix, that gets or sets a type of FMI 3, for example ``GetReal``."""
    return f"{verb}{FMI2_TYPES[kind] if fmi == 2 else kind}"


def exported(library: Any, fmi: int, name: str) -> Any:
    """A function of a loaded library, by its name without prefix, with its types.

    Raises
    ------
    AttributeError
        The library does not export it.
    """
    function = library[f"fmi{fmi}{name}"]  # a new object, unaffected by what FMPy does to its own
    function.argtypes, function.restype = SIGNATURES[fmi][name]
    return function


def status_text(status: int) -> str:
    """A status for messages."""
    return _STATUSES[status] if 0 <= status < len(_STATUSES) else f"status {status}"

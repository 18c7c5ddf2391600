"""The table of FMI functions agrees with the headers of the standard."""

from __future__ import annotations

import ctypes
import re
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from sblcosim.fmus.build.factory import fmi_headers
from sblcosim.fmus.host.instances import DTYPES
from sblcosim.fmus.host.signatures import C_TYPES, LOGGERS, SIGNATURES, status_text

BOTH = pytest.mark.parametrize("fmi", [2, 3])
TYPES = {2: "fmi2TypesPlatform.h", 3: "fmi3PlatformTypes.h"}
BASIC: dict[str, Any] = {
    "void": None, "char": ctypes.c_char, "double": ctypes.c_double, "float": ctypes.c_float,
    "bool": ctypes.c_bool, "int": ctypes.c_int, "unsigned int": ctypes.c_uint,
    "size_t": ctypes.c_size_t,
    **{f"{u}int{n}_t": getattr(ctypes, f"c_{u}int{n}") for u in ("", "u") for n in (8, 16, 32, 64)},
}  # fmt: skip
INSTANTIATIONS = {2: {"Instantiate"}, 3: {"InstantiateCoSimulation"}}


def header(name: str) -> str:
    """The text of a header without comments."""
    text = (fmi_headers() / name).read_text()
    return re.sub(r"/\*.*?\*/|//[^\n]*", "", text, flags=re.DOTALL)


def named_types(fmi: int) -> dict[str, Any]:
    """What the headers call the types, as ctypes has them."""
    types = dict(BASIC)
    functions = header(f"fmi{fmi}FunctionTypes.h")
    for name in re.findall(r"typedef\s+enum\s*\{[^}]*\}\s*(\w+)\s*;", functions):
        types[name] = ctypes.c_int
    for name in re.findall(r"typedef\s+\w+\s*\(\s*\*\s*(\w+)\s*\)", functions):
        types[name] = ctypes.c_void_p
    for text, name in re.findall(r"typedef\s+([^;{}]*?)(\w+)\s*;", header(TYPES[fmi])):
        types[name] = kind(text, types)
    return types


def kind(text: str, types: dict[str, Any]) -> Any:
    """The type in ctypes of a declaration; arrays and pointers are addresses, but for strings."""
    words = re.sub(r"\bconst\b", "", text)
    if "[" in words:
        return ctypes.c_void_p
    name = " ".join(words.replace("*", " ").split())
    if "*" in words:
        is_text = types.get(name) is ctypes.c_char and words.count("*") == 1
        return ctypes.c_char_p if is_text else ctypes.c_void_p
    while name not in types:  # the name of the argument stands behind its type
        name = name.rpartition(" ")[0]
    return types[name]


def argument(text: str, types: dict[str, Any]) -> Any:
    """The type of an argument; the name behind a pointer's star does not count."""
    return kind(re.sub(r"\*\s*\w+\s*$", "*", text.strip()), types)


def prototypes(fmi: int) -> dict[str, tuple[tuple[Any, ...], Any]]:
    """Argument types and result of each function of the standard, without its prefix."""
    types = named_types(fmi)
    pattern = rf"typedef\s+([\w\s*]+?)\s*fmi{fmi}(\w+)TYPE\s*\(([^)]*)\)\s*;"
    found = re.findall(pattern, header(f"fmi{fmi}FunctionTypes.h"))
    # Some share a type: `fmi3EnterEventModeTYPE fmi3EnterEventMode`.
    pattern = rf"^\s*FMI{fmi}_Export\s+fmi{fmi}(\w+)TYPE\s+fmi{fmi}(\w+);"
    declared = re.findall(pattern, header(f"fmi{fmi}Functions.h"), re.MULTILINE)
    by_type = {
        name: (
            tuple(argument(a, types) for a in arguments.split(",") if a.strip() != "void"),
            argument(result, types),
        )
        for result, name, arguments in found
    }
    return {name: by_type[of] for of, name in declared}


def same(ours: Any, theirs: Any) -> bool:
    """An address may be declared as any pointer; numbers are what they are."""
    if theirs is ctypes.c_char_p:
        return ours in (ctypes.c_char_p, ctypes.c_void_p)
    return ours is theirs


@BOTH
def test_every_signature_is_that_of_the_header(fmi: int) -> None:
    standard = prototypes(fmi)
    assert len(standard) > 30
    for name, (arguments, result) in SIGNATURES[fmi].items():
        expected, returned = standard[name]
        assert len(arguments) == len(expected), name
        for ours, theirs in zip(arguments, expected, strict=True):
            assert same(ours, theirs), (name, ours, theirs)
        assert same(result, returned), (name, result, returned)


@BOTH
def test_every_function_that_a_host_for_co_simulation_calls_is_in_the_table(fmi: int) -> None:
    others = {
        2: {
            "EnterEventMode", "NewDiscreteStates", "EnterContinuousTimeMode", "SetTime",
            "CompletedIntegratorStep", "SetContinuousStates", "GetDerivatives",
            "GetEventIndicators", "GetContinuousStates", "GetNominalsOfContinuousStates",
        },
        3: {
            "InstantiateModelExchange", "InstantiateScheduledExecution",
            "GetIntervalDecimal", "GetIntervalFraction",
            "GetShiftDecimal", "GetShiftFraction", "SetIntervalDecimal", "SetIntervalFraction",
            "SetShiftDecimal", "SetShiftFraction", "EvaluateDiscreteStates",
            "EnterContinuousTimeMode", "CompletedIntegratorStep", "SetTime",
            "SetContinuousStates", "GetContinuousStateDerivatives", "GetEventIndicators",
            "GetContinuousStates", "GetNominalsOfContinuousStates", "GetNumberOfEventIndicators",
            "GetNumberOfContinuousStates", "ActivateModelPartition",
        },
    }  # fmt: skip
    assert set(prototypes(fmi)) - set(SIGNATURES[fmi]) == others[fmi]


@BOTH
def test_values_have_the_types_of_the_header(fmi: int) -> None:
    types = named_types(fmi)
    for name, c_type in C_TYPES[fmi].items():
        assert same(c_type, types[f"fmi{fmi}{name}"]), name


@BOTH
def test_the_logger_is_that_of_the_header(fmi: int) -> None:
    types = named_types(fmi)
    name = {2: "fmi2CallbackLogger", 3: "fmi3LogMessageCallback"}[fmi]
    (text,) = re.findall(rf"\*\s*{name}\)\s*\(([^)]*)\)", header(f"fmi{fmi}FunctionTypes.h"))
    arguments = [a for a in text.split(",") if a.strip() != "..."]
    assert list(LOGGERS[fmi]) == [argument(a, types) for a in arguments]


@BOTH
def test_statuses_have_the_numbers_of_the_header(fmi: int) -> None:
    text = header(f"fmi{fmi}FunctionTypes.h")
    (enumeration,) = re.findall(rf"typedef\s+enum\s*\{{([^}}]*)\}}\s*fmi{fmi}Status\s*;", text)
    names = re.findall(r"\bfmi\d\w+", enumeration)
    assert names == [f"fmi{fmi}{status_text(i)}" for i in range(len(names))]
    assert status_text(99) == "status 99"


def test_numpy_has_the_same_types() -> None:
    assert DTYPES["Float64"] is np.float64
    assert DTYPES["Int64"] is np.int64
    assert DTYPES["UInt64"] is np.uint64
    assert DTYPES["Boolean"] is np.bool_
    for name, dtype in DTYPES.items():
        assert np.dtype(dtype) == np.dtype(C_TYPES[3][name])


def test_the_table_needs_the_standard_library_only() -> None:
    code = (
        "import sys, sblcosim.fmus.host.signatures; "
        "print(*sorted({'numpy', 'fmpy', 'casadi', 'pydantic'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""

"""Small FMUs and SSP packages, written from plain data.

A *block* is the stranger (tests/fmu/stranger) with scalar variables. In a step of h seconds:
``gained = k a + c``, ``total = (k a + c) + (k b + d)``, ``integral += h a``. All
outputs start at 0.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import fmpy
from sblcosim.data.record import Record

_SCHEMAS = {
    "ssd": "Description", "ssc": "Common", "ssv": "ParameterValues", "ssm": "ParameterMapping",
}  # fmt: skip
SPACES = {
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
    **{k: f"http://ssp-standard.org/SSP1/SystemStructure{v}" for k, v in _SCHEMAS.items()},
}
"""Namespaces of the standard, and that of OMSimulator's annotations."""
UNITS: dict[str, dict[str, float]] = {
    "m": {"m": 1}, "km": {"m": 1, "factor": 1000}, "ki": {"m": 1, "factor": 1024},
    "half": {"m": 1, "factor": 0.5, "offset": 3}, "quarter": {"m": 1, "factor": 0.25, "offset": -2},
    "four": {"m": 1, "factor": 4, "offset": 0.5}, "kg": {"kg": 1}, "K": {"K": 1},
    "degC": {"K": 1, "offset": 273.15},
}  # fmt: skip
"""What the packages and the blocks define."""
_VARIABLES = {
    "k": (100, "parameter", 1), "c": (802, "parameter", 0), "d": (803, "parameter", 0),
    "a": (800, "input", 0), "b": (801, "input", 0), "gained": (804, "output", None),
    "integral": (805, "output", None), "total": (808, "output", None),
    "now": (600, "output", None),
}  # fmt: skip
"""Of a block: value reference, causality, start."""


def tag(name: str, /, *inside: str, **attributes: object) -> str:
    """An XML element; attributes that are None are left out."""
    words = "".join(f' {key}="{value}"' for key, value in attributes.items() if value is not None)
    return f"<{name}{words}>{''.join(inside)}</{name}>" if inside else f"<{name}{words}/>"


# --- FMUs -----------------------------------------------------------------------------------------


def block(
    stranger: Callable[[int], Path],
    fmi: int = 2,
    units: Mapping[str, str] | None = None,
    *,
    aliases: Mapping[str, str] | None = None,
    **experiment: float,
) -> bytes:
    """A block as a file.

    Parameters
    ----------
    stranger
        The fixture: a file with the library, by version of FMI.
    units
        Of variables, by name; others have none.
    aliases
        In FMI 3: other names of variables.
    experiment
        Attributes of its DefaultExperiment.
    """
    units, aliases = units or {}, aliases or {}
    two = fmi == 2
    declared = []
    for name, (reference, causality, start) in _VARIABLES.items():
        of_value = {"unit": units.get(name), "start": start}
        of_variable = {
            "name": name, "valueReference": reference, "causality": causality,
            "variability": "fixed" if causality == "parameter" else "continuous",
        }  # fmt: skip
        if two:
            declared.append(tag("ScalarVariable", tag("Real", **of_value), **of_variable))
        else:
            alias = [tag("Alias", name=aliases[name])] if name in aliases else []
            declared.append(tag("Float64", *alias, **of_variable, **of_value))
    outputs = [i for i, (_, causality, _) in enumerate(_VARIABLES.values(), 1)
               if causality == "output"]  # fmt: skip
    if two:
        known = [tag("Unknown", index=i, dependencies="") for i in outputs]
        structure = tag("Outputs", *known) + tag("InitialUnknowns", *known)
        token = {"guid": "stranger-1"}
    else:
        references = [reference for reference, causality, _ in _VARIABLES.values()
                      if causality == "output"]  # fmt: skip
        declared.append(
            tag("Float64", name="time", valueReference=0, causality="independent",
                variability="continuous")
        )  # fmt: skip
        structure = "".join(
            tag(kind, valueReference=reference, dependencies="")
            for kind in ("Output", "InitialUnknown")
            for reference in references
        )
        token = {"instantiationToken": "stranger-1"}
    described = tag(
        "fmiModelDescription",
        tag("CoSimulation", modelIdentifier="stranger",
            canHandleVariableCommunicationStepSize="true"),
        tag("UnitDefinitions", *_units("Unit", "BaseUnit", UNITS)),
        tag("DefaultExperiment", **experiment) if experiment else "",
        tag("ModelVariables", *declared),
        tag("ModelStructure", structure),
        fmiVersion=f"{fmi}.0", modelName="Block", **token,
    )  # fmt: skip
    made = io.BytesIO()
    with zipfile.ZipFile(stranger(fmi)) as old, zipfile.ZipFile(made, "w") as new:
        (library,) = (name for name in old.namelist() if name.endswith(fmpy.sharedLibraryExtension))
        new.writestr("modelDescription.xml", described)
        new.writestr(library, old.read(library))
    return made.getvalue()


def _units(unit: str, base: str, units: Mapping[str, Mapping[str, float]]) -> list[str]:
    return [tag(unit, tag(base, **what), name=name) for name, what in units.items()]


# --- Packages -------------------------------------------------------------------------------------


def connectors(**given: str) -> str:
    """Connectors: "kind" or "kind unit" by name."""
    made = []
    for name, words in given.items():
        kind, _, unit = words.partition(" ")
        real = tag("ssc:Real", unit=unit or None)
        made.append(tag("ssd:Connector", real, name=name, kind=kind))
    return tag("ssd:Connectors", *made)


def part(name: str, *inside: str, source: str = "block.fmu", **more: str) -> str:
    """A component."""
    return tag("ssd:Component", *inside, name=name, source=f"resources/{source}", **more)


def system(name: str, elements: Sequence[str], links: Sequence[str] = (), *before: str) -> str:
    """A system; what is before its elements are connectors and bindings."""
    inside = [tag("ssd:Elements", *elements)] if elements else []
    joined = [tag("ssd:Connections", *links)] if links else []
    return tag("ssd:System", *before, *inside, *joined, name=name)


def link(start: str, end: str, *inside: str, **more: str) -> str:
    """A connection of "element.connector" or, at the system itself, ".connector"."""
    (one, x), (other, y) = (end_.rsplit(".", 1) for end_ in (start, end))
    return tag(
        "ssd:Connection", *inside, startElement=one or None, startConnector=x,
        endElement=other or None, endConnector=y, **more,
    )  # fmt: skip


def linear(factor: float = 1, offset: float = 0) -> str:
    """A transformation."""
    return tag("ssc:LinearTransformation", factor=factor, offset=offset)


def parameters(
    values: Mapping[str, str],
    units: Mapping[str, Mapping[str, float]] | None = None,
    *,
    alone: bool = False,
) -> str:
    """A set of "value", "value unit", "1 2 3 unit" or "'text'" by name.

    Parameters
    ----------
    alone
        As a file of its own.
    """
    made = []
    for name, words in values.items():
        if words.startswith("'"):
            value = tag("ssv:String", value=words.strip("'"))
        else:
            number, _, unit = re.fullmatch("(.*?)( ([a-zA-Z]+))?", words).groups()
            value = tag("ssv:Real", value=number, unit=unit)
        made.append(tag("ssv:Parameter", value, name=name))
    defined = [tag("ssv:Units", *_units("ssc:Unit", "ssc:BaseUnit", units))] if units else []
    spaces = {f"xmlns:{kind}": SPACES[kind] for kind in ("ssv", "ssc")} if alone else {}
    return tag("ssv:ParameterSet", tag("ssv:Parameters", *made), *defined, version="1.0",
               name="values", **spaces)  # fmt: skip


def mapping(*entries: str, alone: bool = False) -> str:
    """A mapping of `entry`; alone: as a file of its own."""
    spaces = {f"xmlns:{kind}": SPACES[kind] for kind in ("ssm", "ssc")} if alone else {}
    return tag("ssm:ParameterMapping", *entries, version="1.0", **spaces)


def entry(source: str, target: str, *inside: str, **more: str) -> str:
    """An entry of a mapping."""
    return tag("ssm:MappingEntry", *inside, source=source, target=target, **more)


def bound(values: str, mapped: str | None = None, **more: str) -> str:
    """A binding of a set, or of a file by its name; with a mapping or the name of one."""
    more = {**more, **({} if values.startswith("<") else {"source": f"resources/{values}"})}
    inside = [tag("ssd:ParameterValues", values)] if values.startswith("<") else []
    if mapped is not None and mapped.startswith("<"):
        inside.append(tag("ssd:ParameterMapping", mapped))
    elif mapped is not None:
        inside.append(tag("ssd:ParameterMapping", source=f"resources/{mapped}"))
    return tag("ssd:ParameterBinding", *inside, **more)


def bindings(*each: str) -> str:
    """Bindings of an element."""
    return tag("ssd:ParameterBindings", *each)


def step(seconds: float) -> str:
    """The annotation with which OMSimulator says the communication interval of a system."""
    inside = tag("oms:FixedStepMaster", stepSize=seconds)
    return tag("ssd:Annotations", tag("ssc:Annotation", tag("oms:Annotations", tag(
        "oms:SimulationInformation", inside)), type="org.openmodelica"))  # fmt: skip


def described(root: str, after: str = "", units: Mapping[str, Mapping[str, float]] = UNITS) -> str:
    """The description of a package whose system is the root."""
    return tag(
        "ssd:SystemStructureDescription", root,
        tag("ssd:Units", *_units("ssc:Unit", "ssc:BaseUnit", units)), after,
        name="made", version="1.0", **{f"xmlns:{kind}": uri for kind, uri in SPACES.items()},
    )  # fmt: skip


def packed(path: Path, description: str, **files: bytes | str) -> Path:
    """Write a package; the names of files have "__" for a dot."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", description)
        for name, content in files.items():
            archive.writestr(f"resources/{name.replace('__', '.')}", content)
    return path


def nested() -> tuple[str, dict[str, str]]:
    """A system and its files: systems in one another, units, values at all levels, mappings."""
    inner = system(
        "inner", [part("a", bindings(bound("low.ssv"))), part("b", source="three.fmu")],
        [link("a.a", ".down"), link("b.a", "a.gained", linear(2, 1)), link(".up", "b.total")],
        connectors(down="input ki", up="output km", set="parameter degC"),
        bindings(bound(parameters({"a.k": "2", "b.c": "3 km"}), prefix="")),
    )  # fmt: skip
    outer = system(
        "outer", [inner, part("c", connectors(a="input m", d="parameter half"))],
        [link("inner.up", "c.a"), link(".go", "inner.down"), link("c.gained", ".out")],
        connectors(go="input m", out="output m"),
        bindings(bound("values.ssv", "names.ssm", prefix="x.")),
    )  # fmt: skip
    root = system(
        "root", [outer, part("e")], [link("outer.out", "e.a"), link("outer.go", "e.integral")],
        connectors(idle="input"),
        bindings(bound(parameters({"outer.c.k": "0.5", "outer.inner.a.d": "1"}),
                       mapping(entry("outer.c.k", "outer.c.k", linear(2))))),
    )  # fmt: skip
    entries = mapping(
        entry("x.p", "c.d"), entry("x.q", "inner.b.k", linear(0.5, 1)), entry("x.p", "go"),
        alone=True,
    )  # fmt: skip
    files = {
        "low__ssv": parameters({"c": "1 km", "b": "2"}, UNITS, alone=True),
        "values__ssv": parameters({"p": "2 ki", "q": "4"}, UNITS, alone=True),
        "names__ssm": entries,
    }
    return root, files


def flat() -> tuple[str, dict[str, str]]:
    """A system and its files: two components that drive one another."""
    links = [link("a.gained", "b.a"), link("a.b", "b.integral", suppressUnitConversion="true")]
    own = bindings(bound(parameters({"a.c": "1", "b.k": "2"})))
    return system("flat", [part("a"), part("b", source="three.fmu")], links, own), {}


def series(record: Record, *path: str) -> list[float]:
    """What an output was at all instants, by the names of systems, component and variable."""
    (found,) = (
        v for name, v in record.values.items() if tuple(re.findall("[A-Za-z0-9]+", name)) == path
    )
    return [float(value) for value in found]

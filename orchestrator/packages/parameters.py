"""The values that an SSP package gives to parameters: sets, mappings and bindings."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from xml.etree.ElementTree import Element

from ..errors import nearest, quoted
from ..simulation.system import Conversion
from .documents import SIDES, SPACES, Documents, local
from .units import LinearUnit, Named, unit_of

_SET = "application/x-ssp-parameter-set"
_MAPPING = "application/x-ssp-parameter-mapping"


@dataclass(frozen=True, slots=True)
class Parameter:
    """A value for a variable of a component, or of a system.

    Attributes
    ----------
    name
        Name of the variable, as seen from where the value is bound.
    type, text
        Type and value as in the standard; the values of an array are separated by blanks.
    unit
        Unit of the value; None: that of the variable.
    file
        File in the package that gives it; empty: the structure itself.
    converts
        Whether to convert units.
    transformation
        Transformation by a mapping, of the value in the unit of the variable.
    """

    name: str
    type: str
    text: str
    unit: Named | None
    file: str
    converts: bool = True
    transformation: Conversion | None = None

    @property
    def origin(self) -> str:
        """Beginning of a message about it: the file that it is in."""
        return f"{self.file}: " if self.file else ""


class Parameters:
    """Reads the bindings of a package's elements.

    Parameters
    ----------
    units
        Units defined by the structure; those of a set have priority.
    """

    def __init__(self, documents: Documents, units: Mapping[str, LinearUnit | None]) -> None:
        self._documents = documents
        self._units = units

    def bound(self, element: Element, where: str) -> tuple[Parameter, ...]:
        """The values that an element is bound to; the last one for a name counts."""
        found: list[Parameter] = []
        bindings = element.find("ssd:ParameterBindings", SPACES)
        for binding in () if bindings is None else bindings:
            if local(binding) != "ParameterBinding":
                raise self._documents.refusal(
                    where, "must have bindings of parameters", local(binding)
                )
            inside = f"{where}: ParameterBinding"
            self._documents.only(
                binding, inside, "ParameterValues", "ParameterMapping", "Annotations"
            )
            self._check_source(binding, inside, _SET)
            given = [*self._set(binding, where)]
            mapping = binding.find("ssd:ParameterMapping", SPACES)
            found += given if mapping is None else self._mapped(given, mapping, where)
        return tuple(found)

    def _check_source(self, element: Element, where: str, kind: str) -> None:
        for key, only in (("type", kind), ("sourceBase", "SSD")):
            if element.get(key, only) != only:
                raise self._documents.refusal(where, f"{key} must be {only}", element.get(key, ""))

    def _set(self, binding: Element, where: str) -> Iterator[Parameter]:
        source, prefix = binding.get("source"), binding.get("prefix", "")
        if source:
            root = self._documents.root(self._documents.file(source, where), "ssv", "ParameterSet")
        else:
            inline = binding.find("ssd:ParameterValues/ssv:ParameterSet", SPACES)
            if inline is None:
                raise self._documents.refusal(
                    f"{where}: ParameterBinding", "must have a source or a ParameterSet in its "
                    "ParameterValues", "neither",
                )  # fmt: skip
            root = inline
        units = {**self._units, **defined(self._documents, root)}
        inside = f"{where}: ParameterSet"
        self._documents.only(root, inside, "Parameters", "Enumerations", "Units", *SIDES)
        group = root.find("ssv:Parameters", SPACES)
        for parameter in () if group is None else group:
            if local(parameter) in SIDES:
                continue
            if local(parameter) != "Parameter":
                raise self._documents.refusal(inside, "must hold parameters", local(parameter))
            yield self._parameter(parameter, prefix, units, where, source or "")

    def _parameter(
        self,
        parameter: Element,
        prefix: str,
        units: Mapping[str, LinearUnit | None],
        where: str,
        file: str,
    ) -> Parameter:
        name = prefix + parameter.get("name", "")
        here = f"{where}: parameter {quoted(name)}"
        values = [child for child in parameter if local(child) not in (*SIDES, "Dimension")]
        if len(values) != 1 or "value" not in values[0].attrib:
            got = ", ".join(map(local, values)) or "none"
            raise self._documents.refusal(here, "must have a value", got)
        (value,) = values
        unit = value.get("unit")
        if unit and unit not in units and re.fullmatch(r"\[.+\]", unit):
            remark = f"{file or where}: the unit {quoted(unit)} is read as {quoted(unit[1:-1])}"
            if remark not in self._documents.remarks:
                self._documents.remarks.append(remark)
            unit = unit[1:-1]
        named = Named(unit, units.get(unit)) if unit else None
        return Parameter(name, local(value), value.attrib["value"], named, file)

    # --- Mappings ---

    def _mapped(self, given: list[Parameter], element: Element, where: str) -> Iterator[Parameter]:
        """The values under the names of their targets, transformed."""
        inside = f"{where}: ParameterMapping"
        self._check_source(element, inside, _MAPPING)
        source = element.get("source")
        if source:
            root = self._documents.root(
                self._documents.file(source, inside), "ssm", "ParameterMapping"
            )
        else:
            inline = element.find("ssm:ParameterMapping", SPACES)
            if inline is None:
                raise self._documents.refusal(
                    inside, "must have a source or a ParameterMapping inside", "neither"
                )
            root = self._documents.checked(inline, inside, "ssm", "ParameterMapping")
        self._documents.only(root, inside, "MappingEntry", *SIDES)
        known = {parameter.name: parameter for parameter in given}
        targets: set[str] = set()
        missing: list[str] = []
        for entry in root.iterfind("ssm:MappingEntry", SPACES):
            name, target = entry.get("source", ""), entry.get("target", "")
            here = f"{inside} of {quoted(name)} to {quoted(target)}"
            if target in targets:
                raise self._documents.refusal(
                    here, "must be the only one to its target", "another one"
                )
            targets.add(target)
            transformation = transformation_of(self._documents, entry, here)
            if name not in known:
                missing.append(name)
                continue
            yield replace(
                known[name], name=target, converts=converts(entry), transformation=transformation
            )
        if missing:
            names = ", ".join(map(quoted, dict.fromkeys(missing)))
            close = nearest(missing[0], known) if len(missing) == 1 else ""
            self._documents.warnings.append(
                f"{inside} has no effect for parameters that the set lacks: {names}{close}"
            )


def defined(documents: Documents, root: Element) -> dict[str, LinearUnit | None]:
    """The units that a file defines; None for a unit without a definition."""
    units: dict[str, LinearUnit | None] = {}
    for space in ("ssd", "ssv"):
        for unit in root.iterfind(f"{space}:Units/ssc:Unit", SPACES):
            base = unit.find("ssc:BaseUnit", SPACES)
            name = unit.get("name", "")
            try:
                units[name] = None if base is None else unit_of(base.attrib)
            except ValueError as error:
                raise documents.refusal(
                    f"unit {quoted(name)}", "must have whole exponents and a finite factor, not 0",
                    str(error),
                ) from None  # fmt: skip
    return units


def converts(element: Element) -> bool:
    """Whether a connection or an entry of a mapping allows the conversion of units."""
    return element.get("suppressUnitConversion", "false") not in ("true", "1")


def transformation_of(
    documents: Documents, element: Element, where: str, *others: str
) -> Conversion | None:
    """The linear transformation of a connection or an entry of a mapping.

    ``others`` are names of further allowed elements.
    """
    documents.only(element, where, "LinearTransformation", *others, *SIDES)
    linear = element.find("ssc:LinearTransformation", SPACES)
    if linear is None:
        return None
    factor, offset = (
        documents.number(f"{where}: {key}", linear.get(key, default))
        for key, default in (("factor", "1"), ("offset", "0"))
    )
    return Conversion(factor, offset)

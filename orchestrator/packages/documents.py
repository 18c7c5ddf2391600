"""The XML files of an SSP package, read within bounds.

Two common and unambiguous faults are repaired, with a remark: a namespace of a draft of the
standard or an incomplete one, and an unbound prefix, if it is in an annotation or is one of the
standard's.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from urllib.parse import unquote
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element
from xml.parsers import expat

from sblcosim.fmus.host.nanoseconds import MAX_SECONDS, nanoseconds
from sblcosim.fmus.read.archive import Archive, shown
from sblcosim.fmus.read.description import parsed

from ..errors import ConfigurationError, FmuError, nearest, quoted

_SSP = "http://ssp-standard.org/SSP1/SystemStructure"
NAMESPACES = {
    "ssd": f"{_SSP}Description",
    "ssc": f"{_SSP}Common",
    "ssv": f"{_SSP}ParameterValues",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
    "sblcosim": "urn:org.sblcosim",
}
"""Namespaces of the files that we write, and of the annotations with step sizes."""
SPACES = {**NAMESPACES, "ssm": f"{_SSP}ParameterMapping"}
"""Namespaces of the files that are read."""
SIDES = (
    "Annotations", "ElementGeometry", "SystemGeometry", "GraphicalElements", "MetaData",
    "Signature",
)  # fmt: skip
"""Elements without an effect on a simulation."""

_NEARLY = re.compile(
    r"https?://(www\.)?(ssp-standard\.org/SSP\d|pmsf\.net/xsd)/(SystemStructure)?"
    r"(?P<what>Description|Common|ParameterValues|ParameterMapping|SignalDictionary)(Draft\d*)?/?"
)
"""Namespaces of drafts of the standard, and others that can only mean one of its own."""


class Documents:
    """Reads the files of one package.

    Attributes
    ----------
    remarks
        Faults that were read anyway, as sentences.
    warnings
        Contents that have no effect or are unclear.
    """

    def __init__(self, archive: Archive) -> None:
        self._archive = archive
        self.remarks: list[str] = []
        self.warnings: list[str] = []

    @property
    def names(self) -> frozenset[str]:
        """The path of the package."""
        return frozenset(self._archive.names)

    def root(self, name: str, space: str, expected: str) -> Element:
        """The root of a file.

        Raises
        ------
        ConfigurationError
            The file is of another kind or version.
        FmuError
            It is damaged, larger than the bounds, or not XML.
        """
        return self.checked(self._parsed(name), name, space, expected)

    def checked(self, root: Element, name: str, space: str, expected: str) -> Element:
        """An element of the expected kind, of a known version."""
        if root.tag != f"{{{SPACES[space]}}}{expected}":
            raise self.refusal(name, f"must be a {expected} of SSP 1.0 or 2.0", root.tag)
        version = root.get("version", "")
        if version.partition(".")[0] not in ("1", "2"):
            raise self.refusal(name, "must be of version 1.0 or 2.0", quoted(version))
        return root

    def file(self, source: str, where: str) -> str:
        """The name in the package of a file that an element refers to."""
        name = unquote(source).removeprefix("./")
        if name not in self._archive.names:
            close = nearest(name, self._archive.names)
            raise self.refusal(
                where, "source must be a file in the package", f"{quoted(source)}{close}"
            )
        return name

    def only(self, element: Element, where: str, *known: str) -> None:
        """Refuse an element with unknown contents, or outside the standard's namespaces."""
        for child in element:
            name = local(child)
            if name not in known:
                raise self.refusal(where, "must hold what can be simulated here", name)
            if name not in SIDES and not child.tag.startswith(f"{{{_SSP}"):
                raise self.refusal(
                    where, f"must have its {name} in a namespace of SSP", quoted(child.tag)
                )

    def time(self, where: str, text: str) -> int:
        """A time in seconds as nanoseconds."""
        seconds = self.number(where, text)
        if abs(seconds) >= MAX_SECONDS:
            raise self.refusal(where, f"must be less than {MAX_SECONDS:g} s", text)
        return nanoseconds(seconds)

    def step(self, where: str, text: str) -> int:
        """A step size in seconds as nanoseconds."""
        step_ns = self.time(where, text)
        if step_ns <= 0:
            raise self.refusal(where, "must be a step of at least 1 ns", quoted(text))
        return step_ns

    def number(self, where: str, text: str) -> float:
        """A finite number."""
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self.refusal(where, "must be a finite number", quoted(text))
        return value

    def refusal(self, where: str, must: str, got: str) -> ConfigurationError:
        """The error that says what must hold where, and what was found."""
        at = f": {shown(where, 200)}" if where else ""
        return ConfigurationError(f"{self._archive.path}{at}: {must}, got {shown(got, 200)}")

    def _parsed(self, name: str) -> Element:
        try:
            root = parsed(self._archive, name)
        except FmuError as error:
            if not isinstance(error.__cause__, ET.ParseError):
                raise
            found = _with_unbound_prefixes(self._archive.read(name))
            if found is None:
                raise
            root, prefixes = found
            self.remarks.append(
                f"{name}: read although the prefix {' and '.join(map(quoted, prefixes))} is bound "
                "to no namespace"
            )
        self._mend_namespaces(name, root)
        return root

    def _mend_namespaces(self, name: str, root: Element) -> None:
        wrong = {}
        for element in root.iter():
            space, _, tag = element.tag.rpartition("}")
            match = _NEARLY.fullmatch(space[1:])
            if match and space[1:] != (right := _SSP + match["what"]):
                wrong[space[1:]] = right
                element.tag = f"{{{right}}}{tag}"
        self.remarks += [
            f"{name}: the namespace {got} is read as {right}" for got, right in wrong.items()
        ]


def some(names: Sequence[str], most: int = 8) -> str:
    """Names for a sentence; of many, the first ones and the number of the others."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return shown(", ".join(names[:most]), 400) + more


def local(element: Element) -> str:
    """The name of an element, without its namespace."""
    return element.tag.rpartition("}")[2]


def annotations_of(element: Element) -> Iterator[Element]:
    """The annotations of an element itself."""
    for group in element:
        if local(group) == "Annotations":
            yield from (child for child in group if local(child) == "Annotation")


def _with_unbound_prefixes(xml: bytes) -> tuple[Element, list[str]] | None:
    """XML that is well-formed except for prefixes without a namespace, and these prefixes.

    None if an unbound prefix outside annotations is not the standard's, or for any other fault.
    """
    scopes: list[tuple[frozenset[str], bool]] = [(frozenset({"xml", "xmlns"}), False)]
    unbound: dict[str, bool] = {}  # and whether it can be repaired
    root = b""
    place = 0

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal root, place
        if len(scopes) == 1:
            root, place = name.encode(), parser.CurrentByteIndex
        bound, inside = scopes[-1]
        bound |= {key[6:] for key in attributes if key.startswith("xmlns:")}
        for prefix in (key.partition(":")[0] for key in (name, *attributes) if ":" in key):
            if prefix not in bound:
                unbound[prefix] = unbound.get(prefix, True) and (inside or prefix in SPACES)
        scopes.append((bound, inside or name.rpartition(":")[2] == "Annotation"))

    def end(name: str) -> None:
        scopes.pop()

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.Parse(xml, True)
    if not unbound or not all(unbound.values()):
        return None
    spaces = "".join(f' xmlns:{key}="{SPACES.get(key, f"unbound:{key}")}"' for key in unbound)
    after = place + len(b"<" + root)
    try:
        return ET.fromstring(xml[:after] + spaces.encode() + xml[after:]), list(unbound)
    except ET.ParseError:
        return None

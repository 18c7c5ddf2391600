"""Terminals of an FMU, which may map variables to ports with other names."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from xml.etree import ElementTree as ET

from sblcosim.models.declaration import TerminalKind, Variable
from sblcosim.models.ports import DEPTH, ESTIMATE, PING_POSE, RECEPTION, SYSTEM, ports

TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
"""Name of the file in an FMU."""
TERMINAL_KIND = "org.sblcosim."
"""Prefix of the kind of a terminal; terminals of equal kinds can be connected."""

PORTS: Mapping[TerminalKind, tuple[Variable, ...]] = {
    "reception": ports(RECEPTION, "input"),
    "pose": ports(PING_POSE, "input"),
    "depth": ports(DEPTH, "input"),
    "estimate": ports(ESTIMATE, "output"),
    "system": ports(SYSTEM, "output"),
}
"""The ports of a receiver, by the kind of their terminal."""


@dataclass(frozen=True, slots=True)
class Member:
    """A variable of the FMU and the port, or the element of a port such as ``position[1]``, it is.

    Attributes
    ----------
    terminal, kind
        Name of the terminal, and its kind with all prefixes.
    known
        Names that the port may have in a terminal of this kind.
    """

    terminal: str
    kind: str
    variable: str
    port: str
    known: tuple[str, ...]

    @property
    def is_known(self) -> bool:
        """Whether there is such a port."""
        return self.port.partition("[")[0] in self.known


def members(document: ET.Element) -> Iterator[Member]:
    """The members of the terminals of our kinds."""
    groups = {TERMINAL_KIND + kind: group for kind, group in PORTS.items()}
    for terminal in document.iterfind("Terminals/Terminal"):
        kind = terminal.get("terminalKind", "")
        for element in terminal.iterfind("TerminalMemberVariable") if kind in groups else ():
            yield Member(
                terminal=terminal.get("name", ""),
                kind=kind,
                variable=element.get("variableName", ""),
                port=element.get("memberName", ""),
                known=tuple(port.name for port in groups[kind]),
            )


def port_names(document: ET.Element, variables: Collection[str]) -> Mapping[str, str]:
    """Names of ports, by the names of the variables that represent them.

    Parameters
    ----------
    variables
        Names of the FMU's variables; members that are not among them are ignored.
    """
    return {m.variable: m.port for m in members(document) if m.is_known and m.variable in variables}

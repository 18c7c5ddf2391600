"""The receivers of a run: names, files and classes, and their labels."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from sblcosim.models import RECEIVERS

from ..errors import ConfigurationError, check_choice, instance, nearest, no_file, quoted
from ..simulation.code.user_code import PythonSource, is_python
from ..simulation.user.files import component_of_file
from ..simulation.user.receivers import of_fmu, of_folder
from .labels import RAW
from .reading import shown
from .scenario import Receivers, Scenario, Source
from .schema import CORE_COMPONENTS


@dataclass(frozen=True)
class Choice:
    """The components that run with a scenario.

    Attributes
    ----------
    receivers
        Receivers by label, including the raw fix.
    components
        Components that replace the scenario's own, by name.
    fmi
        FMI version of our own components; None: the scenario's.
    """

    receivers: Mapping[str, Source]
    components: Mapping[str, Source]
    fmi: int | None = None


def choice_of(
    scenario: Scenario,
    receivers: Receivers = (),
    fmi: int | None = None,
    components: Mapping[str, Source] | None = None,
) -> Choice:
    """The user's choice of what to run with a scenario.

    Raises
    ------
    ConfigurationError
        As `choose`; also for an unknown FMI version or component.
    """
    if fmi is not None:
        check_choice("fmi", fmi, (2, 3))
    replaced = _replaced(components)
    return Choice(choose(scenario, receivers), replaced, fmi)


def _replaced(components: Mapping[str, Source] | None) -> dict[str, Source]:
    if components is not None and not isinstance(components, Mapping):
        raise ConfigurationError(
            f"components: must be a mapping with {', '.join(CORE_COMPONENTS)}, "
            f"got {instance(components)}"
        )
    replaced = dict(components or {})
    for name in replaced:
        if name not in CORE_COMPONENTS:
            raise ConfigurationError(
                f"components: must be {', '.join(CORE_COMPONENTS)}, got {quoted(name)}"
                f"{nearest(str(name), CORE_COMPONENTS)}"
            )
    return replaced


def choose(scenario: Scenario, receivers: Receivers) -> dict[str, Source]:
    """Receivers by label, including the raw fix.

    Raises
    ------
    ConfigurationError
        One of them is unknown, or is given twice without labels.
    """
    by_label: dict[str, Source] = {}
    if isinstance(receivers, Mapping):
        by_label = {label: known_source(source) for label, source in receivers.items()}
    else:
        if isinstance(receivers, str | Path) or not isinstance(receivers, Iterable):
            receivers = () if receivers is None else (receivers,)
        table = scenario.receiver
        own = table.fmu or table.type
        sources = [known_source(source) for source in receivers] or [known_source(own)]
        by_label = labelled(sources)
    for label in by_label:
        if not isinstance(label, str) or label in CORE_COMPONENTS or not label or "." in label:
            raise ConfigurationError(
                "receiver: label must be a name without a dot and not "
                f"{', '.join(CORE_COMPONENTS)}, got {quoted(label)}"
            )
    if "multilateration" not in by_label.values() and RAW not in by_label:
        by_label[RAW] = "multilateration"
    return by_label


def labelled(sources: Sequence[Source]) -> dict[str, Source]:
    """Receivers by label.

    Raises
    ------
    ConfigurationError
        One of them is given twice.
    """
    # Our receivers keep their names, in any position.
    taken = {*CORE_COMPONENTS, RAW, *(source for source in sources if isinstance(source, str))}
    by_label: dict[str, Source] = {}
    for source in sources:
        if source in by_label.values():
            raise ConfigurationError(
                f"receivers: must differ from each other, got {quoted(named(source))} twice"
            )
        by_label[_label(source, {*by_label, *taken})] = source
    return by_label


def known_source(source: Source) -> Source:
    """Distinguish names of receivers from files, and check both."""
    if not isinstance(source, str | Path):
        if not callable(source):
            raise ConfigurationError(
                "receiver: must be a name, an FMU file, or a class or function that makes the "
                f"component, got {instance(source)}"
            )
        return source
    if source in RECEIVERS:
        return source
    if is_python(str(source)):
        return component_of_file(str(source))
    path = Path(source)
    if os.path.isfile(path):
        return path
    if str(source) and os.path.isdir(path) and path.suffix != ".fmu":
        return of_folder(str(source)).fmu
    if path.suffix == ".fmu":
        raise ConfigurationError(
            f"receiver: {shown(path)}: must be an FMU file, got {no_file(path)}"
        )
    raise ConfigurationError(
        f"receiver: must be {', '.join(RECEIVERS)}, an .fmu file or FILE.py:CLASS, got "
        f"{quoted(str(source))}"
        + (_RAW_HINT if source == RAW else "")
        + (nearest(str(source), RECEIVERS) or _as_file(str(source)))
    )


_RAW_HINT = f"; {RAW!r} is shown beside every receiver; as a receiver choose 'multilateration'"


def _as_file(source: str) -> str:
    """Suggestion for a mistaken ``file:Class``."""
    file, colon, name = source.rpartition(":")
    meant = f"{file}.py:{name}"
    return f"; did you mean {meant!r}?" if colon and os.path.isfile(f"{file}.py") else ""


def file_of(source: Source) -> str | None:
    """File or folder of a source; None for one of ours, and for a class without a file."""
    if isinstance(source, PythonSource):
        return source.origin if source.is_file else None
    ours = isinstance(source, str) and source in RECEIVERS
    if ours or callable(source):
        return None
    return str(_given(source).absolute())


def named(source: Source) -> str:
    """A source for messages."""
    return str(_given(source)) if isinstance(source, str | Path) else source.__qualname__


def _given(source: str | Path) -> Path:
    """The file or folder that the user gave; an FMU may have been built from a folder."""
    built = of_fmu(source)
    return Path(source) if built is None else built.folder


def _label(source: Source, taken: Iterable[str]) -> str:
    """Label of a receiver: the name of one of ours, otherwise a name that is not taken."""
    if isinstance(source, str):
        return source
    name = source.stem if isinstance(source, Path) else getattr(source, "__name__", "receiver")
    label = stem = re.sub(r"\W", "_", name)
    number = 2
    while label in taken:
        label = f"{stem}_{number}"
        number += 1
    return label

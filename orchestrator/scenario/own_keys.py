"""Keys of a receiver in a folder of the user: ``[receiver.parameters]``, as it declares them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError
from sblcosim.models.settings.keys import in_si

from ..errors import ConfigurationError, nearest, quoted, shortened
from ..simulation.plans.alike import alike
from ..simulation.system import Value
from ..simulation.user.receivers import UserReceiver
from .messages import requirement
from .scenario import Scenario
from .schema import Table, table_class, toml


def values_of(
    scenario: Scenario, receiver: UserReceiver, given: Mapping[str, Any]
) -> dict[str, Value]:
    """Values of parameters given by their keys, in SI units.

    Raises
    ------
    ConfigurationError
        There is no such key, or the declaration does not allow its value.
    """
    where = scenario.where("receiver", "parameters")
    variables = receiver.parameters
    table: type[Table] = alike(
        "keys of users", id(variables), lambda: table_class("Parameters", variables, {}), variables
    )
    for key in given:
        if key not in table.variables:
            raise ConfigurationError(
                f"{where}: must be keys of {receiver.folder.name} "
                f"({', '.join(table.variables)}), got {quoted(key)}{nearest(key, table.variables)}"
            )
    try:
        values = table(**given)
    except ValidationError as error:
        first = error.errors()[0]
        must, choices = requirement(first)
        got = first["input"]
        close = nearest(got, choices) if isinstance(got, str) else ""
        raise ConfigurationError(
            f"{where}.{first['loc'][0]}: {must}, got {shortened(toml(got))}{close}"
        ) from None
    return {
        table.variables[key].name: in_si(table.variables[key], getattr(values, key))
        for key in given
    }

"""The parameters of a receiver's model, used to compute what is possible."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from ..declaration import Component
from .assumptions import range_noise, with_common
from .keys import in_si

STOCHASTIC = "white_noise_acceleration"
"""The trajectory that is drawn from the model."""
_START = ("prior_position_std_m", "prior_velocity_std_m_s", "initialisation")


def of_receiver(receiver: Component, keys: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters of a receiver by name, in SI units: start values, or the values of given keys.

    Parameters
    ----------
    keys
        Keys of ``[receiver]``. Those that this receiver does not have are ignored.
    """
    return {
        v.name: in_si(v, keys[v.key]) if v.key in keys else v.starts if v.shape else v.starts[0]
        for v in receiver.of("parameter")
    }


def of_model(
    receiver: Component, assumed: Mapping[str, Any], tables: Any, share: Any,
    acceleration_psd: Any = None,
) -> SimpleNamespace:
    """Parameters of a receiver by name, in SI units, from a scenario's true values.

    Parameters
    ----------
    assumed
        Keys of ``[receiver]`` that follow from the system; see `assumptions.levels`.
    tables
        Has the tables ``target``, ``platform``, ``acoustics`` and ``receiver`` as attributes.
    share
        Share of the information in a range that remains despite outliers, 0 to 1.
    acceleration_psd
        q of the motion [m²/s³], for a motion that is not drawn from the model; None: the
        receiver's.
    """
    target, acoustics = tables.target, tables.acoustics
    given = {key: getattr(tables.receiver, key) for key in _START}
    keys = {**assumed, **{key: value for key, value in given.items() if value is not None}}
    if tables.receiver.prior is not None:
        keys["initialisation"] = "prior"
    values = of_receiver(receiver, keys)
    noise = range_noise(acoustics)
    if "range_common_std" not in values:
        noise = with_common(noise, acoustics)
    values["range_std"] = noise / share**0.5
    values["depth_std"] = target.depth_std_m
    if target.trajectory == STOCHASTIC:
        values["acceleration_psd"] = target.acceleration_psd_m2_s3
    elif acceleration_psd is not None:
        values["acceleration_psd"] = acceleration_psd
    return SimpleNamespace(**values, beacons=int(tables.platform.beacons))

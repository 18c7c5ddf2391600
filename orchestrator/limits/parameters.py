"""The parameters of the model, from a scenario's true values."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.models.acoustics.contents import CONTENTS
from sblcosim.models.acoustics.ranging import INVERTED
from sblcosim.models.acoustics.schedules import schedule_of
from sblcosim.models.declaration import Component
from sblcosim.models.receiver.receivers.array import COMPONENT as ARRAY
from sblcosim.models.receiver.receivers.coupled import COMPONENT as COUPLED
from sblcosim.models.receiver.receivers.long_baseline import COMPONENT as LONG_BASELINE
from sblcosim.models.settings.assumptions import (
    common_noise,
    has_clock,
    range_noise,
    with_common,
)
from sblcosim.models.settings.parameters import of_model

from ..scenario.arrangement import has_own_errors
from ..scenario.scenario import Scenario
from .echoes import lost
from .fisher import fisher_factor
from .recursion import ReceiverModel
from .steady import Conditions

Floats = NDArray[np.float64]

RECEIVERS = {"platform": COUPLED, "field": LONG_BASELINE, "array": ARRAY}
"""The receiver whose model the bound uses."""


def parameters(
    scenario: Scenario, acceleration_psd: float | None = None, receiver: Component = COUPLED
) -> Any:
    """Parameters of a receiver by name, in SI units, from the scenario's true values.

    ``range_std`` is σ_r/√I with the factor of `fisher_factor`; ``range_common_std``, where outliers
    are shared. ``acceleration_psd`` is the target's if its motion is drawn from the model,
    otherwise the given one.
    """
    a = scenario.acoustics
    common, noise = common_noise(a), range_noise(a)
    # Outliers that arrivals share say nothing false about their differences.
    together = bool(
        a.arrivals_shared and receiver is ARRAY and (common or not has_clock(a))
    )
    share = fisher_factor(
        common if together else noise if receiver is ARRAY else with_common(noise, a),
        a.outlier_probability, a.outlier_mean_m, a.outlier_distribution,
    )
    of_each = 1.0 if together else share
    found = of_model(receiver, scenario.assumptions(), scenario, of_each, acceleration_psd)
    if together:
        found.range_common_std = common / share**0.5
    return found


def model_of(
    scenario: Scenario, acceleration_psd: float | None = None, own_beacon: bool = False
) -> ReceiverModel:
    """The model of a scenario for the recursion, depending on the beacons' errors.

    Parameters
    ----------
    acceleration_psd
        See `parameters`.
    own_beacon
        Whether packets hold only their own beacon's position.
    """
    own_errors = has_own_errors(scenario.platform)
    a = scenario.acoustics
    name = "field" if own_errors else "array" if a.ranging in INVERTED else "platform"
    return ReceiverModel(
        name, parameters(scenario, acceleration_psd, RECEIVERS[name]),
        {
            "pings": 1.0,
            "speed": a.assumed_sound_speed_m_s / a.sound_speed_m_s - 1,
            "own_beacon": own_beacon and not own_errors,
            "known_start": scenario.receiver.initialisation == "prior" or scenario.true_prior,
        },
    )


def beacons_of(p: Any) -> Floats:
    """Nominal positions of the beacons, body frame [m]; shape (N, 3)."""
    offsets: Floats = np.reshape(p.beacon_offset, (-1, 3)).astype(float)
    return offsets


def own_beacon(scenario: Scenario) -> bool:
    """Whether packets hold only their own beacon's position."""
    coupled = scenario.receiver.type == "coupled"
    return bool(
        CONTENTS[scenario.acoustics.packet_content].only_own
        or (coupled and scenario.receiver.pose_source == "own_beacon")
    )


def spread_of(beacons: Floats) -> float:
    """½ Σ|b − b̄|² of the horizontal arms [m²]; 2 b² for a cross."""
    arms = beacons[:, :2] - beacons[:, :2].mean(0)
    return float((arms**2).sum() / 2)


def conditions(scenario: Scenario, acceleration_psd: float | None = None) -> Conditions:
    """The numbers of a scenario that `closed_form` needs.

    Parameters
    ----------
    acceleration_psd
        q of the path [m²/s³], see `path_psd`; None: the target's if its motion is drawn from the
        model, otherwise 0.01.
    """
    a = scenario.acoustics
    p = parameters(scenario, acceleration_psd, ARRAY if a.ranging in INVERTED else COUPLED)
    beacons = beacons_of(p)
    return Conditions(
        range_std=p.range_std,
        depth_std=p.depth_std,
        spread=spread_of(beacons),
        beacons=len(beacons),
        slot=scenario.acoustics.sampling_time_s,
        loss=lost(scenario.acoustics),
        acceleration_psd=p.acceleration_psd,
        common_std=float(np.hypot(p.gps_markov_std, p.gps_bias_std)),
        heading_std=p.imu_heading_error_std,
        heading_noise_std=p.imu_heading_std,
        together=schedule_of(scenario.acoustics).together(len(beacons)),
        ping_std=common_noise(a) if has_clock(a) else np.inf,
    )

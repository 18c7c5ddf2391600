"""A tournament: receivers compared on the same noise, in one scenario or several.

In each run of a scenario all receivers get the same samples. Run k of every scenario has the k-th
seed. The compared quantity is a response of a run, such as the RMS of its total error, for which
less is better. Runs in which a receiver is lost count like any other, and their share is shown.
Over all scenarios, the observation of a seed is the mean over the scenarios.

>>> import sblcosim                                                       # doctest: +SKIP
>>> print(sblcosim.compare(["harbour-square"], ["ekf", "coupled"]))  # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
from sblcosim.fmus.stopping import interruptible

from ...errors import ConfigurationError, instance, nearest, quoted, shortened
from ...judge.definitions import AXES, FRAMES
from ...results.responses import FLAGS, ON_REQUEST, RESPONSES, Percentile
from ...results.user_responses import of_file, of_function
from ...scenario.files import naming_files
from ...scenario.overrides import pairs
from ...scenario.scenario import Receivers, Scenario
from ...scenario.scenario import load as load_scenario
from ...scenario.sources import known_source
from ...simulation.children.process import patient
from ...simulation.how import How
from ...study import runner
from ...study.kept import Kept
from ...study.study import Study
from ...study.study import load as load_study
from ..common.evaluation import ALL, PERCENTILE, by_place, differences, levels, ranked
from ..common.statistics import CONTAMINATION
from . import alike, cost, starts
from .result import RESPONSE, Tournament, manifest_of

if TYPE_CHECKING:
    from ...scenario.overrides import Changes

RUNS = 200
"""Default number of runs."""
AnyScenario = str | Path | Scenario | Mapping[str, Any]
_SIGNED = {f"{frame}_{axis}_mean_m" for frame in FRAMES for axis in AXES}
_RATES = (*FLAGS, "beyond_claim")


@interruptible
@naming_files
@patient
def compare(
    scenarios: AnyScenario | Sequence[AnyScenario],
    receivers: Receivers = (),
    *,
    runs: int = RUNS,
    response: str | Callable[..., Any] = RESPONSE,
    settling_s: float = 0.0,
    practical: float | None = None,
    overrides: Changes = (),
    seed: int | None = None,
    contamination: float = CONTAMINATION,
    workers: int | None = None,
    master: str | None = None,
    step_timeout: float | None = None,
    timed: bool = True,
    progress: Callable[[float, str], None] | None = None,
    keep: Kept | None = None,
    percentiles: Sequence[Percentile] = (),
    same_start: bool = False,
    before: Callable[[Mapping[str, Any]], None] | None = None,
) -> Tournament:
    """Run receivers on the same noise, and determine which is better.

    Parameters
    ----------
    scenarios
        Names, files, tables or objects, as in `sblcosim.run`.
    receivers
        As in `sblcosim.run`, without labels; none: that of each scenario.
    runs
        Number of seeds, at least 2.
    response
        The compared quantity, less is better: one of `sblcosim.results.responses.RESPONSES`, a
        function of a `sblcosim.results.responses.Run`, or ``"file.py:function"``.
    settling_s
        Errors count from this time after the start [s].
    practical
        Median differences below this do not matter [unit of the response]; None: nothing is called
        equal.
    overrides
        Keys to change in all scenarios.
    seed
        Seed of the first run; the others follow. None: 1.
    contamination
        Share of bad runs against which a mean must hold.
    workers, master, step_timeout
        As in `sblcosim.study.runner.run`.
    timed
        Also measure the time of an update.
    progress
        Called with the completed share, 0 to 1, and the current activity.
    keep
        Folder of finished runs, which are not repeated; None: nothing is written.
    percentiles
        Further percentiles of a run's errors for the table of runs.
    same_start
        Let every receiver begin with the first samples that it receives, and tell none where the
        diver starts. Otherwise receivers with a parameter for it begin there, if the scenario says
        so.
    before
        Called with what is known of the manifest, before the first run.

    Raises
    ------
    ConfigurationError
        A scenario, receiver or argument is invalid.
    """
    check(runs, practical, contamination)
    several = (scenarios,) if isinstance(scenarios, str | Path | Scenario | Mapping) else scenarios
    name, asked = response_of(response)
    keys = _keys(overrides)
    first = keys.pop("seed", None) if seed is None else seed
    keys.pop("seed", None)
    about = {
        "replicates": runs, "settling_time_s": settling_s, "seed": 1 if first is None else first,
        "responses": [PERCENTILE, *(() if asked in (None, PERCENTILE) else (asked,)),
                      *percentiles],
    }  # fmt: skip
    first_to_last = (load_scenario(it, keys.items()) for it in several)
    studies = [
        study_of(starts.evened(it) if same_start else it, receivers, {}, about)
        for it in first_to_last
    ]
    if not studies:
        raise ConfigurationError("scenarios: must be at least one, got none")
    names = [study.base.name for study in studies]
    for it in names:
        if names.count(it) > 1:
            raise ConfigurationError(f"scenarios: must have different names, got {it!r} twice")
        if it == ALL:
            raise ConfigurationError(f"scenarios: must not be named {ALL!r}, which is for the mean")
    if len(studies) > 1:
        alike.check_scenarios({
            study.base.name: study_of(alike.in_effect(study), study.receivers, {}, about)
            for study in studies
        })  # fmt: skip
    settings = {
        "scenarios": [study.base.given() for study in studies],
        "receivers": [alike.origin(known_source(it)) for it in studies[0].receivers],
        "runs": runs, "seed": about["seed"], "settling_s": settling_s, "response": name,
        "practical": practical, "contamination": contamination, "same_start": same_start,
        "knowing_start": starts.settings(studies),
    }  # fmt: skip
    if before is not None:
        before(manifest_of(settings))
    tables = []
    for i, study in enumerate(studies):
        def told(share: float, i: int = i) -> None:
            if progress is not None:
                progress((i + share) / len(studies), f"simulating {names[i]}")

        how = How(master, step_timeout, workers, progress=told)
        tables.append(runner.simulated(study, how, keep))
    told_s = {study.base.name: cost.update_seconds(study) for study in studies} if timed else {}
    return evaluate(dict(zip(names, tables, strict=True)), settings, told_s)


def check(runs: int, practical: float | None, contamination: float) -> None:
    """Refuse numbers that allow no verdict."""
    if isinstance(runs, bool) or not isinstance(runs, int) or runs < 2:
        raise ConfigurationError(f"runs: must be a whole number of at least 2, got {runs!r}")
    if practical is not None and not 0 < practical < float("inf"):
        raise ConfigurationError(f"practical: must be more than 0 and finite, got {practical!r}")
    if not 0 < contamination < 1:
        raise ConfigurationError(
            f"contamination: must be a share between 0 and 1, got {contamination!r}"
        )


def response_of(response: str | Callable[..., Any]) -> tuple[str, Any]:
    """Column of a response, and what a study must be asked for; None: it is always recorded."""
    if not isinstance(response, str):
        if not callable(response):
            raise ConfigurationError(
                f"response: must be a name or a function, got {shortened(instance(response))}"
            )
        found = of_function(response)
        return found.name, found
    if ":" in response:
        found = of_file(response, Path.cwd())
        return found.name, found
    if response not in RESPONSES:
        raise ConfigurationError(
            f"response: must be the name of a response or FILE.py:FUNCTION, got {quoted(response)}"
            f"{nearest(response, RESPONSES)}"
        )
    if response not in lesser():
        raise ConfigurationError(
            f"response: must be one of which less is better, such as {RESPONSE}, got {response!r}"
        )
    return response, response if response in ON_REQUEST else None


def lesser() -> dict[str, str]:
    """The responses for which less is better, each with its description."""
    return {
        name: it.words for name, it in RESPONSES.items()
        if name not in _SIGNED and (it.unit or name in _RATES)
    }  # fmt: skip


def study_of(
    scenario: Any, receivers: Any, fixed: Mapping[str, Any], about: Mapping[str, Any]
) -> Study:
    """Runs of a scenario as it is, as a study without factors."""
    if isinstance(receivers, Mapping):
        raise ConfigurationError("receivers: must be a sequence of receivers, got a mapping")
    settled = load_scenario(scenario, fixed.items())
    receivers = () if receivers is None else receivers
    one = isinstance(receivers, str | Path) or callable(receivers)
    tables = {
        **about, "name": settled.name, "scenario": settled.given(), "design": {"kind": "single"},
    }  # fmt: skip
    study = load_study(tables, receivers=[receivers] if one else list(receivers))
    alike.check_receivers(study)
    return study


def _keys(overrides: Any) -> dict[str, Any]:
    return {".".join(path): value for path, value in pairs(overrides)}


def evaluate(
    runs: Mapping[str, pd.DataFrame],
    settings: Mapping[str, Any],
    update_s: Mapping[str, Mapping[str, float | None]] | None = None,
) -> Tournament:
    """Compare existing runs.

    Parameters
    ----------
    runs
        By scenario, as returned by `sblcosim.study.runner.simulated`; they have the same seeds.
    settings
        As in `Tournament`: ``response``, ``practical`` and ``contamination`` are used.
    """
    responses = tuple(dict.fromkeys((settings["response"], PERCENTILE)))
    values = {response: by_place(runs, response) for response in responses}
    order = tuple(ranked(values[responses[0]]))
    places = tuple(values[responses[0]])
    return Tournament(
        settings,
        order,
        places,
        pd.concat(
            [pd.DataFrame({"scenario": name, **dict(t.items())}) for name, t in runs.items()],
            ignore_index=True,
        ),
        pd.DataFrame(levels(runs, values, order, settings)).astype({"misleading": "Int64"}),
        differences(values, order, settings),
        update_s or {},
    )

"""What keys become, on numbers and on symbols: the same values, and derivatives that are right."""

from __future__ import annotations

import inspect
import itertools
import math
import pkgutil
import random
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import as_recorded
import casadi as ca
import numpy as np
import pytest
from quick import few, one_in
from sblcosim.fmus.host.nanoseconds import SECOND, nanoseconds
from sblcosim.models import COMPONENTS, RECEIVERS, settings
from sblcosim.models.acoustics.contents import CONTENTS
from sblcosim.models.acoustics.ranging import RANGINGS
from sblcosim.models.acoustics.schedules import SCHEDULES
from sblcosim.models.declaration import Variable
from sblcosim.models.platform.variables import MOTION
from sblcosim.models.receiver.receivers.array import COMPONENT as ARRAY
from sblcosim.models.receiver.receivers.coupled import COMPONENT as COUPLED
from sblcosim.models.receiver.receivers.long_baseline import COMPONENT as LONG_BASELINE
from sblcosim.models.settings import (
    assumptions,
    beacons,
    boat,
    echoes,
    either,
    keys,
    motion,
    parameters,
    paths,
    times,
)
from sblcosim.scenario.scenario import load, shipped

TABLES = ("target", "platform", "acoustics", "receiver")
REAL = {f"{name}.{v.key}": v for name in TABLES[:3]
        for v in COMPONENTS[name].of("parameter") if v.type == "Float64" and v.choices is None}
"""Keys that may be symbols: the real numbers of what surrounds a receiver."""
Tables = Any
Flat = dict[str, Any]


def tables_of(name: str) -> Tables:
    """The tables of a shipped scenario as plain objects."""
    scenario = load(name)
    tables = SimpleNamespace(
        **{table: SimpleNamespace(**vars(getattr(scenario, table))) for table in TABLES}
    )
    if isinstance(tables.platform.wave_period_s, str):  # a name is no number
        tables.platform.wave_period_s = 4.0
    return tables


def give(tables: Tables, path: str, one: Callable[[], float]) -> None:
    """Draw the number, or the numbers, of a key."""
    table, _, key = path.partition(".")
    value = getattr(getattr(tables, table), key)
    given = tuple(one() for _ in value) if isinstance(value, tuple) else one()
    setattr(getattr(tables, table), key, given)


def drawn(seed: int) -> Tables:
    """Tables with random numbers that are not 0, and with random choices."""
    numbers = random.Random(seed)
    tables = tables_of(numbers.choice(shipped()))
    for path, variable in REAL.items():
        give(tables, path, one_of(numbers, variable))
    tables.acoustics.packet_content = numbers.choice([*CONTENTS])
    tables.acoustics.schedule = numbers.choice([*SCHEDULES])
    tables.platform.motion = numbers.choice([*MOTION.values()])
    tables.acoustics.ranging = [*RANGINGS][seed % len(RANGINGS)]
    tables.platform.gps_shared = numbers.choice([True, False])
    return tables


def one_of(numbers: random.Random, variable: Variable) -> Callable[[], float]:
    low = 0.01 if variable.min is None else variable.min
    high = low + 2 if variable.max is None else min(variable.max, low + 2)
    return lambda: keys.in_file_units(variable, numbers.uniform(low + 0.01 * (high - low), high))


# --- All of them ---------------------------------------------------------------------------------


def _assumed(t: Tables) -> Any:
    return [assumptions.assumed(t.target, t.platform, t.acoustics, source)
            for source in (None, "beacon_positions", "own_beacon")]


def _levels(t: Tables) -> Any:
    system = assumptions.assumed(t.target, t.platform, t.acoustics)
    return [
        assumptions.levels(system, t.target, t.platform, t.acoustics, estimates_clock=clock,
                           knows_arrangement=arrangement, knows_pings=pings)
        for clock in (True, False) for arrangement in (True, False) for pings in (True, False)
    ]


def _rounding(t: Tables) -> Any:
    return [assumptions.rounding(t.platform, t.acoustics, source)
            for source in ("reported_pose", "beacon_positions", "own_beacon")]


def _of_receiver(t: Tables) -> Any:
    told = _levels(t)[0]
    return {name: parameters.of_receiver(r, told) for name, r in RECEIVERS.items()}


def _of_model(t: Tables) -> Any:
    return [
        vars(parameters.of_model(receiver, told, t, t.acoustics.loss_probability + 0.1, psd))
        for receiver in (COUPLED, LONG_BASELINE, ARRAY) for told in _levels(t)[:1]
        for psd in (None, t.target.speed_m_s)
    ]


TRACK = {"track_count": 3, "track_time_s": (0.0, 5.0, 9.0),
         "track_heading_deg": (0.0, 9.0, 8.0), "track_m": (0.0, 0.0, 4.0, 1.0, 5.0, 3.0)}


def _boats(t: Tables) -> list[Any]:
    """The platform without a track, and on one of three points."""
    return [SimpleNamespace(**{**vars(t.platform), **it}) for it in ({}, TRACK)]


def _turning(t: Tables) -> Any:
    told = {"std": t.platform.boat_speed_m_s, "time": 3.0}
    straight = {"std": t.platform.boat_speed_m_s + 1.0, "time": 2.0}
    return [boat.turning(it, told, "std", "time", straight, yaw=yaw)
            for it in _boats(t) for yaw in (False, True)]


def _of_waves(t: Tables) -> Any:
    developed = SimpleNamespace(**{**vars(t.platform), "wave_period_s": "developed"})
    return [motion.of_waves(t.platform), motion.of_waves(developed)]


def _of_each_key(function: Callable[[Variable, Any], Any]) -> Callable[[Tables], Any]:
    def of(t: Tables) -> Any:
        return {path: function(variable, value_of(t, path)) for path, variable in REAL.items()}

    return of


TRIED: Mapping[str, Callable[[Tables], Any]] = {
    "assumptions.assumed": _assumed,
    "assumptions.levels": _levels,
    "assumptions.clock": lambda t: assumptions.clock(t.acoustics),
    "assumptions.common_noise": lambda t: assumptions.common_noise(t.acoustics),
    "assumptions.with_common": lambda t: assumptions.with_common(
        t.target.speed_m_s, t.acoustics),
    "assumptions.lasting_delay": lambda t: assumptions.lasting_delay(t.acoustics),
    "assumptions.mounting_noise": lambda t: assumptions.mounting_noise(t.platform, t.acoustics),
    "assumptions.range_noise": lambda t: assumptions.range_noise(t.acoustics),
    "assumptions.rounding": _rounding,
    "beacons.beacons_of": lambda t: beacons.beacons_of(t.platform),
    "echoes.chances": lambda t: echoes.chances(t.acoustics),
    "echoes.excesses": lambda t: echoes.excesses(
        either.sqrt, t.target.side_m**2, t.target.depth_start_m, t.platform.beacon_depth_m,
        t.acoustics.water_depth_m),
    "echoes.late": lambda t: echoes.late(t.acoustics.outlier_probability / 2, t.acoustics),
    "echoes.mean_excess": lambda t: echoes.mean_excess(
        t.acoustics.outlier_probability / 2, t.target, t.platform, t.acoustics),
    "echoes.share": lambda t: echoes.share(t.acoustics),
    "keys.in_file_units": _of_each_key(
        lambda v, value: () if v.shape else keys.in_file_units(v, value)),
    "keys.in_si": _of_each_key(keys.in_si),
    "keys.to_si": _of_each_key(lambda v, value: (keys.to_si(v) or (lambda it: it))(value)),
    "keys.within": _of_each_key(keys.within),
    "boat.heading": lambda t: boat.heading(t.platform),
    "boat.inputs": lambda t: [boat.inputs(it) for it in _boats(t)],
    "boat.rates": lambda t: [boat.rates(_boats(t)[1], yaw) for yaw in (False, True)],
    "boat.turning": _turning,
    "motion.of_waves": _of_waves,
    "motion.of_mooring": lambda t: motion.of_mooring(t.platform),
    "motion.of_sines": lambda t: motion.of_sines(t.platform, ("roll", "yaw", "heave")),
    "parameters.of_receiver": _of_receiver,
    "paths.sketch": lambda t: paths.sketch(t.target),
    "parameters.of_model": _of_model,
    "times.update_interval": lambda t: times.update_interval(
        t.acoustics.outlier_mean_m + 1.0, 3),
    "either.sqrt": lambda t: either.sqrt(t.acoustics.range_std_m),
    "either.hypot": lambda t: either.hypot(t.acoustics.range_std_m, 2.0, t.target.depth_std_m),
    "either.square": lambda t: either.square(t.acoustics.range_std_m),
    "either.total": lambda t: either.total([t.acoustics.range_std_m, t.target.depth_std_m]),
    "either.rounded": lambda t: either.rounded(1e6 * t.acoustics.range_std_m) / 1e6,
    "either.exp": lambda t: either.exp(-t.acoustics.range_std_m),
    "either.log": lambda t: either.log(1 + t.acoustics.range_std_m),
    "either.sin": lambda t: either.sin(t.platform.mean_heading_deg),
    "either.degrees": lambda t: either.degrees(t.platform.mean_heading_deg),
    "either.radians": lambda t: either.radians(t.platform.mean_heading_deg),
    "either.greatest": lambda t: either.greatest(t.acoustics.range_std_m, 0.1),
    "either.clipped": lambda t: either.clipped(t.acoustics.range_std_m, 0.01, 0.3),
    "either.where": lambda t: either.where(
        t.acoustics.range_std_m > 0.1, t.target.speed_m_s, t.target.depth_std_m),
    "either.both": lambda t: either.where(
        either.both(t.acoustics.range_std_m > 0.1, t.target.speed_m_s > 0), 1.0, 2.0),
    "either.ratio": lambda t: either.ratio(t.acoustics.range_std_m, t.target.depth_std_m),
}
"""Every setting function of real numbers, as a function of the tables of a scenario."""
CHOICES = {
    "assumptions.has_clock", "assumptions.knowledge", "beacons.arranged", "either.symbolic",
    "keys.default", "keys.is_list",
    "keys.start_of", "keys.starts", "motion.is_sine", "packets.pose_source", "packets.resolutions",
    "paths.counts", "paths.points", "presets.preset",
}
"""Those that take names, whole numbers and declarations only, or ask how many there are."""
OF_EXPRESSIONS = ("exact", "expression", "names", "start_values")
"""Modules for expressions alone: ``tests/fmu/test_settings.py``."""


def test_every_setting_function_is_tried() -> None:
    found = set()
    for module in pkgutil.iter_modules(settings.__path__):
        if module.name in OF_EXPRESSIONS:
            continue
        content = import_module(f"{settings.__name__}.{module.name}")
        found |= {
            f"{module.name}.{name}" for name, value in vars(content).items()
            if inspect.isroutine(inspect.unwrap(value)) and not name.startswith("_")
            and value.__module__ == content.__name__
        }
    assert found == {*TRIED, *CHOICES}


# --- Values as recorded ---------------------------------------------------------------------------


PATHS = ("square", "spiral", "random_path")
"""Trajectories, one for each kind of ranging."""


def full(name: str, ranging: str, trajectory: str) -> Tables:
    """A shipped scenario in which no real number is 0; a key's number depends on no other key."""
    tables = tables_of(name)
    for path, variable in REAL.items():
        table, _, key = path.partition(".")
        one, value = one_of(random.Random(path), variable), value_of(tables, path)
        setattr(getattr(tables, table), key,
                tuple(one() for _ in value) if isinstance(value, tuple) else one())
    tables.acoustics.ranging = ranging
    tables.target.trajectory = trajectory
    return tables


@pytest.mark.parametrize("name", ["gps-buoys", "harbour-lbl", "realistic-sea"])
def test_each_setting_function_gives_the_recorded_numbers(name: str) -> None:
    """Those of shipped scenarios alone would not show what is 0 there."""
    found: dict[str, Any] = {}
    for how, (which, function) in itertools.product(
        zip(RANGINGS, PATHS, strict=True), TRIED.items()
    ):
        results = [value for _, value in flat(function(full(name, *how)))]
        numbers = [float(value) for value in results if not isinstance(value, str)]
        words = [value for value in results if isinstance(value, str)]
        found[f"{how[0]} {which}"] = [*as_recorded.digest_of_all([[numbers]]), *words]
    as_recorded.check(f"setting functions {name}", found)


def with_zeros(seed: int) -> Tables:
    """Tables with random numbers of which some are 0, or the least there is, and random choices."""
    choices = random.Random(f"choices {seed}")
    tables = full(
        choices.choice(["gps-buoys", "harbour-lbl", "realistic-sea"]), choices.choice([*RANGINGS]),
        choices.choice(["semicircle", "circle", "white_noise_acceleration", *PATHS]),
    )
    for path, variable in REAL.items():
        numbers = random.Random(f"{path} {seed}")
        one = one_of(numbers, variable)
        if numbers.random() < (0.2, 0.5, 0.8)[seed % 3]:
            one = partial(keys.in_file_units, variable, max(0.0, variable.min or 0.0))
        give(tables, path, one)
    tables.acoustics.packet_content = choices.choice([*CONTENTS])
    tables.acoustics.schedule = choices.choice([*SCHEDULES])
    tables.platform.motion = choices.choice([*MOTION.values()])
    for table, key in ((tables.acoustics, "common_clock"), (tables.platform, "gps_shared")):
        setattr(table, key, choices.choice([True, False]))
    return tables


@pytest.mark.parametrize("group", range(3))
def test_setting_functions_give_the_recorded_numbers_where_some_are_zero(group: int) -> None:
    """What does not move, has no noise or is never lost: the other side of most conditions."""
    found: dict[str, list[float]] = {}
    for seed in range(16 * group, 16 * (group + 1)):
        tables = with_zeros(seed)
        for which, function in TRIED.items():
            if not which.startswith("keys."):
                row = [math.nan if isinstance(value, str) else float(value)
                       for _, value in flat(function(tables))]  # fmt: skip
                found.setdefault(which, []).extend(as_recorded.digest_of_all([[row]]))
    as_recorded.check(f"setting functions with zeros {group}", found)


# --- Values and derivatives ----------------------------------------------------------------------


def value_of(tables: Tables, path: str) -> Any:
    table, _, key = path.partition(".")
    return getattr(getattr(tables, table), key)


def with_values(tables: Tables, values: list[Any]) -> Tables:
    """Other real numbers, or symbols, in their order in `REAL`; arrays element by element."""
    rest = iter(values)
    changed = SimpleNamespace(
        **{name: SimpleNamespace(**vars(getattr(tables, name))) for name in TABLES})
    for path in REAL:
        table, _, key = path.partition(".")
        value = value_of(tables, path)
        new = tuple(next(rest) for _ in value) if isinstance(value, tuple) else next(rest)
        setattr(getattr(changed, table), key, new)
    return changed


def numbers_of(tables: Tables) -> list[float]:
    found: list[float] = []
    for path in REAL:
        value = value_of(tables, path)
        found += value if isinstance(value, tuple) else [value]
    return found


def flat(result: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """The scalars of a result, and where they are in it."""
    if isinstance(result, Mapping):
        for key, value in result.items():
            yield from flat(value, f"{path}.{key}")
    elif isinstance(result, list | tuple):
        for i, value in enumerate(result):
            yield from flat(value, f"{path}.{i}")
    else:
        yield path, result


def start(path: str) -> Any:
    """What stands for a key of which nothing is known."""
    return keys.start_of(path.rpartition(".")[2])


class Both:
    """A setting function at a scenario: of its numbers, and of symbols with a derivative."""

    def __init__(self, name: str, tables: Tables) -> None:
        self.function, self.tables = TRIED[name], tables
        self.at = numbers_of(tables)
        x = [ca.SX.sym(f"x{i}") for i in range(len(self.at))]
        symbols = dict(flat(self.function(with_values(tables, x))))
        plain = dict(flat(self.function(tables)))
        assert plain.keys() <= symbols.keys()
        self.names = [key for key, value in symbols.items() if not isinstance(value, str)]
        assert all(plain[k] == symbols[k] for k in symbols if k not in self.names)
        x, y = ca.vertcat(*x), ca.vertcat(*(symbols[key] for key in self.names))
        self.symbolic = ca.Function("f", [x], [y, ca.jacobian(y, x)])
        self.depends = {*ca.jacobian_sparsity(y, x).get_col()}
        """Places of the symbols that are in it, in a condition, too."""

    def of_numbers(self, at: list[float]) -> np.ndarray:
        found = dict(flat(self.function(with_values(self.tables, at))))
        return np.array([found[k] if k in found else start(k) for k in self.names], float)


ROUNDED = {
    "keys.in_file_units": 1e-11, "times.update_interval": 1e-9, "either.rounded": 1e-4,
}
"""Relative errors of numbers that are rounded: to twelve digits, and to whole nanoseconds."""
QUICK = ("gps-buoys", "harbour-random", "realistic-sea", *range(2))
SCENARIOS = few([*shipped(), *range(4)], quick=QUICK)


def scenario_of(which: str | int) -> Tables:
    return tables_of(which) if isinstance(which, str) else drawn(which)


@one_in(2)
@pytest.mark.parametrize("which", SCENARIOS)
def test_symbols_have_the_values_of_numbers(which: str | int) -> None:
    tables = scenario_of(which)
    for name in TRIED:
        both = Both(name, tables)
        found, _ = both.symbolic(both.at)
        np.testing.assert_allclose(
            found.full().ravel(), both.of_numbers(both.at), rtol=ROUNDED.get(name, 1e-12),
            atol=1e-300, err_msg=name,
        )


@pytest.mark.parametrize("which", few(SCENARIOS, quick=[*shipped(), 0]))
def test_derivatives_are_those_of_differences(which: str | int) -> None:
    """Where those to the left and to the right agree: elsewhere there is no derivative."""
    tables, compared, not_zero = scenario_of(which), 0, 0
    for name in TRIED:
        both = Both(name, tables)
        middle = both.of_numbers(both.at)
        slopes = both.symbolic(both.at)[1].full()
        assert np.isfinite(slopes).all(), name
        others = [
            x if i in both.depends else 1.5 * x or 0.1 for i, x in enumerate(both.at)
        ]
        assert (both.of_numbers(others) == middle).all(), name
        for i in both.depends:
            x = both.at[i]
            h = 1e-6 * abs(x) or 1e-9
            before, after = (
                both.of_numbers([*both.at[:i], x + step, *both.at[i + 1 :]]) for step in (-h, h)
            )
            right, left = (after - middle) / h, (middle - before) / h
            noise = ROUNDED.get(name, 1e-15) * np.abs(middle) / h + 1e-12
            there = np.abs(right - left) <= 1e-3 * np.abs(right) + 4 * noise
            wanted = (after - before) / (2 * h)
            off = np.abs(slopes[:, i] - wanted) > 1e-4 * np.abs(wanted) + 4 * noise
            assert not (there & off).any(), (
                name, np.array(both.names)[there & off], i, slopes[there & off, i],
                wanted[there & off])
            compared, not_zero = compared + there.sum(), not_zero + np.count_nonzero(wanted[there])
    assert compared > 10_000
    assert not_zero > 300


@pytest.mark.parametrize("depth", [1.0, 5.0, 9.0, 14.5, 19.0])
@pytest.mark.parametrize("chances", [(0.5, 0.3), (0.2, 0.9), (1.0, 0.4), (0.4, 1.0), (0.0, 0.7)])
def test_late_ranges_are_as_late_as_the_first_echo_that_arrives(
    depth: float, chances: tuple[float, float]
) -> None:
    """All outcomes of the two echoes, for a diver nearer to the surface and to the bottom."""
    t = tables_of("harbour-square")
    start = (12.0, -7.0, depth)
    t.target.trajectory, t.target.initial_position_m = "white_noise_acceleration", start
    t.platform.mean_position_m, t.platform.mean_heading_deg = (0.0, 0.0, 8.0), 0.0
    t.acoustics.ranging, t.acoustics.loss_probability = "one_way", 0.4
    t.acoustics.water_depth_m = 20.0
    t.acoustics.surface_echo_probability, t.acoustics.bottom_echo_probability = chances
    amount = number = 0.0
    for beacon in np.reshape(beacons.beacons_of(t.platform), (-1, 3)):
        north, east, down = start - beacon - [0.0, 0.0, 8.0]
        direct, both = math.hypot(north, east, down), depth + beacon[2] + 8.0
        late = [math.hypot(north, east, height) - direct for height in (both, 40.0 - both)]
        for there in itertools.product((True, False), repeat=2):
            share = math.prod(c if it else 1 - c for it, c in zip(there, chances, strict=True))
            if any(there):
                amount += share * min(itertools.compress(late, there))
                number += share
    found = echoes.mean_excess(0.0, t.target, t.platform, t.acoustics)
    assert found == pytest.approx(amount / number)


def test_a_root_of_nothing_has_a_derivative_that_suits_its_square() -> None:
    x = ca.SX.sym("x", 3)
    root = either.hypot(*ca.vertsplit(x))
    slopes = ca.Function("f", [x], [ca.jacobian(root, x), ca.jacobian(root**2, x)])
    assert [each.full().ravel().tolist() for each in slopes([0, 0, 0])] == [[0, 0, 0]] * 2
    np.testing.assert_allclose(slopes([0, 3, 4])[0], [[0, 0.6, 0.8]])


# --- Numbers as before ---------------------------------------------------------------------------


def test_all_receivers_start_alike_where_nothing_is_known() -> None:
    for key in assumptions.SOURCES:
        starts = {keys.default(r, v) for r in RECEIVERS.values() for v in r.of("parameter")
                  if v.key == key and not v.shape}
        assert starts <= {keys.start_of(key)}


def test_intervals_are_whole_nanoseconds() -> None:
    numbers = random.Random(3)
    for _ in range(2000):
        whole = nanoseconds(10 ** numbers.uniform(-6, 6)) / SECOND
        ratio = numbers.randint(1, 1000)
        assert times.update_interval(whole, ratio) == nanoseconds(whole) * ratio / SECOND


NUMBERS = """
import pkgutil, sys
from importlib import import_module
from types import SimpleNamespace as Table
import sblcosim.models.settings as settings
for module in pkgutil.iter_modules(settings.__path__):
    import_module(f"{settings.__name__}.{module.name}")
from sblcosim.models.receiver.receivers.coupled import COMPONENT as COUPLED
from sblcosim.models.settings import assumptions, keys, parameters, presets
target, platform, acoustics = (
    Table(**keys.starts(name, 4), beacons=4) for name in ("target", "platform", "acoustics"))
vars(platform).update(presets.preset("gps_grade", "rtk_fixed"))
found = assumptions.levels(
    assumptions.assumed(target, platform, acoustics), target, platform, acoustics,
    estimates_clock=False, knows_arrangement=True, knows_pings=False)
print(parameters.of_receiver(COUPLED, found)["gps_std"])
print(*{"casadi", "numpy", "pydantic", "sblcosim.scenario"} & sys.modules.keys())
"""


def test_numbers_need_neither_casadi_nor_a_scenario() -> None:
    done = subprocess.run(
        [sys.executable, "-c", NUMBERS], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["0.005"]

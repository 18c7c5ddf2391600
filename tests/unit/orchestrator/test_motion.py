"""What the receivers of a run assumed or learned about the diver's motion, and what is said."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sblcosim
from sblcosim.data.motion import motion_psd
from sblcosim.results.motion import LEARNED, LIVELIER, Motion, motions, too_lively
from sblcosim.results.result import Result
from sblcosim.scenario.labels import RAW

KEY = "receiver.acceleration_psd_m2_s3"
LEARN = ("coupled", "fixed_lag", "long_baseline", "array")


def origin(kind: str, q: float | None) -> dict[str, Any]:
    return {"type": kind, "parameters": {} if q is None else {"acceleration_psd": q}}


@pytest.fixture(scope="module")
def run() -> Result:
    """Of receivers that are told far too small a q."""
    circle = {"target.trajectory": "circle", "target.radius_m": 8.0, "time.duration_s": 60.0}
    return sblcosim.run("realistic-dive", ["coupled", "ekf"], {**circle, KEY: 1e-5})


def learning(run: Result) -> Result:
    """The run as if `coupled` had learned q: 1, 2, 3, … µm²/s³ with each of its updates."""
    count = run.record.values["coupled.update_count"].astype(float)
    record = replace(run.record, values={**run.record.values, "coupled.motion_psd": 1e-6 * count})
    origins = {**run.origins, "coupled": origin("coupled", -1.0)}
    description = replace(run.description, origins=origins)
    return Result(description, record, run.update_interval_ns)


def test_what_was_learned_is_read_at_the_updates(run: Result) -> None:
    record = learning(run).record
    last = int(record.values["coupled.update_count"][-1])
    found = motion_psd(record, "coupled")
    assert found is not None
    assert found == pytest.approx(1e-6 * np.arange(1, last + 1))
    assert motion_psd(record, "ekf") is None
    assert set(motion_psd(run.record, "coupled")) == {1e-5}  # it was told


def test_each_receiver_with_a_q_has_what_it_assumed_or_learned(run: Result) -> None:
    assert run.motion == {"coupled": Motion(1e-5), "ekf": Motion(1e-5)}
    told = learning(run)
    last = float(run.record.values["coupled.update_count"][-1])
    assert [*told.motion] == ["coupled", "ekf"]
    learned = told.motion["coupled"]
    assert learned.assumed is None
    assert learned.last == pytest.approx(1e-6 * last)
    assert learned.median == pytest.approx(1e-6 * (last + 1) / 2)
    silent = motions({"coupled": origin("coupled", -1.0)}, run.record, ("coupled", RAW))
    assert silent == {"coupled": Motion(None, 1e-5, 1e-5)}
    # Of a receiver that learns it and has no output for it, no more is known.
    assert motions({RAW: origin(RAW, -1.0)}, run.record, (RAW,)) == {RAW: Motion(None)}


def test_a_number_that_was_given_is_not_taken_for_learned(run: Result) -> None:
    record = learning(run).record
    found = motions({"coupled": origin("coupled", 0.25)}, record, ("coupled",))
    assert found == {"coupled": Motion(0.25)}
    assert motions({}, record, ("coupled",))["coupled"].assumed is None  # nothing else is known


def test_a_q_of_zero_was_given_and_what_an_origin_tells_comes_before_the_outputs(
    run: Result,
) -> None:
    record = learning(run).record
    assert motions({"coupled": origin("coupled", 0.0)}, record, ("coupled",)) == {
        "coupled": Motion(0.0)
    }
    told = {**origin("coupled", -1.0), LEARNED: {"median": 0.125, "last": 0.5}}
    found = motions({"coupled": told}, record, ("coupled",))
    assert found == {"coupled": Motion(None, 0.125, 0.5)}
    words = "q of the diver's motion: "
    assert str(found["coupled"]) == (
        f"{words}learned, 0.12 m²/s³ in the median and 0.5 m²/s³ at the end"
    )
    assert str(Motion(0.0)) == f"{words}0 m²/s³ assumed"
    assert str(Motion(None, 0.125)) == str(Motion(None, None, 0.5)) == f"{words}learned"
    unknown = {"type": RAW, "parameters": {"acceleration_psd": "learned"}}
    assert motions({RAW: unknown}, record, (RAW,)) == {RAW: Motion(None)}
    assert motions({RAW: origin(RAW, None)}, record, (RAW,)) == {}


def test_it_is_in_words_on_request_and_in_json(run: Result) -> None:
    told = learning(run)
    words = "q of the diver's motion: "
    assert f"  {words}1e-05 m²/s³ assumed\n" in run.text(verbose=True)
    (line,) = re.findall(rf"  {words}learned, (\S+) m²/s³ in the median and (\S+) m²/s³ at the end",
                         told.text(verbose=True))  # fmt: skip
    it = told.motion["coupled"]
    assert [*map(float, line)] == pytest.approx([it.median, it.last], rel=0.05)
    assert words not in told.text()
    as_json = json.loads(json.dumps(told.to_json()))["motion"]
    assert as_json["coupled"] == {
        "assumed_m2_s3": None, "median_m2_s3": it.median, "last_m2_s3": it.last,
    }
    assert as_json["ekf"] == {"assumed_m2_s3": 1e-5, "median_m2_s3": None, "last_m2_s3": None}
    assert str(Motion(None)) == f"{words}learned"


# --- A diver who turns more than is assumed ------------------------------------------------------


def test_a_path_that_is_livelier_than_assumed_is_told(run: Result) -> None:
    assert run.limits is not None
    path = run.limits.acceleration_psd
    assert path > LIVELIER * 1e-5
    assert run.remarks == [
        f"the diver turns more than coupled assumes: q of the path is {path:.2g} m²/s³, not "
        '1e-05 m²/s³; use acceleration_psd_m2_s3 = "learned"'
    ]
    for text in (str(run), run.text(verbose=True), run.to_json()["remarks"]):
        assert run.remarks[0] in text


def said(path_psd: float, **given: tuple[str, float | None]) -> list[str]:
    origins = {label: origin(*it) for label, it in given.items()}
    assumed = {label: Motion(q if q is not None and q >= 0 else None)
               for label, (_, q) in given.items()}  # fmt: skip
    return [*too_lively(assumed, origins, path_psd)]


def test_the_threshold_is_four_times_the_assumed_q() -> None:
    assert not said(0.04, it=("coupled", 0.01))
    assert said(0.0401, it=("coupled", 0.01))
    assert said(1e-9, it=("coupled", 0.0))
    assert not said(0.0, it=("coupled", 0.0))


@pytest.mark.parametrize("kind", sblcosim.receivers())
def test_only_who_could_learn_is_named(kind: str) -> None:
    assert bool(said(1.0, it=(kind, 0.01))) == (kind in LEARN)
    assert not said(1.0, it=(kind, -1.0))
    assert not said(1.0, it=(kind, None))
    assert not said(1.0, it=("another's", 0.01))


def test_receivers_that_assume_the_same_share_a_line() -> None:
    one, two = said(1.0, a=("coupled", 0.01), b=("fixed_lag", 0.01), c=("coupled", 0.1))
    assert one.startswith("the diver turns more than a and b assume: q of the path is 1 m²/s³, not")
    assert "than c assumes: " in two


def test_nothing_is_said_where_it_fits_or_where_nothing_is_known_of_the_path(run: Result) -> None:
    assert not sblcosim.run("realistic-dive", "coupled", {"time.duration_s": 20.0}).remarks
    assert not learning(run).remarks
    other = Result(replace(run.description, scenario={}), run.record, run.update_interval_ns)
    assert other.limits is None
    assert not other.remarks


def test_of_a_drawn_motion_it_is_the_target_s_own_q() -> None:
    drawn = {
        "target": {"trajectory": "white_noise_acceleration", "acceleration_psd_m2_s3": 0.05},
        "time": {"duration_s": 10.0, "sampling_time_s": 0.5},
    }
    (line,) = sblcosim.run(drawn, "coupled", {KEY: 0.01}).remarks
    assert "q of the path is 0.05 m²/s³, not 0.01 m²/s³" in line

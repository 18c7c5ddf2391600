"""Estimates after a run: from results and folders, with the command, and what is refused."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
import sblcosim.cli
from sblcosim.data import samples
from sblcosim.data.record import Record
from sblcosim.errors import ConfigurationError
from sblcosim.estimation import model, start
from sblcosim.estimation.after import assumed
from sblcosim.estimation.folder import read_run
from sblcosim.fmus import stopping
from sblcosim.logs import simulated
from sblcosim.results.result import Result
from seams import Seam
from typer.testing import CliRunner

SHORT = {"time.duration_s": 30.0, "receiver.range_std_m": 0.1}


@pytest.fixture(scope="module")
def run() -> Result:
    """With `coupled` beside another receiver."""
    return sblcosim.run("realistic-dive", ["sequential", "coupled"], {**SHORT, SET: 0.003})


@pytest.fixture(scope="module")
def folder(run: Result, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run.save(tmp_path_factory.mktemp("runs") / "dive", figures=False)


@pytest.fixture
def cli(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., object]:
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: CliRunner().invoke(
        sblcosim.cli.app, [str(a) for a in arguments], catch_exceptions=False
    )


def parameters_of(run: Result) -> object:
    return model.parameters(assumed(run.scenario, ()), run.record.values["target.position"][0])


def test_samples_are_all_that_was_received(run: Result) -> None:
    p = parameters_of(run)
    found = samples.of_record(run.record, p.beacon_offset)
    count = run.record.values["acoustics.reception_count"][-1]
    assert np.bincount(found.beacon, minlength=4).tolist() == count.tolist()
    assert len(found.depth) == 29
    assert np.all(np.diff(found.range_ns) > 0)
    assert found.has_pose.all()
    # A packet says the pose of its own epoch.
    at = np.searchsorted(run.record.time_ns, found.range_ns)
    assert np.array_equal(found.position, run.record.values["platform.reported_position"][at])
    assert found.enough_ns() == run.record.estimates("coupled").epoch_ns[0]


@pytest.mark.parametrize("first", [0, 9])
def test_the_log_of_a_record_holds_its_samples(run: Result, first: int) -> None:
    """In a record that begins under way, what was heard before its first instant is new there."""
    values = {name: series[first:] for name, series in run.record.values.items()}
    record = replace(run.record, time_ns=run.record.time_ns[first:], values=values)
    if first:
        assert (values["acoustics.reception_count"][0] > 0).any()
    found = samples.of_record(record, np.zeros((4, 3)), samples.OWN)
    heard = simulated.of_record(record, name="dive").receptions
    assert sorted(zip(heard.epoch_ns, heard.beacon, heard.range, strict=True)) == sorted(
        zip(found.range_ns, found.beacon, found.range, strict=True)
    )


def test_of_all_positions_and_of_an_own_one(run: Result) -> None:
    p = parameters_of(run)
    said, fitted, own = (samples.of_record(run.record, p.beacon_offset, k) for k in (1, 2, 3))
    np.testing.assert_allclose(fitted.position, said.position, atol=1e-9)
    np.testing.assert_allclose(fitted.attitude, said.attitude, atol=1e-9)
    assert not own.has_pose.any()
    assert not own.attitude.any()


def test_the_smoother_is_judged_beside_the_receivers(run: Result) -> None:
    smoothed = sblcosim.smooth(run)
    total = smoothed.errors.xs("total", level="axis").xs("absolute", level="frame")
    assert [*total.index] == ["sequential", "coupled", "smoother", "raw"]
    assert total.rms_m["smoother"] < 3
    assert total.n["smoother"] == total.n["coupled"] + 1  # it does not wait for an update
    made = smoothed.result.made["smoother"]
    assert smoothed.summary.loc["smoother", "first_fix_s"] == made.epoch_ns[0] / 1e9
    assert smoothed.track.converged
    assert "smoother: " in str(smoothed)
    # It knows what came later: what is possible for a filter is no measure of it.
    assert [*smoothed.result.verdicts] == ["sequential", "coupled", "raw"]
    # Nothing is added to the record: what was made after the run is beside it.
    assert smoothed.result.record is run.record
    own = smoothed.estimates.query("receiver == 'smoother'")
    assert np.array_equal(own[["x_m", "y_m", "z_m"]], made.position)
    np.testing.assert_allclose(
        made.relative_position[:, :2] + made.platform_position[:, :2], made.position[:, :2],
        rtol=1e-13,
    )
    assert made.covariance.shape == (len(made), 6, 6)
    assert smoothed.to_json()["converged"] is True
    assert smoothed.plot_path().axes[0].get_legend_handles_labels()[1][-2:] == ["smoother", "raw"]


def test_a_folder_has_all_that_a_result_has(run: Result, folder: Path) -> None:
    again = read_run(folder)
    assert again.record.values.keys() == run.record.values.keys()
    for name, values in run.record.values.items():
        assert np.array_equal(again.record.values[name], values), name
    assert np.array_equal(again.record.time_ns, run.record.time_ns)
    assert again.record.intervals_ns == run.record.intervals_ns
    assert again.errors.equals(run.errors)
    assert again.summary.equals(run.summary)
    one, two = sblcosim.smooth(run), sblcosim.smooth(folder)
    assert np.array_equal(one.track.mean, two.track.mean)
    assert one.errors.equals(two.errors)


def test_coupled_is_run_on_the_record_where_it_was_not_in_the_run(run: Result) -> None:
    p = parameters_of(run)
    played = start.run_receiver(run.record, p, assumed(run.scenario, ()))
    for name, values in played.values.items():
        if name.startswith("coupled."):
            assert np.array_equal(values, run.record.values[name]), name
    alone = sblcosim.run("realistic-dive", "sequential", {**SHORT, SET: 0.003})
    assert np.array_equal(sblcosim.smooth(alone).track.mean, sblcosim.smooth(run).track.mean)


@pytest.mark.parametrize("receivers", ["coupled", "ekf"])
def test_updates_less_often_than_samples(receivers: str) -> None:
    run = sblcosim.run("paper-scenario-1", receivers, {"time.ekf_ratio": 5, "time.duration_s": 20})
    smoothed = sblcosim.smooth(run)
    total = smoothed.errors.xs("total", level="axis").xs("absolute", level="frame")
    assert total.n["raw"] == 39
    made = smoothed.result.made["smoother"]
    assert total.n["smoother"] == len(made) == 199  # at all epochs of samples
    assert np.isnan(smoothed.summary.loc["smoother", "update_share"])
    first_s = made.epoch_ns[0] / 1e9
    assert smoothed.summary.loc["smoother", "availability"] == pytest.approx(1 - first_s / 20)
    assert total.rms_m["smoother"] < 0.3


def test_a_key_of_the_receiver_can_be_another(run: Result) -> None:
    stiff = sblcosim.smooth(run, {"receiver.acceleration_psd_m2_s3": 1e-5})
    loose = sblcosim.smooth(run, ["receiver.acceleration_psd_m2_s3=0.1"])
    speed = [np.linalg.norm(np.diff(s.track.mean[:, 3:6], axis=0), axis=1).max()
             for s in (stiff, loose)]
    assert speed[0] < 0.1 * speed[1]


LEARNED = {"receiver.acceleration_psd_m2_s3": "learned"}


def having_learned(run: Result, q: float) -> Result:
    """The run with what `coupled` says to have learned: q in the middle of its updates."""
    updates = run.record.values["coupled.update_count"].astype(float)
    column = q + 1e-3 * (updates - np.median(updates[np.diff(updates, prepend=0) > 0]))
    record = replace(run.record, values={**run.record.values, "coupled.motion_psd": column})
    return Result(run.description, record, run.update_interval_ns)


def test_q_that_was_learned_is_its_median_and_without_any_the_start_value(run: Result) -> None:
    told = having_learned(run, 0.4).record
    assert model.psd_of("coupled", told) == pytest.approx(0.4)
    assert model.psd_of("coupled", run.record) == 0.003  # as it was given
    for receiver, record in (("sequential", told), (None, told)):
        assert model.psd_of(receiver, record) == 0.01
    never = replace(told, values={**told.values, "coupled.motion_psd": np.full(len(told), np.nan)})
    assert model.psd_of("coupled", never) == 0.01


def particles(run: Result, q: dict[str, Any]) -> np.ndarray:
    made = sblcosim.research.particle_filter(run, q, particles=200).made["particle_filter"]
    return np.asarray(made.position)


def test_the_particle_filter_takes_the_learned_q(run: Result) -> None:
    told = having_learned(run, 0.4)
    learned = particles(told, LEARNED)
    assert np.allclose(learned, particles(told, {**LEARNED, SET: 0.4}), atol=1e-9)
    assert not np.allclose(learned, particles(told, {SET: 0.003}), atol=1e-3)
    as_given = particles(run, LEARNED)  # nothing was learned
    assert np.allclose(as_given, particles(run, {SET: 0.003}), atol=1e-9)


def test_the_smoother_begins_with_the_learned_q(run: Result) -> None:
    """In half a minute there is little to learn: what is expected counts."""
    restless, steady = (
        np.median(sblcosim.smooth(having_learned(run, q), LEARNED).track.psd) for q in (0.4, 0.004)
    )
    assert restless > 0.1
    assert steady < 0.01


def test_a_given_q_is_that_of_the_whole_track(run: Result) -> None:
    assert set(sblcosim.smooth(having_learned(run, 0.4), {SET: 0.02}).track.psd) == {0.02}


SET = "receiver.acceleration_psd_m2_s3"


def test_what_the_smoother_learned_is_in_manifest_and_json(run: Result) -> None:
    smoothed = sblcosim.smooth(having_learned(run, 0.4), LEARNED)
    psd = smoothed.track.psd
    learned = {"median": np.median(psd), "last": psd[-1]}
    assert smoothed.result.origins["smoother"]["learned_psd_m2_s3"] == learned
    assert smoothed.to_json()["motion"]["smoother"] == {
        "assumed_m2_s3": None, "median_m2_s3": learned["median"], "last_m2_s3": learned["last"],
    }


def test_a_track_that_is_not_believable_is_not_given(run: Result, tmp_path: Path) -> None:
    smoothed = sblcosim.smooth(run, passes=2)
    why = "it has not converged in 2 passes"
    remark = (
        f"smoother: its track is not believable, as {why}; its estimates are those of 'coupled'"
    )
    assert not smoothed.believable
    assert smoothed.doubts == (why,)
    made, filtered = smoothed.result.made["smoother"], run.record.estimates("coupled")
    assert np.array_equal(made.epoch_ns, filtered.epoch_ns)
    assert np.array_equal(made.position, filtered.position)
    assert np.array_equal(made.covariance, filtered.covariance)
    assert made.available_ns is None
    first, second, *_ = str(smoothed).splitlines()
    assert re.match(rf"{re.escape(remark)}: \S+ m RMS, 95 % within", first)
    assert re.match(r"\w+: \S+ m RMS, 95 % within", second)
    assert str(smoothed).count(remark) == smoothed.answer.count(remark) == 1
    assert smoothed._repr_html_().count("its track is not believable") == 1
    assert f"not believable, as {why}" in smoothed.text(verbose=True).splitlines()[-1]
    written = smoothed.to_json()
    assert (written["believable"], written["doubts"]) == (False, [why])
    assert remark in written["remarks"]
    # The folder says it too; a track that is believable takes its place, and the remark.
    again = read_run(smoothed.save(tmp_path / "refused", figures=False))
    assert remark in again.remarks
    assert again.origins["smoother"]["doubts"] == [why]
    better = sblcosim.smooth(again)
    assert better.believable
    assert not any("not believable" in it for it in better.result.remarks)
    assert better.to_json()["believable"] is True


@pytest.mark.parametrize(
    ("key", "why"),
    [
        ("platform.arm_length_m=3.0", "must be a key of the receiver 'coupled', as the"),
        ("receiver.gate=3.0", "must be a key of the receiver 'coupled'"),
        ("receiver.type=ekf", "must be a key of the receiver 'coupled'"),
        ("receiver.range_std_m=-1.0", "must be at least 1e-09, got -1.0"),
        ("receiver.acceleration_psd_m2_s3=lerned", "did you mean 'learned'"),
    ],
)
def test_other_keys_are_refused(run: Result, key: str, why: str) -> None:
    with pytest.raises(ConfigurationError, match=why):
        sblcosim.smooth(run, [key])


def test_what_is_no_run_is_refused(run: Result) -> None:
    with pytest.raises(ConfigurationError, match="run: must be the result of a run, or its folder"):
        sblcosim.smooth(3)  # type: ignore[arg-type]
    with pytest.raises(ConfigurationError, match="passes: must be a whole number of at least 1"):
        sblcosim.smooth(run, passes=0)
    kept = {k: v for k, v in run.record.values.items() if k != "acoustics.range_epoch"}
    other = Result(run.description, Record(run.record.time_ns, kept), run.update_interval_ns)
    with pytest.raises(ConfigurationError, match=r"got no acoustics\.range_epoch"):
        sblcosim.smooth(other)
    deaf = sblcosim.run("realistic-dive", "ekf", {**SHORT, "acoustics.loss_probability": 1.0})
    with pytest.raises(ConfigurationError, match="must have ranges to three beacons"):
        sblcosim.smooth(deaf)


def test_the_particle_filter_is_judged_beside_the_receivers(run: Result) -> None:
    beside = sblcosim.research.particle_filter(run, particles=2000)
    total = beside.errors.xs("total", level="axis").xs("absolute", level="frame")
    assert [*total.index] == ["sequential", "coupled", "particle_filter", "raw"]
    assert total.rms_m["particle_filter"] < 5
    assert total.n["particle_filter"] == total.n["coupled"] + 1
    for bad in ({"particles": 1}, {"seed": -1}, {"particles": 2.5}):
        with pytest.raises(ConfigurationError, match="must be a whole number"):
            sblcosim.research.particle_filter(run, **bad)


def test_the_particle_filter_can_be_stopped_at_any_of_its_epochs(run: Result, seam: Seam) -> None:
    class Enough(Exception):  # noqa: N818
        pass

    left = 20

    def check() -> None:
        nonlocal left
        left -= 1
        if left < 0:
            raise Enough

    seam.instead(stopping.check, check)
    with pytest.raises(Enough):
        sblcosim.research.particle_filter(run, particles=100)


# --- The command ---------------------------------------------------------------------------------


def test_the_command_writes_beside_the_run(cli: Callable[..., object], folder: Path) -> None:
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    done = cli("smooth", folder, "--set", "receiver.acceleration_psd_m2_s3=0.003")
    assert done.exit_code == 0, done.stderr
    assert "smoother" in done.stdout
    written = folder.with_name("dive-smoothed")
    assert done.stdout.endswith(f"written to {written}\n")
    names = {file.name for file in written.iterdir()}
    assert {"errors.csv", "estimates.parquet", "path_xy.svg", "manifest.json"} <= names
    manifest = json.loads((written / "manifest.json").read_text())
    about = {receiver["label"]: receiver for receiver in manifest["receivers"]}["smoother"]
    assert about["type"] == "smoother"
    assert about["parameters"]["acceleration_psd"] == 0.003
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before
    twice = cli("smooth", written, "--no-figures", "--out", "again", "--json")
    assert [*json.loads(twice.stdout)["errors"]] == ["sequential", "coupled", "smoother", "raw"]


def test_the_command_names_the_option_that_a_platform_has_not(
    cli: Callable[..., object], folder: Path
) -> None:
    done = cli("smooth", folder, "--range-offset-std", "1", "--no-figures")
    assert done.exit_code == 2
    assert "error: --range-offset-std: must be 0 for beacons on one platform" in done.stderr


def test_the_command_does_not_replace_another_result(
    cli: Callable[..., object], folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    assert cli("smooth", folder, "--no-figures", "--out", out).exit_code == 0
    assert cli("smooth", folder, "--no-figures", "--out", out).exit_code == 0  # equal
    other = ("smooth", folder, "--no-figures", "--out", out, "--set", "receiver.range_std_m=0.2")
    refused = cli(*other)
    assert refused.exit_code == 2
    assert "must be empty or hold the result of this very run" in refused.stderr
    assert cli(*other, "--force").exit_code == 0


def test_the_command_says_what_is_wrong_with_a_folder(
    cli: Callable[..., object], folder: Path, tmp_path: Path
) -> None:
    def lines(*arguments: object) -> str:
        done = cli("smooth", *arguments)
        assert done.exit_code == 2
        assert not (tmp_path / "out").exists()
        return done.stderr

    what = "must be a folder written by 'sblcosim run'"
    assert f"nowhere: {what}, got nothing of that name" in lines("nowhere", "--out", "out")
    (tmp_path / "file").touch()
    assert f"file: {what}, got a file" in lines("file", "--out", "out")
    (tmp_path / "empty").mkdir()
    assert f"empty: {what}, got no manifest.json in it" in lines("empty", "--out", "out")
    for name, text, why in (
        ("manifest.json", "{", "manifest.json: must be as it was written, got Expecting"),
        ("manifest.json", "", "manifest.json: must be as it was written, got an empty file; del"),
        ("manifest.json", "[]", "must be the manifest of a run"),
        ("record.parquet", "PAR1", "record.parquet: must be as it was written, got other bytes"),
        ("scenario.toml", "[target]\nspeed_m_s = -1", "[target] speed_m_s"),
    ):
        damaged = tmp_path / "damaged"
        damaged.mkdir(exist_ok=True)
        for file in folder.iterdir():
            (damaged / file.name).write_bytes(file.read_bytes())
        (damaged / name).write_text(text)
        assert why in lines(damaged, "--out", "out")


@pytest.mark.parametrize(("change", "got"), [("drop", "epoch_ns"), ("add", "mood")])
def test_estimates_made_after_a_run_must_have_the_columns_of_estimates(
    cli: Callable[..., object], folder: Path, tmp_path: Path, change: str, got: str
) -> None:
    assert cli("smooth", folder, "--no-figures", "--out", "made").exit_code == 0
    manifest = tmp_path / "made" / "manifest.json"
    about = json.loads(manifest.read_text())
    del about["hashes"], about["sha256"]  # as in a folder of an earlier version
    manifest.write_text(json.dumps(about))
    [file] = (tmp_path / "made").glob("estimates-*.parquet")
    table = pd.read_parquet(file)
    (table.drop(columns=got) if change == "drop" else table.assign(**{got: 1.0})).to_parquet(file)
    done = cli("smooth", "made", "--no-figures", "--out", "again")
    assert done.exit_code == 2
    assert f"{file.name}: must be the record of a run, got {got}" in done.stderr


def same_twice(table: pd.DataFrame) -> pd.DataFrame:
    """The second instant is that of the first."""
    return table.assign(time_s=table["time_s"].where(table.index != 1, table["time_s"][0]))


@pytest.mark.parametrize(
    ("change", "got"),
    [
        (same_twice, "no time_s that increases"),
        (lambda t: t[::-1], "no time_s that increases"),
        (lambda t: t[:0], "no time_s that increases"),
        (lambda t: t.drop(columns="time_s"), "no time_s that increases"),
        (lambda t: t.assign(time_s=t["time_s"].astype("float32")), "no time_s that increases"),
        (lambda t: t.assign(mood=1.0), "mood"),
        (lambda t: t.drop(columns="target.position[2]"), "target.position"),
        (lambda t: t.assign(**{"target.position[1]": "here"}), "target.position[1]"),
    ],
)
def test_a_record_of_an_earlier_version_must_be_that_of_a_run(
    cli: Callable[..., object], folder: Path, tmp_path: Path,
    change: Callable[[pd.DataFrame], pd.DataFrame], got: str,
) -> None:  # fmt: skip
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    manifest, file = copy / "manifest.json", copy / "record.parquet"
    about = json.loads(manifest.read_text())
    del about["hashes"], about["sha256"]
    manifest.write_text(json.dumps(about))
    change(pd.read_parquet(file)).to_parquet(file, index=False)
    done = cli("smooth", copy, "--no-figures", "--out", "again")
    assert done.exit_code == 2
    assert f"record.parquet: must be the record of a run, got {got}\n" in done.stderr
    assert not (tmp_path / "again").exists()

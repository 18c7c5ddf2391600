"""A run as an xarray Dataset says what the tables say."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import sblcosim
import xarray as xr
from sblcosim.data.description import RunDescription
from sblcosim.errors import ConfigurationError
from sblcosim.judge.definitions import AXES, FRAMES, PREFIXES
from sblcosim.results.result import Result
from synthetic_record import make_record

DIVE = {"time.duration_s": 20.0, "time.ekf_ratio": 2}


@pytest.fixture(scope="module")
def result() -> Result:
    return sblcosim.run("realistic-dive", ["coupled", "ekf"], DIVE)


@pytest.fixture(scope="module")
def data(result: Result) -> xr.Dataset:
    return result.to_xarray()


def test_it_holds_every_number_of_the_record(result: Result, data: xr.Dataset) -> None:
    held = set()
    for name, values in result.record.values.items():
        owner, _, output = name.partition(".")
        if owner in result.receivers:
            array = data[f"receiver_{output}"].sel(receiver=owner)
        else:
            array = data[f"{owner}_{output}"]
        np.testing.assert_array_equal(array.to_numpy(), values, strict=False)
        assert array.dims[0] == "time"
        held.add(array.name)
    np.testing.assert_array_equal(data["time"], result.table["time_s"])
    by_time = {name for name, array in data.data_vars.items() if "time" in array.dims}
    assert held == by_time


def test_it_holds_every_number_of_the_estimates(result: Result, data: xr.Dataset) -> None:
    epochs = sorted({e for table in result.tracks.values() for e in table["epoch_s"]})
    np.testing.assert_array_equal(data["epoch"], epochs)
    for receiver, table in result.tracks.items():
        own = data.sel(receiver=receiver, epoch=table["epoch_s"].to_numpy())
        columns: dict[str, xr.DataArray] = {}
        for axis in AXES:
            columns[f"{axis}_m"] = own["estimate"].sel(axis=axis)
            columns[f"true_{axis}_m"] = own["true_position"].sel(axis=axis)
        for frame in FRAMES:
            there = own.sel(frame=frame)
            columns[f"{PREFIXES[frame]}error_total_m"] = there["error_total"]
            columns[f"{PREFIXES[frame]}nees_position"] = there["nees_position"]
            for axis in AXES:
                columns[f"{PREFIXES[frame]}error_{axis}_m"] = there["error"].sel(axis=axis)
                columns[f"{PREFIXES[frame]}std_{axis}_m"] = there["std"].sel(axis=axis)
        columns |= {name: own[name] for name in ("nees_state", "nis", "nis_degrees")}
        assert {*table.columns} - {"epoch_s"} <= columns.keys()
        for name, array in columns.items():
            if name in table:
                np.testing.assert_array_equal(array, table[name], err_msg=f"{receiver} {name}")
            else:
                assert np.isnan(array).all(), f"{receiver} {name}"


def test_the_statistics_of_the_errors_are_those_of_the_table(
    result: Result, data: xr.Dataset
) -> None:
    rms = np.sqrt((data["error_total"] ** 2).mean("epoch"))
    for receiver in result.receivers:
        row = result.errors.loc[(receiver, "absolute", "total"), "rms_m"]
        assert float(rms.sel(receiver=receiver, frame="absolute")) == pytest.approx(row, rel=1e-12)


def test_dimensions_have_names_and_labels(data: xr.Dataset) -> None:
    assert data["platform_reported_beacon_position"].dims == ("time", "beacon", "axis")
    assert data["platform_attitude"].dims == ("time", "angle")
    assert data["acoustics_ping_platform_attitude"].dims == ("time", "beacon", "angle")
    assert data["receiver_covariance"].dims == ("time", "receiver", "state", "state_2")
    assert data["error"].dims == ("receiver", "epoch", "frame", "axis")
    labels = {name: data[name].to_numpy().tolist() for name in ("axis", "angle", "beacon", "state")}
    assert labels == {
        "axis": ["x", "y", "z"], "angle": ["roll", "pitch", "yaw"], "beacon": [1, 2, 3, 4],
        "state": ["x", "vx", "y", "vy", "z", "vz"],
    }  # fmt: skip
    assert data["receiver"].to_numpy().tolist() == ["coupled", "ekf", "raw"]
    assert all(name.isidentifier() for name in map(str, data.variables))


def test_every_variable_says_what_it_is_and_in_which_unit(data: xr.Dataset) -> None:
    assert all(array.attrs["long_name"] for array in data.variables.values())
    units = {name: array.attrs.get("units") for name, array in data.variables.items()}
    assert units["time"] == units["epoch"] == units["receiver_epoch"] == "s"
    assert units["error"] == units["target_position"] == units["acoustics_range"] == "m"
    assert units["target_velocity"] == "m/s"
    assert units["platform_attitude"] == "rad"
    assert units["nis"] == "1"
    assert units["receiver_relative_covariance"] == "m2"
    assert units["receiver_covariance"] is None  # it has several
    assert data.attrs["scenario"] == "realistic-dive"


def test_missing_is_nan_and_times_are_plain_seconds(result: Result, data: xr.Dataset) -> None:
    assert data["receiver_clock_offset"].sel(receiver="ekf").isnull().all()
    assert not data["receiver_clock_offset"].sel(receiver="coupled").isnull().any()
    assert data["receiver_valid"].dtype == bool
    assert data["receiver_update_count"].dtype.kind == "i"
    assert data["receiver_restart_count"].dtype.kind == "f"  # the EKF has none
    assert {data[name].dtype.kind for name in ("time", "epoch")} == {"f"}
    assert not data["time"].isnull().any()


def test_epochs_of_one_receiver_only_and_epochs_that_come_twice() -> None:
    record = make_record({"ekf": np.array([[1.0, 0, 0]]), "raw": np.tile([2.0, 0, 0], (3, 1))})
    epoch = record.values["ekf.epoch"].copy()
    epoch[epoch == epoch[5]] = epoch[4]
    record = replace(record, values={**record.values, "ekf.epoch": epoch})
    made = Result(RunDescription("dive", {}, ("ekf", "raw")), record)
    table, data = made.tracks["ekf"], made.to_xarray()
    twice = table["epoch_s"].duplicated(keep=False)
    assert twice.sum() == 2
    last: pd.Series[float] = table[twice].iloc[-1]
    there = data.sel(receiver="ekf", epoch=last["epoch_s"], frame="absolute")
    assert float(there["error"].sel(axis="x")) == last["error_x_m"]
    raw = data["error_total"].sel(receiver="raw", frame="absolute")
    assert int(raw.notnull().sum()) == len(made.tracks["raw"]) == 3
    assert not data["true_position"].isnull().any()


def test_outputs_of_others_keep_their_label_and_dimensions_of_their_own() -> None:
    record = make_record()
    extra = {"ekf.bias": np.ones((101, 2)), "platform.fuel": np.zeros(101)}
    record = replace(record, values={**record.values, **extra})
    data = Result(RunDescription("dive", {}, ("ekf",)), record).to_xarray()
    assert data["ekf_bias"].dims == ("time", "ekf_bias_1")
    assert data["platform_fuel"].dims == ("time",)
    assert "units" not in data["ekf_bias"].attrs


def test_two_names_that_become_one_are_both_there() -> None:
    record = make_record({"platform_x": np.array([[1.0, 0, 0]])})
    extra = {"platform.x_fuel": np.zeros(101), "platform_x.fuel": np.ones(101)}
    record = replace(record, values={**record.values, **extra})
    data = Result(RunDescription("dive", {}, ("platform_x",)), record).to_xarray()
    assert float(data["platform_x_fuel"][0]) + 1 == float(data["platform_x_fuel_"][0]) == 1


def test_it_can_be_written_and_read(data: xr.Dataset) -> None:
    pytest.importorskip("scipy")
    text = {name: array for name, array in data.items() if array.dtype.kind != "b"}
    back = xr.load_dataset(xr.Dataset(text, attrs=data.attrs).to_netcdf(), engine="scipy")
    assert back["time"].dtype.kind == "f"  # and was not taken for a date
    np.testing.assert_array_equal(back["error"], data["error"])


def test_without_xarray_it_says_what_to_install(
    result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ConfigurationError, match=r"must have xarray.*sblcosim\[xarray\]"):
        result.to_xarray()

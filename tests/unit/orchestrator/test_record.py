import numpy as np
import pytest
from sblcosim.data.record import Record
from sblcosim.errors import ConfigurationError


def receiver(**changes):
    """Six instants of a receiver that starts to be valid at the third and updates every other."""
    n = 6
    values = {
        "r.update_count": np.array([0, 0, 1, 1, 2, 2], np.int32),
        "r.valid": np.array([0, 0, 1, 1, 1, 1], bool),
        "r.epoch": np.array([0.0, 0.0, 0.1, 0.1, 0.3, 0.3]),
        "r.position": np.arange(3.0 * n).reshape(n, 3),
        "r.covariance": np.arange(36.0 * n).reshape(n, 6, 6),
        "r.nis": np.arange(1.0 * n),
        "r.nis_degrees": np.arange(n, dtype=np.int32),
        "other.position": np.zeros((n, 3)),
    } | {f"r.{name}": value for name, value in changes.items()}
    kept = {name: value for name, value in values.items() if value is not None}
    return Record(np.arange(n, dtype=np.int64) * 100_000_000, kept)


def test_estimates_are_the_rows_where_the_count_changes():
    estimates = receiver().estimates("r")
    assert len(estimates) == 2
    assert estimates.update_count.tolist() == [1, 2]
    assert estimates.epoch_ns.tolist() == [100_000_000, 300_000_000]
    assert estimates.available_ns.tolist() == [200_000_000, 400_000_000]
    assert estimates.position.tolist() == [[6.0, 7.0, 8.0], [12.0, 13.0, 14.0]]
    assert estimates.covariance.shape == (2, 6, 6)
    assert estimates.nis.tolist() == [2.0, 4.0]
    assert estimates.nis_degrees.tolist() == [2, 4]


def test_what_a_receiver_does_not_put_out_is_none():
    estimates = receiver(covariance=None, nis=None, nis_degrees=None).estimates("r")
    assert estimates.velocity is None
    assert estimates.position_std is None
    assert estimates.covariance is None
    assert estimates.nis is None
    assert estimates.nis_degrees is None


def test_an_update_that_is_not_valid_is_no_estimate():
    valid = np.array([0, 0, 0, 0, 1, 1], bool)
    assert receiver(valid=valid).estimates("r").update_count.tolist() == [2]


def test_without_a_valid_port_a_positive_count_is_valid():
    assert len(receiver(valid=None).estimates("r")) == 2
    count = np.array([-1, 0, 1, 1, 2, 2], np.int32)
    assert receiver(valid=None, update_count=count).estimates("r").update_count.tolist() == [1, 2]


def test_an_estimate_that_is_there_at_the_start_counts():
    count, valid = np.ones(6, np.int32), np.ones(6, bool)
    assert len(receiver(update_count=count, valid=valid).estimates("r")) == 1


def test_epochs_are_rounded_to_whole_nanoseconds():
    epoch = np.array([0.0, 0.0, 4.1, 0.3, 86400.7, 0.0])
    assert receiver(epoch=epoch).estimates("r").epoch_ns.tolist() == [4100000000, 86400700000000]


def test_a_component_without_the_ports_of_a_receiver_is_named():
    with pytest.raises(
        ConfigurationError, match=r"^other: must be a receiver, got no output epoch"
    ):
        receiver().estimates("other")


def test_an_unknown_component_is_named_with_the_nearest():
    with pytest.raises(ConfigurationError, match=r"did you mean 'other'\?$"):
        receiver().estimates("othr")


def test_a_frame_has_one_column_per_element_counted_from_one():
    frame = receiver().to_frame()
    assert list(frame.columns[:5]) == ["time_s", "r.update_count", "r.valid", "r.epoch",
                                       "r.position[1]"]  # fmt: skip
    assert frame["time_s"].tolist() == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
    assert frame["r.covariance[2,1]"].tolist() == [6.0, 42.0, 78.0, 114.0, 150.0, 186.0]
    assert frame["r.position[3]"].tolist() == [2.0, 5.0, 8.0, 11.0, 14.0, 17.0]
    assert frame["r.valid"].dtype == bool
    assert frame["r.update_count"].dtype == np.int32

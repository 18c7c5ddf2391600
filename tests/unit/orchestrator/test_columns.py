"""The declared columns of a run's tables, and what follows from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import sblcosim
from sblcosim.cli.documents.by_command import schema
from sblcosim.data.tables import Columns, TableColumn
from sblcosim.judge import metrics
from sblcosim.judge.columns import (
    CHI_SQUARES,
    ERRORS,
    ESTIMATES,
    SUMMARY,
    TABLES,
)
from sblcosim.results import notebook, text
from synthetic_record import make_record, track


@pytest.fixture(scope="module")
def run() -> sblcosim.Result:
    return sblcosim.run("paper-scenario-1", "coupled", {"time.duration_s": 10.0})


def test_the_tables_of_a_run_have_the_declared_columns_in_their_order(run):
    tables = {"errors": run.errors, "percentiles": run.percentiles, "summary": run.summary}
    assert {*tables, "estimates"} == set(TABLES)
    for name, table in tables.items():
        declared = TABLES[name]
        assert table.index.names == [column.name for column in declared.index]
        assert table.columns.to_list() == [n for n in declared.names if n != "failure"]
    every = run.tracks["coupled"].columns
    assert every.to_list() == ESTIMATES.names
    some = run.tracks["raw"].columns
    assert some.to_list() == [name for name in ESTIMATES.names if name in some]


def test_a_nees_of_the_summary_is_a_column_of_the_estimates():
    for one in CHI_SQUARES:
        assert {one.name} < set(ESTIMATES.names)
        row = metrics.of_chi_square(one.name, np.ones(3), np.full(3, 3))
        assert list(row) == [name for name in SUMMARY.names if name in row]


def test_names_end_with_the_unit_and_every_column_is_described():
    for table in TABLES.values():
        for column in (*table.index, *table.columns):
            assert column.description
            assert column.name.endswith(f"_{column.unit}" if column.unit else column.name)


MORE = (
    TableColumn("big", "Number of large errors", heading="large", type=int, without=0,
                of=lambda e: int((abs(e) > 1).sum())),
    TableColumn("furthest_m", "Largest size", "m", "furthest from the truth",
                of=lambda e: abs(e).max()),
    TableColumn("square_m2", "Mean square", "m²", "square", of=lambda e: (e * e).mean()),
    TableColumn("least_m", "Smallest size", "m", of=lambda e: abs(e).min()),
)  # fmt: skip


@pytest.fixture
def more(monkeypatch: pytest.MonkeyPatch) -> Columns:
    kept = [c for c in ERRORS.columns if c.name in ("mean_m", "rms_m", "std_m", "n")]
    table = replace(ERRORS, columns=(*kept, *MORE))
    for module in (metrics, text, notebook):
        monkeypatch.setattr(module, "ERRORS", table)
    return table


@pytest.mark.parametrize("width", [72, 300])
def test_columns_of_all_kinds_are_printed_below_their_headings(more, width):
    estimates = track(make_record({"ekf": np.array([[3.0, 0, 4]])}), "ekf")
    table = metrics.error_table({"ekf": estimates, "mute": estimates[:0]})
    lines = list(text.errors(table, ("ekf", "mute"), width))
    head = next(line for line in lines if line.startswith("receiver"))
    assert head.endswith("mean      RMS      std    large furthest from the truth square [m²]")
    frames = head.count("large")
    assert frames == (1 if width < 100 else 2)
    total = next(line for line in lines if line.split()[:1] == ["total"])
    values = ["5.000", "5.000", "0.000", "99", "5.000", "25.000"]
    assert total.split() == ["total", *values * frames]
    mute = next(line for line in lines if line.startswith("mute"))
    assert mute.split() == ["mute", "x", *["–", "–", "–", "0", "–", "–"] * frames]
    assert len(total) == len(mute) == len(head)


ONE_BELOW_THE_OTHER = """\
Error [m]               absolute
receiver axis       mean      RMS      std
ekf      x         1.125  -11.250        –
         y         2.250  -22.500 277777.1
         z         3.375  -33.750        –
         total     4.500  -45.000        –
a_name_of_17_char
         x        10.125 -101.250        –
         y        11.250 -112.500  1388886
         z        12.375 -123.750        –
         total    13.500 -135.000        –

Error [m]       relative to the platform
                  as it reports itself
receiver axis       mean      RMS      std
ekf      x         5.625  -56.250        –
         y         6.750  -67.500 833331.4
         z         7.875  -78.750        –
         total     9.000  -90.000        –
"""
SIDE_BY_SIDE = """\
Error [m]               absolute             relative to the platform
                                               as it reports itself
receiver axis       mean      RMS      std       mean      RMS      std
ekf      x         1.125  -11.250        –      5.625  -56.250        –
         y         2.250  -22.500 277777.1      6.750  -67.500 833331.4
         z         3.375  -33.750        –      7.875  -78.750        –
         total     4.500  -45.000        –      9.000  -90.000        –
a_name_of_17_char
         x        10.125 -101.250        –          –        –        –
         y        11.250 -112.500  1388886          –        –        –
         z        12.375 -123.750        –          –        –        –
         total    13.500 -135.000        –          –        –        –
"""


@pytest.mark.parametrize(("width", "expected"), [
    (42, ONE_BELOW_THE_OTHER), (70, ONE_BELOW_THE_OTHER), (71, SIDE_BY_SIDE), (300, SIDE_BY_SIDE),
])  # fmt: skip
def test_frames_of_errors_stand_side_by_side_where_there_is_room(width, expected):
    """Three columns of nine characters each, with two between frames; 15 are on their left.

    A name of more than sixteen characters has a line of its own, and who has no error in any frame
    of a block is not in it. A number that does not fit with a space before it has fewer decimals.
    """
    names, values, rows = ("ekf", "a_name_of_17_char"), 0.0, {}
    for name, frame in (("ekf", "absolute"), ("ekf", "relative"), (names[1], "absolute")):
        for axis in ("x", "y", "z", "total"):
            values += 1.125
            std = 123456.5 * values if axis == "y" else np.nan
            rows[name, frame, axis] = (values, -10 * values, std, 7)
    index = pd.MultiIndex.from_tuples(rows, names=["receiver", "frame", "axis"])
    table = pd.DataFrame([*rows.values()], index, ["mean_m", "rms_m", "std_m", "n"])
    assert list(text.errors(table, names, width)) == expected.splitlines()
    sixteen = table.rename(index={names[1]: "a_name_of_16_cha"})
    found = [*text.errors(sixteen, ("ekf", "a_name_of_16_cha"), 79)]
    row = "a_name_of_16_cha x        10.125 -101.250        –          –        –        –"
    assert row in found
    assert any("as it reports itself" in line for line in text.errors(sixteen, names[:1], 78))


def test_a_row_of_json_has_the_types_that_are_declared():
    for name, table in TABLES.items():
        if name == "estimates":
            continue
        part = schema("run")["$defs"][table.part]
        assert list(part["properties"]) == table.names
        assert part["required"] == [c.name for c in table.columns if not c.sometimes]
        assert [p["description"] for p in part["properties"].values()] == [
            c.description for c in table.columns
        ]

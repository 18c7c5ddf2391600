"""The table of a budget, its columns declared."""

from __future__ import annotations

from typing import Literal

from ...data.tables import Columns, TableColumn

RowKind = Literal["all", "source", "together", "rest", "remainder"]
"""Kinds of rows, in the order in which they are shown."""

ROWS = Columns(
    "BudgetRow",
    "A source of error, or what is left of the whole, in one frame.",
    (),
    (
        TableColumn("frame", "What the error is relative to.",
                    type=Literal["absolute", "own_relative"]),
        TableColumn("source", "Name of the source.", type=str),
        TableColumn("kind", "Nothing switched, one source, several, all of them, or what does not "
                    "add up.", type=RowKind),
        TableColumn("rms_m", "RMS error without the source, or with better equipment; for the "
                    "kind all, without a switch.", "m", "RMS"),
        TableColumn("share", "Part of the mean square that goes with the source; negative where "
                    "the error grows.", heading="share"),
        TableColumn("share_low", "Lower end of the share's 95 % interval."),
        TableColumn("share_high", "Upper end of the share's 95 % interval."),
        TableColumn("alone_rms_m", "RMS error with all others switched.", "m", heading="RMS alone"),
        TableColumn("alone_share", "What the source adds to the rest, as a part of the whole mean "
                    "square.",
                    heading="alone"),
        TableColumn("alone_low", "Lower end of the 95 % interval of alone_share."),
        TableColumn("alone_high", "Upper end of the 95 % interval of alone_share."),
        TableColumn("bound_rms_m", "Possible RMS error; null where there is no accuracy.",
                    "m", "RMS"),
        TableColumn("bound_share", "Share of the possible mean square that goes with the source."),
        TableColumn("bound_alone_rms_m", "Possible RMS error with all others switched.", "m"),
        TableColumn("bound_alone_share", "What the source adds to the possible error."),
    ),
)  # fmt: skip

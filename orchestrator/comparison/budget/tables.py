"""The table of a budget, its columns declared."""

from __future__ import annotations

from typing import Literal

from ...data.tables import Columns, TableColumn

ROWS = Columns(
    "BudgetRow",
    "A source of error, or what is left of the whole, in one frame.",
    (),
    (
        TableColumn("frame", "What the error is relative to.",
                    type=Literal["absolute", "own_relative"]),
        TableColumn("source", "Its name.", type=str),
        TableColumn("kind", "Nothing switched, one source, several, all of them, or what does not "
                    "add up.", type=Literal["all", "source", "together", "rest", "remainder"]),
        TableColumn("rms_m", "Without the source, or with better equipment; of the kind all, as it "
                    "is.", "m", "RMS"),
        TableColumn("share", "Part of the mean square that goes with it; negative where the error "
                    "grows.", heading="share"),
        TableColumn("share_low", "Of the 95 % interval."),
        TableColumn("share_high", "Of the 95 % interval."),
        TableColumn("alone_rms_m", "With all others switched.", "m", heading="RMS alone"),
        TableColumn("alone_share", "What it adds to the rest, as a part of the whole mean square.",
                    heading="alone"),
        TableColumn("alone_low", "Of the 95 % interval."),
        TableColumn("alone_high", "Of the 95 % interval."),
        TableColumn("bound_rms_m", "The same of what is possible; null where there is no "
                    "accuracy.", "m", "RMS"),
        TableColumn("bound_share", "The share of what is possible."),
        TableColumn("bound_alone_rms_m", "What is possible with all others switched.", "m"),
        TableColumn("bound_alone_share", "What the source adds to it."),
    ),
)  # fmt: skip

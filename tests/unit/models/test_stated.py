"""Numbers that the pages of the models state are those that the sources use."""

from __future__ import annotations

import re
from importlib import import_module, resources
from typing import Any

import pytest

NUMBER = r"(\d[\d.]*|10⁶|10\^\{-?\d+\})"
COUPLED, BASELINE, RAW, ARRAY, ALL = (
    f"receiver/{name}.md"
    for name in ("coupled", "long_baseline", "multilateration", "array", "README")
)

STATED = [
    (COUPLED, "# rad about the first packet", "receiver.coupled:_ANYWHERE"),
    (COUPLED, "# m about the first packet", "receiver.coupled:_FAR_STD"),
    (COUPLED, "a challenger begins again from the latest receptions every # s",
     "receiver.coupled:_CHALLENGE"),
    (COUPLED, "Where the log-likelihood of its ranges leads by #,", "receiver.coupled:_LEAD"),
    (COUPLED, r"With the density $\varepsilon/L$ of $#$ in # m", "receiver.lateness:_WRONG",
     "receiver.lateness:_REACH"),
    (COUPLED, r"- # \lambda$, and by $#\, (1 - \lambda)$ more", "receiver.lateness:_ACCEPTED",
     "receiver.lateness:_TOO_SHORT"),
    (COUPLED, r"Above #, or if $\lvert v \rvert$ exceeds", "receiver.lateness:LIMIT"),
    (COUPLED, r"$\lvert y \rvert$ is above # m)", "receiver.surroundings:NEAREST"),
    (COUPLED, "A bearing of variance $s$ (at most #,", "receiver.surroundings:WIDEST"),
    (COUPLED, "at most # damped Gauss–Newton passes", "receiver.least_squares:PASSES"),
    (COUPLED, "$x$ has that of # m about the platform", "receiver.start:_FAR_STD"),
    (COUPLED, "Every # s the filters are mixed as if a diver kept to one $q$ for $\\tau$ = # s",
     "receiver.bank:EVERY", "receiver.bank:MEMORY"),
    (COUPLED, "below # rad², or after", "receiver.pose:_KNOWN"),
    (BASELINE, "Every # s the filters are mixed as if a diver kept to one $q$ for # s",
     "receiver.bank:EVERY", "receiver.bank:MEMORY"),
    (BASELINE, "after a start, and then every # s", "receiver.mirror:EVERY"),
    (BASELINE, "images that are more than # standard deviations away", "receiver.mirror:_APART"),
    (BASELINE, "and with at most # points", "receiver.mirror:_ODD"),
    (BASELINE, "over the latest ranges, is above $-#$", "receiver.mirror:_LEAVES"),
    (BASELINE, "less # because the fix was fitted to these ranges, and less # because",
     "receiver.mirror:_FITTED", "receiver.mirror:_PAST"),
    (BASELINE, "Above # the filter continues there", "receiver.mirror:_TAKES"),
    (BASELINE, "Below $-#$ the other side is given up", "receiver.mirror:_LEAVES"),
    (BASELINE, "Above #, both scores begin again", "receiver.turn:_LIMIT"),
    (RAW, "In each of at most # passes", "receiver.least_squares:PASSES"),
    (RAW, r"$\lambda$ grows by a factor of #.", "receiver.multilateration:_MORE"),
    (RAW, r"It begins with $#$", "receiver.least_squares:FIRST_DAMPING"),
    (RAW, r"$2 \lvert a \rvert \le # \lvert v \rvert$", "receiver.minimum:_BEND"),
    (ARRAY, "The filter then starts # m away", "receiver.start:_UNTIMED"),
    (ALL, "a few passes, at most #:", "receiver.least_squares:PASSES"),
    (ALL, "RMS angle / RMS rate, at most # s", "receiver.variables:SLOWEST_TILT"),
    (ALL, "so that it changes as fast as the Gauss–Markov part $\\sigma_{m}$; # s if there is none",
     "settings.assumptions:_STILL"),
    (ALL, "the walk goes as far in # s as the drift", "settings.assumptions:_DRIFT_MEMORY"),
    (COUPLED, r"\max(1, 2\tau/T_b)$ with $\tau$ of # s", "settings.assumptions:_MOUNTING_MEMORY"),
    ("acoustics/README.md", "The counter of the slot takes # bits", "acoustics.packet:SLOT"),
    ("acoustics/README.md", "the class of the GPS #, and the checksum #.",
     "acoustics.packet:GPS_CLASS", "acoustics.packet:CHECKSUM"),
    ("acoustics/README.md", "Coordinates north and east span # m, those down # m, heading #°",
     "acoustics.packet:HORIZONTAL_SPAN", "acoustics.packet:VERTICAL_SPAN", "acoustics.packet:TURN"),
    ("acoustics/README.md", "and roll and pitch #°, each", "acoustics.packet:TILT_SPAN"),
    ("acoustics/README.md", "A number that is not rounded takes # bits", "acoustics.packet:NUMBER"),
    ("platform/README.md", "The frequencies from # to # peak frequencies",
     "platform.spectrum:LOWEST", "platform.spectrum:HIGHEST"),
    ("platform/README.md", "amplitude of roll, with a period of # s",
     "platform.beaufort:YAW_PERIOD"),
]  # fmt: skip


def value(text: str) -> float:
    """The number of a page: 0.1, 10⁶ or 10^{-4}."""
    if text.startswith("10^"):
        return float(f"1e{text[4:-1]}")
    return 1e6 if text == "10⁶" else float(text.rstrip("."))


def constant(name: str) -> Any:
    module, _, attribute = name.partition(":")
    return getattr(import_module(f"sblcosim.models.{module}"), attribute)


@pytest.mark.parametrize("row", STATED, ids=lambda row: row[2])
def test_a_number_on_a_page_is_that_of_the_sources(row: tuple[str, ...]) -> None:
    page, words, *names = row
    folder, _, file = page.partition("/")
    text = (resources.files(f"sblcosim.models.{folder}") / file).read_text("utf-8")
    text = re.sub(r"<!--.*?-->", "", text)
    found = re.search(re.escape(words).replace(r"\#", NUMBER), text)
    assert found, words
    assert list(map(value, found.groups())) == [constant(name) for name in names]


def test_the_densities_of_motion_are_those_of_both_pages() -> None:
    from sblcosim.models.receiver.bank import CHANCES, PSDS

    assert sum(CHANCES) == 1.0
    chance = dict(zip(PSDS, CHANCES, strict=True))
    for page in (COUPLED, BASELINE):
        file = resources.files("sblcosim.models.receiver") / page.partition("/")[2]
        (said,) = re.findall(r"\$q_j\$ = (.*?) and (\S+) m²/s³", file.read_text("utf-8"))
        stated = [float(it) for it in (*said[0].split(", "), said[1])]
        assert stated == sorted(PSDS)
        (said,) = re.findall(
            r"the chances (?:\$c_j\$ = )?([\d., ]*?) and (\d[\d.]*\d)", file.read_text("utf-8"))
        assert [float(it) for it in (*said[0].split(", "), said[1])] == [chance[q] for q in stated]

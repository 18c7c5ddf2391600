"""Sources of error, each declared once: for the budget, the bound and all texts about them.

A test varies every parameter of our components: whatever makes them random or wrong must be a key
of a source. A key is either in the bound's model or listed as `unmodelled`. Range errors in
``models/acoustics/range_errors`` become sources without being named here.

Levels of better equipment:

GPS, tilt
    The grades ``rtk_fixed`` of `sblcosim.models.platform.gps` and ``tactical`` of
    `sblcosim.models.platform.imu`, with their sources.
heading
    0.5°, for a compass with two GNSS antennas: 0.1° to 1.0°, depending on their distance (u-blox,
    *GNSS Heading*, u-blox.com/en/technologies/gnss-heading).
clock
    0.05 m of sound travel, 33 µs: set by the pulse of a GPS receiver just before the dive. The
    figure is an assumption. The drift from then on is that of the grade ``ocxo`` of
    `sblcosim.models.acoustics.clock`, with its source.
sound speed
    0.2 %, 3 m/s: a thermometer accurate to 1 K at 20 °C (2.7 m/s per kelvin: K. V. Mackenzie, J.
    Acoust. Soc. Am. 70, 1981, 807-812).
range noise
    0.02 m, twice the Cramér-Rao bound c/(2π β √(2E/N₀)) of a time of arrival (S. M. Kay,
    *Fundamentals of Statistical Signal Processing* I, 1993, section 3.11) for β = 5 kHz and 13 dB.
depth sensor
    0.02 m, an assumption.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import hypot

from sblcosim.models import COMPONENTS
from sblcosim.models.acoustics.range_errors import FOUND
from sblcosim.models.settings.presets import preset

FLOOR = 0.01
"""Standard deviation [m] of ranges and depth readings when switched off. A diver moves about as far
while the sound travels. With a smaller value, a receiver trusts its model too much."""
SURVEY = "platform.mounting_std_m"
DELAYS = "acoustics.turnaround_beacon_std_s"
"""Included in the bound for beacons with their own errors, but not in that for a platform."""


@dataclass(frozen=True)
class Part:
    """Keys with the same unit that are switched together.

    Attributes
    ----------
    keys
        Keys with their tables.
    better
        Root sum of squares of the values of better equipment; None: no change.
    off
        The same for equipment without this error.
    about
        Key of the value that counts as no error; empty: 0.
    relative
        Whether `better` is a share of that value.
    unmodelled
        Those of its keys that the bound does not include.
    """

    keys: Sequence[str]
    better: float | None = None
    off: float = 0.0
    about: str = ""
    relative: bool = False
    unmodelled: Sequence[str] = ()

    def __post_init__(self) -> None:
        if unknown := sorted({*self.unmodelled} - {*self.keys}):
            raise ValueError(f"unmodelled: must be keys of the part, got {unknown}")


@dataclass(frozen=True)
class Source:
    """A source of error.

    Attributes
    ----------
    name, words
        Its name in tables, and in sentences.
    better
        Better equipment, in a few words; empty: none can be bought.
    """

    name: str
    words: str
    parts: Sequence[Part]
    better: str = ""


def _keys(table: str, start: str, ends: Iterable[str]) -> tuple[str, ...]:
    return tuple(f"{table}.{start}{end}" for end in ends)


def _grade(name: str, value: str, keys: Iterable[str]) -> float:
    """Root sum of squares of the keys that a grade sets."""
    values = preset(name, value)
    return hypot(*(values.get(key.partition(".")[2], 0.0) for key in keys))


def _gps() -> Iterator[Part]:
    for axis in ("horizontal", "vertical"):
        keys = _keys("platform", f"gps_{axis}_", ("std_m", "bias_std_m", "markov_std_m"))
        yield Part(keys, _grade("gps_grade", "rtk_fixed", keys))
    yield Part(("platform.gps_antenna_offset_m",))


def _imu(axis: str, better: float) -> Iterator[Part]:
    start = f"imu_{axis}_"
    steady = ("std_deg", "bias_deg", "turn_on_std_deg", "markov_std_deg", "step_deg")
    # The heading's step is part of its lasting error, which the bound includes; tilt's is not.
    unmodelled = _keys("platform", start, ("step_deg",) if axis == "tilt" else ())
    yield Part(_keys("platform", start, steady), better, unmodelled=unmodelled)
    for end in ("drift_deg_s", "temperature_coefficient_deg_K", "scale_factor_error"):
        yield _left_out(*_keys("platform", start, (end,)))


def _left_out(*keys: str) -> Part:
    """A part that the bound does not include."""
    return Part(keys, unmodelled=keys)


def _of_ranges() -> Iterator[Source]:
    """Range errors that only their modules declare."""
    for name, it in FOUND.items():
        if name not in ("noise", "outliers"):
            keys = _keys("acoustics", "", it.keys)
            part = Part(keys, unmodelled=() if it.modelled else keys)
            yield Source(name.replace("_", " "), it.words, (part,))


OF_BITS = ("acoustics.packet_resolution_m", "acoustics.packet_angle_resolution_deg")
_AMPLITUDES = ("roll_amplitude_deg", "pitch_amplitude_deg", "yaw_amplitude_deg",
               "surge_amplitude_m", "sway_amplitude_m", "heave_amplitude_m")
_DRIFT = ("acoustics.clock_drift_s_s", "acoustics.clock_drift_std_s_s")
_OF_SPECTRUM = ("wave_height_m", "watch_circle_m")

SOURCES: Mapping[str, Source] = {
    source.name: source
    for source in (
        Source("GPS", "the GPS", tuple(_gps()), "RTK"),
        Source("heading", "the heading", tuple(_imu("heading", 0.5)), "0.5°"),
        Source(
            "tilt", "the tilt",
            tuple(_imu("tilt", _grade("imu_grade", "tactical", ("platform.imu_tilt_bias_deg",)))),
            "tactical",
        ),
        Source(
            "IMU alignment", "the alignment of the IMU",
            (_left_out("platform.imu_misalignment_deg"),),
        ),
        Source(
            "mounting", "where the beacons are mounted",
            (_left_out("platform.mounting_error_m", SURVEY),),
        ),
        Source(
            "misalignment", "the alignment of the beacons' frame",
            tuple(Part((f"platform.misalignment_{it}_std_deg",)) for it in ("tilt", "heading")),
        ),
        Source(
            "clock", "the clock",
            (
                Part(_keys("acoustics", "clock_", ("offset_s", "offset_std_s")), 0.05 / 1500),
                Part(_DRIFT, _grade("clock_grade", "ocxo", _DRIFT)),
                Part(_keys("acoustics", "clock_", ("sync_age_s",)), 0.0),
            ),
            "OCXO set to 0.05 m",
        ),
        Source(
            "turn-around", "the turn-around of beacons that answer",
            (*(Part((f"acoustics.turnaround_{end}_s",)) for end in ("std", "bias_std")),
             _left_out(DELAYS)),
        ),
        Source(
            "processing delay", "the processing delay",
            (Part(
                ("acoustics.processing_delay_s",), about="acoustics.processing_delay_correction_s"
            ),),
        ),
        Source(
            "sound speed", "the sound speed",
            (Part(
                ("acoustics.sound_speed_m_s",), 0.002, about="acoustics.assumed_sound_speed_m_s",
                relative=True,
            ),),
            "0.2 %",
        ),
        Source(
            "range noise", FOUND["noise"].words,
            (Part(("acoustics.range_std_m",), 0.02, FLOOR),), "0.02 m",
        ),
        Source(
            "timing", "the resolution of arrival times",
            (Part(("acoustics.range_resolution_m",)),),
        ),
        Source(
            "ping", "what all arrivals of a ping share",
            (Part(("acoustics.range_common_std_m",)),),
        ),
        Source("outliers", FOUND["outliers"].words, (Part(("acoustics.outlier_probability",)),)),
        Source("packet loss", "packet loss", (Part(("acoustics.loss_probability",)),)),
        Source(
            "shadow", "the shadow of the diver's body",
            (Part(("acoustics.shadow_loss_probability",)),),
        ),
        Source(
            "echoes", "echoes from surface and bottom",
            tuple(Part((f"acoustics.{it}_echo_probability",)) for it in ("surface", "bottom")),
        ),
        Source(
            "rounding", "the rounding of packets",
            tuple(Part((key,)) for key in OF_BITS),
        ),
        Source(
            "depth sensor", "the depth sensor",
            (
                Part(("target.depth_std_m",), 0.02, FLOOR),
                Part(("target.depth_bias_m", "target.depth_bias_std_m"), 0.02),
            ),
            "0.02 m",
        ),
        Source(
            "platform motion", "the platform's motion",
            tuple(Part((f"platform.{key}",)) for key in (*_AMPLITUDES, *_OF_SPECTRUM)),
        ),
        *_of_ranges(),
    )
}
"""Sources by name."""

_UNMODELLED = {key for s in SOURCES.values() for part in s.parts for key in part.unmodelled}
UNMODELLED: Sequence[str] = tuple(
    key
    for table in ("target", "platform", "acoustics")
    for key in (f"{table}.{v.key}" for v in COMPONENTS[table].of("parameter"))
    if key in _UNMODELLED
)
"""Keys of errors that the bound does not include, in the order of their declarations."""

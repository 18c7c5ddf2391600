"""A small dive as a log of each format that can be read."""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Mapping
from functools import reduce
from math import hypot, sin

from sblcosim.tracks.place import Origin

BEACONS = {"B0": (0.0, 0.0, 1.0), "B1": (30.0, 0.0, 1.5), "B2": (0.0, 40.0, 2.0),
           "B3": (35.0, 45.0, 1.0)}  # fmt: skip
START_NS = 1_700_000_000_000_000_000
PINGS = 40
ORIGIN = (36.6, -4.5)
Files = dict[str, str]


def place(k: int) -> tuple[float, float, float]:
    """The diver at ping k."""
    return 10 + 0.3 * k, 12 + 6 * sin(k / 9), 5 + 0.05 * k


def ranges() -> list[tuple[int, str, float]]:
    """Ping, beacon and range of each reception."""
    noise = random.Random("ranges")
    return [
        (k, name, round(hypot(*(p - q for p, q in zip(place(k), at, strict=True)))
                        + noise.gauss(0, 0.1), 4))
        for k in range(PINGS) for name, at in BEACONS.items()
    ]


def time_ns(k: int) -> int:
    """The time of ping k."""
    return START_NS + k * 500_000_000


def own() -> Files:
    """The project's own format."""
    heard = ["arrival_ns,epoch_ns,beacon,range_m,valid"]
    heard += [f"{arrival},{time_ns(k)},{b},{r},true" for arrival, k, b, r in sorted(
        (time_ns(k) + round(r / 1500 * 1e9), k, b, r) for k, b, r in ranges())]
    depth = ["time_ns,depth_m", *(f"{time_ns(k)},{place(k)[2]:.3f}" for k in range(PINGS))]
    truth = ["time_ns,n_m,e_m,d_m", *(
        f"{time_ns(k)},{','.join(f'{x:.3f}' for x in place(k))}" for k in range(PINGS))]
    fixes = ["time_ns,device,n_m,e_m,d_m,std_m", *(
        f"{time_ns(k)},usbl,{','.join(f'{x + 0.4:.3f}' for x in place(k))},0.5"
        for k in range(PINGS))]
    meta = ["dimension = 3", "sound_speed_m_s = 1500.0", "[beacons]"]
    meta += [f"{name} = {list(at)}" for name, at in BEACONS.items()]
    meta += ["[origin]", f"latitude_deg = {ORIGIN[0]}", f"longitude_deg = {ORIGIN[1]}"]
    tables = {"receptions.csv": heard, "depth.csv": depth, "truth.csv": truth,
              "fixes.csv": fixes, "meta.toml": meta}  # fmt: skip
    return {name: "\n".join(lines) + "\n" for name, lines in tables.items()}


def long() -> Files:
    """A row for each range, in seconds and in axes of its own."""
    rows = ["t;name;d;x;y;z"]
    rows += [f"{k / 2};{b};{r};{BEACONS[b][1]};{BEACONS[b][0]};{-BEACONS[b][2]}"
             for k, b, r in ranges()]
    depths = ["t;depth", *(f"{k / 2};{place(k)[2]:.3f}" for k in range(PINGS))]
    mapping = """
[mapping]
axes = "enu"
[mapping.receptions]
file = "ranges.csv"
time_s = "t"
beacon = "name"
range_m = "d"
reported = ["x", "y", "z"]
[mapping.depth]
file = "depths.csv"
time_s = "t"
depth_m = "depth"
"""
    return {"ranges.csv": "\n".join(rows) + "\n", "depths.csv": "\n".join(depths) + "\n",
            "meta.toml": mapping}  # fmt: skip


def wide() -> Files:
    """A row for each ping, with a column for each beacon."""
    by_ping = {(k, b): r for k, b, r in ranges()}
    rows = ["when,a,b,c,d,depth"]
    rows += [f"2024-05-01T10:{k // 60:02}:{k % 60:02}Z,"
             f"{','.join(str(by_ping[k, b]) for b in BEACONS)},{place(k)[2]:.3f}"
             for k in range(PINGS)]
    mapping = """
[beacons]
B0 = [0.0, 0.0, 1.0]
B1 = [30.0, 0.0, 1.5]
B2 = [0.0, 40.0, 2.0]
B3 = [35.0, 45.0, 1.0]
[mapping.receptions]
file = "wide.csv"
time = "when"
range_m = { B0 = "a", B1 = "b", B2 = "c", B3 = "d" }
[mapping.depth]
file = "wide.csv"
time = "when"
depth_m = "depth"
"""
    return {"wide.csv": "\n".join(rows) + "\n", "meta.toml": mapping}


def polls(receivers: bool = True) -> list[dict[str, object]]:
    """Answers of the Water Linked API."""
    found: list[dict[str, object]] = []
    if receivers:
        body = [{"id": i, "x": at[0], "y": at[1], "z": at[2]}
                for i, at in enumerate(BEACONS.values())]  # fmt: skip
        found.append({"time_ns": START_NS, "path": "/api/v1/config/receivers", "body": body})
    by_ping = {(k, b): r for k, b, r in ranges()}
    for k in range(PINGS):
        x, y, z = place(k) if k >= 4 else (0.0, 0.0, 0.0)
        found.append({"time_ns": time_ns(k), "path": "/api/v1/position/acoustic/raw", "body": {
            "position_valid": k >= 4, "x": x, "y": y, "z": z, "std": 0.4,
            "receiver_distance": [by_ping[k, b] if k != 7 or b != "B2" else -1 for b in BEACONS],
            "receiver_valid": [1, 1, 1, 0 if k == 9 else 1],
        }})  # fmt: skip
        if k % 10 == 5:  # polled again before the next ping
            found.append({**found[-1], "time_ns": time_ns(k) + 100_000_000})
        latitude, longitude, _ = Origin(*ORIGIN).geographic(_rows(place(k)))[0].tolist()
        found.append({"time_ns": time_ns(k) + 1_000_000, "path": "/api/v1/position/global",
                      "body": {"lat": latitude, "lon": longitude, "fix_quality": 1}})
    return found


def _rows(position: tuple[float, ...]) -> object:
    import numpy as np

    return np.array([position])


def capture() -> Files:
    """An object on each line."""
    return {"dive.jsonl": "".join(json.dumps(it) + "\n" for it in polls())}


def array() -> Files:
    """All objects in an array, over several lines."""
    return {"dive.json": json.dumps(polls(), indent=1) + "\n"}


def sentence(body: str) -> str:
    """A sentence with its checksum."""
    return f"${body}*{reduce(lambda seal, c: seal ^ ord(c), body, 0):02X}"


def clock(k: int) -> str:
    """Time of the day at ping k, as in sentences."""
    return f"10{k // 60:02}{k % 60:02}.50"


def _degrees(value: float, digits: int) -> str:
    whole = int(abs(value))
    return f"{whole:0{digits}}{(abs(value) - whole) * 60:09.6f}"


def gga(k: int, latitude: float, longitude: float, height: float = 0.0) -> str:
    """A position."""
    sides = "NS"[latitude < 0], "EW"[longitude < 0]
    return sentence(
        f"GPGGA,{clock(k)},{_degrees(latitude, 2)},{sides[0]},{_degrees(longitude, 3)},{sides[1]},"
        f"1,09,0.9,{height},M,,M,,"
    )


def nmea() -> Files:
    """A platform with GPS and compass, and an ultra-short baseline."""
    lines = [sentence("GPZDA,100000.00,01,05,2024,00,00")]
    for k in range(PINGS):
        lines += [gga(k, *ORIGIN), sentence("HEHDT,90.0,T")]
        north, east, down = place(k)
        lines.append(sentence(
            f"PSIMSSB,{clock(k)},B01,A,,C,H,M,{-north:.2f},{east:.2f},{down:.2f},0.50,N,,"
        ))  # fmt: skip
    return {"dive.nmea": "\r\n".join(lines) + "\r\n"}


def modem() -> Files:
    """An EvoLogics modem and a Cerulean locator, with times of the logger."""
    lines = []
    for k in range(PINGS):
        north, east, down = place(k)
        stamp = f"{time_ns(k) / 1e9:.3f}"
        lines.append(
            f"{stamp} USBLLONG,{100 + k / 2},{99.9 + k / 2},2,1,2,3,{east:.3f},{north:.3f},"
            f"{-down:.3f},0,0,0,9000,-30,150,0.3"
        )
        lines.append(f"{stamp} " + sentence(
            "USRTH,10.0,80.0,-20.0,25.5,10.0,80.0,-20.0,0.1,0.2,0.3,90.0,40,T,F,153,CIMU,A,-2,-2"
        ))
        lines.append(f"{stamp} " + sentence(
            f"RATLL,1,3636.{k:04},N,00430.0,W,ROV,{clock(k)},T"
        ))
    return {"modem.log": "\n".join(lines) + "\n"}


def excerpt() -> Files:
    """Polled positions as tables."""
    acoustic, earth = ["time_ns,x_m,y_m,z_m"], ["time_ns,latitude_deg,longitude_deg"]
    for k in range(PINGS):
        x, y, z = place(k - k % 2) if k >= 4 else (0, 0, 0)
        acoustic.append(f"{time_ns(k)},{x},{y},{z}")
        latitude, longitude, _ = Origin(*ORIGIN).geographic(_rows(place(k - k % 2)))[0].tolist()
        earth.append(f"{time_ns(k)},{latitude},{longitude}")
    return {"acoustic.csv": "\n".join(acoustic) + "\n", "global.csv": "\n".join(earth) + "\n"}


SAMPLES: Mapping[str, tuple[Callable[[], Files], str]] = {
    "own": (own, ""),
    "long": (long, ""),
    "wide": (wide, ""),
    "capture": (capture, "dive.jsonl"),
    "array": (array, "dive.json"),
    "nmea": (nmea, "dive.nmea"),
    "modem": (modem, "modem.log"),
    "excerpt": (excerpt, ""),
}
"""What makes the files of each, and the one that is read; empty: their folder."""

"""The Parquet files in a result folder: the parts, and the whole table made from them.

The name of a part ends with the SHA-256 of the file, so each is verified once before it is used, in
parallel. The folder's description holds the SHA-256 of the whole table, with the names of the parts
in it. As long as these are unchanged, the table is read instead of them. Rows stay in columns; no
row becomes a Python object.
"""

from __future__ import annotations

import hashlib
import json
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import parquet
from sblcosim.fmus import files

from ..errors import ConfigurationError, one_line
from .campaign import Campaign, CampaignRun

RUNS = "runs.parquet"
PARTS = "parts"
GROUP = 2**16
"""Number of rows in memory at a time when the whole table is written."""
AT_ONCE = 16
"""Number of parts in memory at that time."""
SAMPLE = 2048
"""Number of rows that show whether the values of a column repeat themselves."""
_Item = TypeVar("_Item")
_KEYS = ("run_id", "replicate", "point")
_CAMPAIGN = b"sblcosim.campaign"
"""Entry of a file's metadata: the `Campaign.digest` of its runs."""

Wanted = Callable[[Sequence[str]], Collection[str]]
"""Selects the columns to read from the names of all columns."""


@dataclass(frozen=True)
class Parts:
    """The unchanged parts of a folder.

    Attributes
    ----------
    paths
        Paths of the parts, by name.
    in_table
        Names of the parts in `RUNS`; empty if that has changed, or has others.
    """

    folder: Path
    paths: tuple[Path, ...]
    in_table: frozenset[str]

    @property
    def sources(self) -> list[Path]:
        """The files to read: they hold all rows, those of a part once."""
        rest = [path for path in self.paths if path.name not in self.in_table]
        return [self.folder / RUNS, *rest] if self.in_table else rest

    @property
    def is_table(self) -> bool:
        """Whether all rows are in `RUNS`, which holds them in order, each run once."""
        return self.sources == [self.folder / RUNS]

    def added(self, paths: Iterable[Path]) -> Parts:
        """A copy with further parts."""
        return replace(self, paths=tuple(sorted({*self.paths, *paths})))


def looked_through(folder: Path, table: Mapping[str, Any]) -> tuple[Parts, list[Path]]:
    """The unchanged parts of a folder, and the others.

    Parameters
    ----------
    table
        Entry for `RUNS` in the folder's description: its ``sha256`` and its ``parts``.
    """
    paths = sorted(p for p in (folder / PARTS).glob("*.parquet") if not p.name.startswith("."))
    with ThreadPoolExecutor() as pool:
        sound = dict(zip(paths, pool.map(is_intact, paths), strict=True))
    good = tuple(path for path in paths if sound[path])
    damaged = [path for path in paths if not sound[path] and path.exists()]
    inside = frozenset(table.get("parts", ()))
    stands = inside <= {path.name for path in good} and _is_as(folder / RUNS, table.get("sha256"))
    return Parts(folder, good, inside if stands else frozenset()), damaged


def _is_as(path: Path, sha256: str | None) -> bool:
    """Whether a file has a hash; False if it cannot be read."""
    try:
        return sha256 is not None and _sha256(path) == sha256
    except ConfigurationError:
        return False


def is_intact(path: Path) -> bool:
    """Whether a part has the hash in its name; False if another process has removed it."""
    return path.stem.rpartition("-")[2] == _sha256(path)[:32]


def _sha256(path: Path) -> str:
    """Hash of a file; empty if there is none."""
    try:
        with files.regular(path).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except FileNotFoundError:
        return ""
    except OSError as error:
        raise _unreadable(path, error) from None


def _unreadable(path: Path, error: Exception) -> ConfigurationError:
    return ConfigurationError(
        f"{path}: must be a readable Parquet file, got {one_line(error)}"
    )


# --- Reading -------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Finished:
    """The finished runs of a folder, in no particular order; all arrays have the shape (rows,).

    Attributes
    ----------
    run_id
        Run ids as whole numbers, written in hexadecimal elsewhere.
    campaign
        Index in `campaigns` of the campaign that made the run.
    campaigns
        Their `Campaign.digest`; empty where it is unknown.
    """

    point: NDArray[np.int64]
    replicate: NDArray[np.int64]
    run_id: NDArray[np.uint64]
    campaign: NDArray[np.intp]
    campaigns: tuple[str, ...]

    def __len__(self) -> int:
        """Number of runs; duplicates count once."""
        return int((~_again(self.run_id)).sum())

    def strangers(self, campaign: Campaign) -> NDArray[np.intp]:
        """Rows that are not runs of a campaign."""
        same = np.array([digest == campaign.digest for digest in self.campaigns], bool)
        point = self.point - 1
        inside = (point >= 0) & (point < len(campaign.points)) & (self.replicate > 0)
        # A part that names this campaign was written with it: its hashes are right.
        unknown = np.flatnonzero(inside & ~same[self.campaign])
        seeds = campaign.study.run_seed
        for row in unknown:
            place, number = int(point[row]), int(self.replicate[row])
            own = campaign.points[place].run_id(seeds(place + 1, number))
            inside[row] = int(own, 16) == int(self.run_id[row])
        return np.flatnonzero(~inside)


def finished(parts: Parts) -> Finished:
    """The runs in a folder."""
    tables = [_columns(path, _keys) for path in parts.sources]  # too little work for threads
    origins = [(table.schema.metadata or {}).get(_CAMPAIGN, b"").decode() for table in tables]
    campaigns = tuple(dict.fromkeys(origins))
    numbers = np.array([campaigns.index(origin) for origin in origins], np.intp)
    whole = _joined(tables) if tables else None
    return Finished(
        _integers(whole, "point"),
        _integers(whole, "replicate"),
        np.empty(0, np.uint64) if whole is None else _run_ids(whole),
        np.repeat(numbers, [len(table) for table in tables]),
        campaigns,
    )


def table(parts: Parts, wanted: Wanted | None = None) -> pd.DataFrame:
    """All runs, each once, by replicate and point; there must be at least one part.

    Parameters
    ----------
    wanted
        Selects the columns to read.
    """
    if wanted is None or parts.is_table:
        arrow = _joined(_read(parts, wanted))
        arrow = arrow if parts.is_table else _ordered(arrow)
    else:
        chosen = wanted(_opened(parts.sources[0]).schema_arrow.names)
        arrow = _ordered(_joined(_read(parts, lambda names: {*_KEYS, *chosen})))
        arrow = arrow.select([name for name in arrow.column_names if name in chosen])
    # Nullable type: a missing flag must not become False.
    flags = {pa.bool_(): pd.BooleanDtype()}.get
    made: pd.DataFrame = arrow.to_pandas(types_mapper=flags)
    known = [c for c in made if made[c].dtype == "boolean" and made[c].notna().all()]
    return made.astype(dict.fromkeys(known, bool))


def _keys(names: Sequence[str]) -> Collection[str]:
    return _KEYS


def _read(parts: Parts, wanted: Wanted | None = None) -> list[pa.Table]:
    with ThreadPoolExecutor() as pool:
        return list(pool.map(partial(_columns, wanted=wanted), parts.sources))


def _columns(path: Path, wanted: Wanted | None = None) -> pa.Table:
    file = _opened(path)
    names = None
    if wanted is not None:
        chosen = wanted(file.schema_arrow.names)
        names = [name for name in file.schema_arrow.names if name in chosen]
    try:
        # The parts are read side by side; the table of all runs is read alone.
        return file.read(names, use_threads=path.name == RUNS)
    except (OSError, pa.ArrowInvalid) as error:
        raise _unreadable(path, error) from None


def _opened(path: Path) -> parquet.ParquetFile:
    try:
        file = parquet.ParquetFile(files.regular(path))
        json.loads((file.schema_arrow.metadata or {}).get(b"pandas", b"{}"))
    except (OSError, ValueError, pa.ArrowException) as error:
        raise _unreadable(path, error) from None
    for name in _KEYS:
        if name not in file.schema_arrow.names:
            raise ConfigurationError(f"{path}: must have a column {name}, got none")
    return file


def _joined(tables: Sequence[pa.Table]) -> pa.Table:
    whole: pa.Table = pa.concat_tables(tables, promote_options="permissive")
    return whole


def _integers(arrow: pa.Table | None, name: str) -> NDArray[np.int64]:
    if arrow is None:
        return np.empty(0, np.int64)
    numbers: NDArray[np.int64] = arrow[name].to_numpy().astype(np.int64, copy=False)
    return numbers


def _run_ids(arrow: pa.Table) -> NDArray[np.uint64]:
    """The run ids as whole numbers."""
    packed = [np.empty(0, ">u8")]
    try:
        for chunk in arrow["run_id"].cast(pa.binary()).cast(pa.binary(16)).chunks:
            _, digits = chunk.buffers()
            given = digits.slice(16 * chunk.offset, 16 * len(chunk)).to_pybytes().decode("ascii")
            packed.append(np.frombuffer(bytes.fromhex(given), ">u8"))
    except ValueError:  # includes pa.ArrowInvalid
        raise ConfigurationError(
            "run_id: must be 16 hexadecimal digits in all parts, got others"
        ) from None
    return np.concatenate(packed).astype(np.uint64)


def _again(run_ids: NDArray[np.uint64]) -> NDArray[np.bool_]:
    """Which runs have appeared before."""
    return pd.Index(run_ids).duplicated()


def _order(arrow: pa.Table) -> NDArray[np.intp] | None:
    """The rows by replicate and point, each run once; None if they already are."""
    replicate, point = _integers(arrow, "replicate"), _integers(arrow, "point")
    again = _again(_run_ids(arrow))
    later = np.diff(replicate)
    if not again.any() and ((later > 0) | ((later == 0) & (np.diff(point) > 0))).all():
        return None
    rows = np.flatnonzero(~again)
    return rows[np.lexsort((point[rows], replicate[rows]))]


def _ordered(arrow: pa.Table) -> pa.Table:
    order = _order(arrow)
    return arrow if order is None else arrow.take(order)


# --- Writing -------------------------------------------------------------------------------------


def write(
    folder: Path, campaign: Campaign, runs: Sequence[CampaignRun], made: pd.DataFrame
) -> Path:
    """Store some runs as a part, which appears when it is complete."""
    ids = hashlib.sha256(" ".join(r.run_id for r in runs).encode()).hexdigest()[:16]
    arrow = pa.Table.from_pandas(made, preserve_index=False)
    for name in ("error", "run_id"):
        index = arrow.schema.get_field_index(name)
        arrow = arrow.set_column(index, name, arrow[name].cast(pa.string()))
    arrow = arrow.replace_schema_metadata({_CAMPAIGN: campaign.digest})
    stream = pa.BufferOutputStream()
    parquet.write_table(arrow, stream, use_dictionary=_repeating(arrow))
    content: bytes = stream.getvalue().to_pybytes()
    path = folder / PARTS / named(f"{runs[0].replicate:06d}-{ids}", content)
    # The hash in its name reveals an incomplete file, so do not wait for the disk.
    write_file(path, content, durable=False)
    return path


def named(runs: str, content: bytes) -> str:
    """Name of a part: its runs, and the hash of the file."""
    return f"{runs}-{hashlib.sha256(content).hexdigest()[:32]}.parquet"


def save(parts: Parts) -> dict[str, Any]:
    """Write the table of all runs; returns its entry for the folder's description."""
    path = parts.folder / RUNS
    try:
        with files.unfinished(parts.folder) as hidden:
            _write_table(parts, hidden)
            with ThreadPoolExecutor() as pool:
                synced = pool.submit(files.sync_file, hidden)
                digest = _sha256(hidden)
                synced.result()
            hidden.replace(path)
    except OSError as error:
        raise refusal(path, error) from None
    return {"sha256": digest, "parts": [part.name for part in parts.paths]}


def _write_table(parts: Parts, path: Path) -> None:
    """Write all rows in order; the bytes do not depend on the parts."""
    try:
        _write_pieces(_pieces(parts), _opened(parts.sources[0]).schema_arrow, path)
    except _UnlikeError:
        schema = _common(_opened(source).schema_arrow for source in parts.sources)
        ordered = _order(_joined(_read(parts, _keys))) is None
        pieces = _pieces(parts) if ordered else [_ordered(_joined(_read(parts)))]
        _write_pieces((_fitted(piece, schema) for piece in pieces), schema, path)


class _UnlikeError(Exception):
    """Pieces from several versions, or out of order; each run once."""


def _common(schemas: Iterable[pa.Schema]) -> pa.Schema:
    """A schema that fits the rows of all files."""
    found = list(schemas)
    schema = pa.unify_schemas(
        [one.remove_metadata() for one in found], promote_options="permissive"
    )
    origins = {(one.metadata or {}).get(_CAMPAIGN, b"") for one in found}
    if len(origins) == 1 and origins != {b""}:
        schema = schema.with_metadata({_CAMPAIGN: origins.pop()})
    return schema


def _fitted(piece: pa.Table, schema: pa.Schema) -> pa.Table:
    return _joined([schema.empty_table(), piece.replace_schema_metadata(schema.metadata)])


def _write_pieces(pieces: Iterable[pa.Table], schema: pa.Schema, path: Path) -> None:
    """Write the rows of some pieces; `_UnlikeError` may end this half-way."""
    groups = _groups(pieces, schema)
    group = next(groups)
    repeating = _repeating(group)
    last = group.slice(0, 0).select(_KEYS)
    # Values that do not repeat themselves are noise, which cannot be compressed.
    packing = {name: "snappy" if name in repeating else "none" for name in schema.names}
    with parquet.ParquetWriter(
        path, schema, use_dictionary=repeating, compression=packing
    ) as writer:
        while group:
            keys = pa.concat_tables([last, group.select(_KEYS)])
            if _order(keys) is not None:
                raise _UnlikeError
            writer.write_table(group, GROUP)
            last, group = keys.slice(len(keys) - 1), None  # the next one needs its memory
            group = next(groups, None)


def _pieces(parts: Parts) -> Iterator[pa.Table]:
    """All rows as stored, a few at a time."""
    sources = parts.sources
    if parts.in_table:
        numbers = range(_opened(sources[0]).num_row_groups)
        yield from _ahead(partial(_row_group, sources.pop(0)), numbers, 1)
    yield from _ahead(_columns, sources, AT_ONCE)


def _row_group(path: Path, number: int) -> pa.Table:
    return _opened(path).read_row_group(number)


def _ahead(
    read: Callable[[_Item], pa.Table], items: Iterable[_Item], count: int
) -> Iterator[pa.Table]:
    """Items read one by one, with the next ones read in the background."""
    rest = iter(items)
    with ThreadPoolExecutor(1) as pool:  # more would wait for each other, and for the writing
        under_way = deque(pool.submit(read, item) for item in islice(rest, count))
        while under_way:
            made = under_way.popleft().result()
            under_way.extend(pool.submit(read, item) for item in islice(rest, 1))
            yield made


def _groups(pieces: Iterable[pa.Table], schema: pa.Schema) -> Iterator[pa.Table]:
    """The same rows, `GROUP` at a time, so that their bytes do not depend on the pieces."""
    some: list[pa.Table] = []
    for piece in pieces:
        if not piece.schema.equals(schema, check_metadata=True):
            raise _UnlikeError
        some.append(piece)
        if sum(map(len, some)) >= GROUP:
            rest = pa.concat_tables(some)
            while len(rest) >= GROUP:
                yield rest.slice(0, GROUP).combine_chunks()
                rest = rest.slice(GROUP)
            some = [rest]
    if rest := pa.concat_tables(some):
        yield rest.combine_chunks()


def _repeating(arrow: pa.Table) -> list[str]:
    """Columns whose values repeat themselves, which a dictionary compresses."""
    seen = arrow.slice(0, SAMPLE)
    return [name for name in seen.column_names if 2 * len(seen[name].unique()) <= len(seen)]


def write_file(path: Path, content: bytes, durable: bool = True) -> None:
    """Write a file of the folder.

    Raises
    ------
    ConfigurationError
        It cannot be written.
    """
    try:
        files.write_file(path, content, durable=durable)
    except OSError as error:
        raise refusal(path, error) from None


def refusal(path: Path, error: OSError) -> ConfigurationError:
    """Message about a file or folder that cannot be written."""
    return ConfigurationError(
        f"{path}: must be writable, got {error.strerror or error}; finished runs are kept"
    )

"""What runs know an FMU of ours by: the SHA-256 of it without what says nothing of its numbers.

Its copyright, and terminals that name no port of a receiver, are for people and other tools. An FMU
holds that SHA-256 in a file, so that finished runs stay valid when such things are added. The file
counts as long as all others are as they were: it has their sizes and checksums.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from zlib import crc32

KNOWN_AS = "extra/org.sblcosim/known_as.json"
"""Name of the file in an FMU."""
LONGEST = 1000
"""Bytes of the file, at most."""


def note(plain: bytes, files: Mapping[str, bytes]) -> bytes:
    """The content of the file.

    Parameters
    ----------
    plain
        The FMU without what does not count.
    files
        Its other files, by their names.
    """
    facts = {name: (len(content), crc32(content)) for name, content in files.items()}
    said = {"sha256": hashlib.sha256(plain).hexdigest(), "files": _digest(facts)}
    return json.dumps(said).encode()


def noted(content: bytes, facts: Mapping[str, tuple[int, int]]) -> str | None:
    """The SHA-256 that a file says; None if it is none of ours, or others have been changed.

    Parameters
    ----------
    facts
        Sizes and checksums (CRC-32) of the other files, by their names.
    """
    try:
        said = json.loads(content)
        sha256, files = said["sha256"], said["files"]
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    known = isinstance(sha256, str) and re.fullmatch(r"[0-9a-f]{64}", sha256) is not None
    return sha256 if known and files == _digest(facts) else None


def _digest(facts: Mapping[str, tuple[int, int]]) -> str:
    listed = sorted((name, *fact) for name, fact in facts.items())
    return hashlib.sha256(json.dumps(listed).encode()).hexdigest()

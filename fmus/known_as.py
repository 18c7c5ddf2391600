"""Identity of our FMUs in runs: their SHA-256 without the parts that do not affect numbers.

Its copyright, and terminals that name no port of a receiver, are for people and other tools. An FMU
holds that SHA-256 in a file, so that finished runs stay valid when such parts are added. The file
is valid as long as all other files are unchanged: it holds their sizes and checksums.
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
"""Maximum size of the file in bytes."""


def note(plain: bytes, files: Mapping[str, bytes]) -> bytes:
    """The content of the file.

    Parameters
    ----------
    plain
        The FMU without the parts that do not count.
    files
        Its other files, by their names.
    """
    facts = {name: (len(content), crc32(content)) for name, content in files.items()}
    said = {"sha256": hashlib.sha256(plain).hexdigest(), "files": _digest(facts)}
    return json.dumps(said).encode()


def noted(content: bytes, facts: Mapping[str, tuple[int, int]]) -> str | None:
    """The SHA-256 stated by the file; None if it is not ours, or other files have changed.

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

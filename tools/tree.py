"""A copy of a tree to work on, without what git ignores."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[1]


def copy(root: Path, to: Path) -> None:
    """Copy the files that git tracks, and new ones that it does not ignore, as they are now.

    Without a repository, all files are copied.
    """
    if not (root / ".git").exists():
        shutil.copytree(root, to, ignore=shutil.ignore_patterns("__pycache__", ".*_cache"))
        return
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True)
    for name in filter(None, done.stdout.split("\0")):
        if (root / name).is_file():  # and was not deleted
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(root / name, to / name)

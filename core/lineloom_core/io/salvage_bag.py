"""What can be read of a damaged recording of any kind, also of a folder that lost its metadata."""

from __future__ import annotations

import sqlite3
from dataclasses import replace
from pathlib import Path

from lineloom_core.io.salvage import Salvaged, salvage_sqlite
from lineloom_core.io.salvage_mcap import salvage_mcap
from lineloom_core.io.salvage_rosbag1 import salvage_rosbag1

_READERS = {".bag": salvage_rosbag1, ".mcap": salvage_mcap, ".db3": salvage_sqlite}


def parts_of(path: Path) -> list[Path]:
    """Return the files of a recording, in order: itself, or those of a folder."""
    if not path.is_dir():
        return [path] if path.suffix.lower() in _READERS else []
    return sorted(file for file in path.iterdir() if file.suffix.lower() in _READERS)


def salvaged(path: Path) -> Salvaged:
    """Read what there is. Raises ValueError where nothing can be read at all."""
    whole = Salvaged()
    for part in parts_of(path):
        if part.stat().st_size == 0:
            whole.lost = f"{part.name} is empty"
            continue
        try:
            found = _READERS[part.suffix.lower()](part)
        except (ValueError, sqlite3.Error) as error:
            whole.lost = f"{part.name}: {error}"
            continue
        # Each file numbers its topics by itself.
        offset = 1 + max((channel.id for channel in whole.connections), default=0)
        moved = {c.id: replace(c, id=c.id + offset) for c in found.connections}
        whole.connections += moved.values()
        whole.read += [(moved[channel.id], time, raw) for channel, time, raw in found.read]
        whole.lost = found.lost or whole.lost
    if not whole.read:
        raise ValueError(whole.lost or "it holds no messages")
    return whole

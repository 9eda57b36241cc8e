"""Bytes that run code where somebody unpickles them, and mappers to try them on."""

from __future__ import annotations

import gc
import pickle
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from lineloom_core.mapping.changes import Changes
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.mapping.snapshot import Snapshot
from lineloom_core.scan import Scan

from tests.service.fake_mapper import FakeMapper


class _Bomb:
    def __init__(self, fuse: Path) -> None:
        self._fuse = fuse

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return Path.touch, (self._fuse,)


def bomb(fuse: Path) -> bytes:
    """A pickle that makes the file `fuse` when it is read."""
    return pickle.dumps(_Bomb(fuse))


class ShortChapters:
    """Makes the real mapper, with chapters of four keyframes."""

    def __call__(self, config: MapperConfig) -> SiteMapper:
        return SiteMapper(replace(config, chapter=4))

    def resume(self, snapshot: Snapshot) -> SiteMapper:
        return SiteMapper.resume(snapshot)


SHORT_CHAPTERS = ShortChapters()


class Rogue(FakeMapper):
    """Sends the service a bomb at the first scan of a session that is named as the fuse."""

    def add(self, robot: str, scan: Scan) -> Changes:
        fuse = Path(scan.session)
        if fuse.is_absolute() and not fuse.with_suffix(".sent").exists():
            fuse.with_suffix(".sent").touch()
            for pipe in _pipes():
                pipe.send_bytes(bomb(fuse))
        return super().add(robot, scan)


def _pipes() -> list[Connection[Any, Any]]:
    return [found for found in gc.get_objects() if isinstance(found, Connection)]

"""Beliefs as bytes, without what the history and the memory hold anyway.

A keyframe is written as its number. One that the map links to another predecessor than tracking
did, because those in between were let go, is written as its number and that step.
"""

from __future__ import annotations

import io
import pickle
from dataclasses import replace
from typing import Any

from lineloom_core.mapping.belief.memory import Memory
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.facts.history import History
from lineloom_core.mapping.facts.keyframe import Keyframe


def dumps(beliefs: Any, memory: Memory, config: MapperConfig) -> bytes:
    """Return an object as bytes that need its history, memory and config to be read."""
    file = io.BytesIO()
    _Writer(file, {id(memory): "memory", id(config): "config"}).dump(beliefs)
    return file.getvalue()


def loads(data: bytes, history: History, memory: Memory, config: MapperConfig) -> Any:
    """Return what was written."""
    return _Reader(io.BytesIO(data), history, {"memory": memory, "config": config}).load()


class _Writer(pickle.Pickler):
    def __init__(self, file: io.BytesIO, named: dict[int, str]) -> None:
        super().__init__(file, protocol=5)
        self._named = named

    def persistent_id(self, obj: Any) -> Any:
        if not isinstance(obj, Keyframe):
            return self._named.get(id(obj))
        return (obj.id, obj.step) if obj.joined else obj.id


class _Reader(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, history: History, named: dict[str, Any]) -> None:
        super().__init__(file)
        self._history, self._named = history, named

    def persistent_load(self, pid: Any) -> Any:
        if isinstance(pid, str):
            return self._named[pid]
        if isinstance(pid, int):
            return self._history[pid]
        keyframe, step = pid
        return replace(self._history[keyframe], step=step, joined=True)

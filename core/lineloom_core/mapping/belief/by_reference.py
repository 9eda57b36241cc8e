"""Beliefs as bytes, without what the history and the memory hold anyway.

A keyframe is written as its number. One that the map links to another predecessor than tracking
did, because those in between were let go, is written as its number and that step.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from lineloom_core.codec import decode, encode
from lineloom_core.mapping.belief.memory import Memory
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.facts.history import History
from lineloom_core.mapping.facts.keyframe import Keyframe, Step


def dumps(beliefs: object) -> bytes:
    """Return an object as bytes that need its history, memory and config to be read."""
    return encode(beliefs, {Keyframe: _name, Memory: _the_one, MapperConfig: _the_one})


def loads(
    data: bytes, expected: object, history: History, memory: Memory, config: MapperConfig
) -> Any:
    """Return what was written, an `expected` (an annotation).

    Raises CodecError for anything else, or where the history has no such keyframes.
    """

    def keyframe(name: Any) -> Keyframe:
        if isinstance(name, int):
            return history[name]
        number, step = name
        if not isinstance(step, Step):
            raise TypeError(f"step of keyframe {number} is a {type(step).__name__}")
        return replace(history[number], step=step, joined=True)

    found = {Keyframe: keyframe, Memory: lambda _: memory, MapperConfig: lambda _: config}
    return decode(data, expected, found)


def _name(keyframe: Keyframe) -> object:
    return (keyframe.id, keyframe.step) if keyframe.joined else keyframe.id


def _the_one(_: object) -> None:
    return None

"""Objects to bytes. The packer, in C, walks what is plain and asks here for all else."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Any

import msgpack
import numpy as np

from lineloom_core.codec import wire
from lineloom_core.codec.errors import CodecError
from lineloom_core.codec.registry import BY_CLASS, Entry

Namers = Mapping[Any, Callable[[Any], object]]
"""By class, what its objects are called where they are not written but known to the reader."""

_TAGS = {
    kind: msgpack.ExtType(code, b"")
    for kind, code in (
        (tuple, wire.TUPLE),
        (set, wire.SET),
        (frozenset, wire.FROZEN_SET),
        (deque, wire.DEQUE),
    )
}
_DEPTH_TOLD = 20


def encode(value: object, outside: Namers | None = None) -> bytes:
    """Return a value as bytes, always the same ones. Raises CodecError for what is not storable.

    Arrays that are one object are one again when read, and so are objects of classes that are
    `shared`. What contains itself can not be read.
    """
    try:
        return _Writer(outside or {}).write(value)
    except (ValueError, OverflowError, TypeError, RecursionError) as error:
        raise CodecError(f"{_where(value, outside or {})}{error}") from error


class _Writer:
    """One message. What was numbered is held: its address must not become another's."""

    def __init__(self, outside: Namers) -> None:
        self._outside = outside
        self._tags: dict[type, Any] = {}
        self._arrays: dict[int, tuple[Any, object]] = {}
        self._objects: dict[int, tuple[Any, object]] = {}

    def write(self, value: object) -> bytes:
        body: bytes = _packer(self._plain).pack(value)
        return b"\x92" + _table(tuple(self._tags)) + body

    def _plain(self, value: Any) -> Any:
        """What stands for a value that msgpack does not know."""
        kind = type(value)
        entry = BY_CLASS.get(kind)
        if entry is not None:
            return self._object(value, entry)
        if kind is tuple:
            return [_TAGS[tuple], *value]
        if kind is np.ndarray:
            return self._array(value)
        if kind is frozenset or kind is set:
            return [_TAGS[kind], *_in_order(value)]
        if kind is deque:
            return [_TAGS[deque], value.maxlen, *value]
        if isinstance(value, np.generic):
            return msgpack.ExtType(wire.SCALAR, wire.pack_array(np.asarray(value)))
        if kind is int and value.bit_length() < 8 * wire.MOST_INTEGER_BYTES:
            size = value.bit_length() // 8 + 1
            return msgpack.ExtType(wire.BIG_INTEGER, value.to_bytes(size, "little", signed=True))
        raise CodecError(f"{kind.__module__}.{kind.__qualname__} is not storable")

    def _object(self, value: Any, entry: Entry) -> Any:
        namer = self._outside.get(entry.cls)
        tag = self._tags.get(entry.cls)
        if tag is None:
            code = wire.OBJECT if namer is None else wire.OUTSIDE
            tag = self._tags[entry.cls] = msgpack.ExtType(code, bytes((len(self._tags),)))
        if namer is not None:
            return [tag, namer(value)]
        if not entry.shared:
            return [tag, *entry.values(value)]
        known = self._objects.get(id(value))
        if known is not None:
            return known[0]
        number = len(self._objects)
        again = msgpack.ExtType(wire.SAME_OBJECT, number.to_bytes(4, "little"))
        self._objects[id(value)] = again, value
        return [tag, number, *entry.values(value)]

    def _array(self, array: np.ndarray[Any, Any]) -> Any:
        known = self._arrays.get(id(array))
        if known is not None:
            return known[0]
        number = len(self._arrays).to_bytes(4, "little")
        self._arrays[id(array)] = msgpack.ExtType(wire.SAME_ARRAY, number), array
        return msgpack.ExtType(wire.ARRAY, wire.pack_array(array))


def _packer(default: Callable[[Any], Any] | None = None) -> Any:
    return msgpack.Packer(
        default=default, strict_types=True, unicode_errors="surrogatepass", buf_size=4096
    )


@lru_cache(maxsize=1024)
def _table(classes: tuple[type, ...]) -> bytes:
    """The table of the classes of a message, packed."""
    entries = [BY_CLASS[cls] for cls in classes]
    rows = _packer().pack([[e.name, e.shared, list(e.names)] for e in entries])
    table: bytes = _packer().pack(msgpack.ExtType(wire.TABLE, rows))
    return table


def _in_order(values: Iterable[Any]) -> list[Any]:
    """Elements of a set in an order that is always the same, whatever they are."""
    if {type(value) for value in values} in ({int}, {str}):
        return sorted(values)
    return sorted(values, key=encode)


def _where(value: Any, outside: Namers) -> str:
    """Class and field of what cannot be written, as the beginning of a message."""
    found = ""
    for _ in range(_DEPTH_TOLD):
        entry = BY_CLASS.get(type(value))
        if entry is not None and entry.cls not in outside:
            names = [f"{entry.name}.{name}: " for name in entry.names]
            parts = list(zip(names, entry.values(value), strict=True))
        elif isinstance(value, (list, tuple, deque, dict)):
            items = [*value, *value.values()] if isinstance(value, dict) else value
            parts = [(found, item) for item in items]
        else:
            break
        bad = next(((name, part) for name, part in parts if not _writes(part, outside)), None)
        if bad is None:
            break
        found, value = bad
    return found


def _writes(value: object, outside: Namers) -> bool:
    try:
        _Writer(outside).write(value)
    except (ValueError, OverflowError, TypeError, RecursionError):
        return False
    return True

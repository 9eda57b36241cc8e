"""Bytes to objects. The unpacker, in C, builds what is plain and calls here for all else."""

from __future__ import annotations

import zlib
from collections import deque
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, TypeVar, overload

import msgpack
import numpy as np

from lineloom_core.codec import wire
from lineloom_core.codec.checking import Check, check_of
from lineloom_core.codec.errors import CodecError
from lineloom_core.codec.registry import BY_NAME, Entry

_T = TypeVar("_T")
Finders = Mapping[Any, Callable[[Any], object]]
"""By class, the object of a name that `encode` wrote in its place. May raise LookupError."""

MOST_INFLATED = 1 << 31
"""Bytes that anything of ours is smaller than."""


@overload
def decode(data: bytes, expected: type[_T], outside: Finders | None = None) -> _T: ...


@overload
def decode(data: bytes, expected: object, outside: Finders | None = None) -> Any: ...


def decode(data: bytes, expected: Any, outside: Finders | None = None) -> Any:
    """Return what was encoded, an `expected`: a class or another annotation.

    Raises CodecError for anything else, whatever the bytes say, naming the class and the field.
    """
    reader = _Reader(outside or {})
    try:
        value = reader.read(data)
    except CodecError:
        raise
    except Exception as error:  # of msgpack, numpy, and what hashes and compares
        raise CodecError(f"no message: {type(error).__name__}: {error}") from error
    if not _expecting(expected).fits(value):
        raise CodecError(f"a {type(value).__name__} instead of {expected}")
    return value


def inflate(data: bytes, most: int = MOST_INFLATED) -> bytes:
    """Undo `zlib.compress`. Raises CodecError for other bytes, and where more than `most` come."""
    stream = zlib.decompressobj()
    try:
        whole = stream.decompress(data, most)
    except zlib.error as error:
        raise CodecError(f"not compressed by us: {error}") from error
    if not stream.eof or stream.unused_data:
        raise CodecError("compressed bytes that are cut off, go on or become too many")
    return whole


_expecting: Callable[[Any], Check] = lru_cache(maxsize=256)(check_of)


class _Tag:
    """The first element of an array that stands for something else."""

    def __init__(self, build: Callable[[list[Any]], Any], *, shared: bool = False) -> None:
        self.build = build
        self.shared = shared


class _Layout:
    """A class as a message has written it: all of its fields, in any order."""

    def __init__(self, entry: Entry, names: tuple[str, ...]) -> None:
        _same_fields(entry, names)
        self.entry = entry
        self._names = names
        self._checks = [entry.checks[name] for name in names]
        self._deep = [(i, c) for i, c in enumerate(self._checks) if c.is_deep]
        self._known: set[tuple[type, ...]] = set()
        self._make = entry.maker(names)

    def build(self, values: list[Any]) -> Any:
        """Return an object, if its fields' values are what they must be."""
        kinds = tuple(map(type, values))
        if kinds not in self._known:
            self._learn(kinds)
        for i, check in self._deep:
            if not check.fits(values[i]):
                raise CodecError(f"{self.entry.name}.{self._names[i]}: holds what it must not")
        try:
            return self._make(*values)
        except Exception as error:
            raise CodecError(f"{self.entry.name}: {error}") from error

    def _learn(self, kinds: tuple[type, ...]) -> None:
        """Take these types of values for right from now on, if they are."""
        if len(kinds) != len(self._names):
            raise CodecError(f"{self.entry.name}: {len(kinds)} fields, not {len(self._names)}")
        for name, check, kind in zip(self._names, self._checks, kinds, strict=True):
            if not check.takes(kind):
                raise CodecError(f"{self.entry.name}.{name}: is a {kind.__name__}")
        self._known.add(kinds)


def _same_fields(entry: Entry, names: tuple[str, ...]) -> None:
    """Raise CodecError where a message has other fields than the class."""
    for name in entry.names:
        if name not in names:
            raise CodecError(f"{entry.name}.{name}: missing")
    for name in names:
        if name not in entry.names:
            raise CodecError(f"{entry.name}.{name}: unknown")
    if len(names) != len(entry.names):
        raise CodecError(f"{entry.name}: a field twice")


@lru_cache(maxsize=1024)
def _layouts(table: bytes) -> tuple[_Layout, ...]:
    """The classes that a message names."""
    layouts = []
    rows = _unpack(table)
    if not isinstance(rows, list) or len(rows) > wire.MOST_CLASSES:
        raise CodecError("a table of classes that is none")
    for row in rows:
        name, shared, fields = row
        entry = BY_NAME.get(name)
        if entry is None:
            raise CodecError(f"{name!r}: no class of this name is storable")
        if shared is not entry.shared:
            raise CodecError(f"{name}: is{'' if entry.shared else ' not'} shared")
        layouts.append(_Layout(entry, tuple(fields)))
    return tuple(layouts)


def _unpack(data: bytes, **hooks: Any) -> Any:
    # A time stamp of msgpack's becomes a number: its class is none of ours.
    return msgpack.unpackb(
        data, strict_map_key=False, unicode_errors="surrogatepass", timestamp=1, **hooks
    )


_PLAIN_TAGS = {
    wire.TUPLE: _Tag(tuple),
    wire.SET: _Tag(set),
    wire.FROZEN_SET: _Tag(frozenset),
    wire.DEQUE: _Tag(lambda row: deque(row[1:], row[0])),
}


class _Reader:
    """One message."""

    def __init__(self, outside: Finders) -> None:
        self._outside = outside
        self._table: tuple[_Layout, ...] | None = None
        self._tags: dict[tuple[int, bytes], _Tag] = {}
        self._arrays: list[np.ndarray[Any, Any]] = []
        self._objects: dict[int, Any] = {}
        self._open = 0  # tags of arrays that are not complete

    def read(self, data: bytes) -> Any:
        whole = _unpack(data, ext_hook=self._extension, list_hook=self._array)
        if self._table is None or type(whole) is not list or len(whole) != 2 or self._open:
            raise CodecError("no message: not a table and a value")
        return whole[1]

    def _array(self, row: list[Any]) -> Any:
        """What an array stands for; itself without a tag."""
        if not row or type(row[0]) is not _Tag:
            return row
        tag = row[0]
        self._open -= 1
        del row[0]
        if not tag.shared:
            return tag.build(row)
        number = row.pop(0) if row else None
        if type(number) is not int or number in self._objects:
            raise CodecError("a shared object without a number of its own")
        found = self._objects[number] = tag.build(row)
        return found

    def _extension(self, code: int, data: bytes) -> Any:
        if code in (wire.OBJECT, wire.OUTSIDE):
            self._open += 1
            return self._tags.get((code, data)) or self._new_tag(code, data)
        if code == wire.ARRAY:
            self._arrays.append(wire.unpack_array(data))
            return self._arrays[-1]
        if code in _PLAIN_TAGS:
            self._open += 1
            return _PLAIN_TAGS[code]
        if code == wire.SAME_ARRAY:
            return self._arrays[int.from_bytes(data, "little")]
        if code == wire.SAME_OBJECT:
            return self._objects[int.from_bytes(data, "little")]
        if code == wire.SCALAR:
            return wire.unpack_scalar(data)
        if code == wire.BIG_INTEGER and len(data) <= wire.MOST_INTEGER_BYTES:
            return int.from_bytes(data, "little", signed=True)
        if code == wire.TABLE and self._table is None:
            self._table = _layouts(data)
            return None
        raise CodecError(f"an extension of kind {code} that is none of ours")

    def _new_tag(self, code: int, data: bytes) -> _Tag:
        layout = (self._table or ())[int.from_bytes(data, "little")]
        if code == wire.OBJECT:
            tag = _Tag(layout.build, shared=layout.entry.shared)
        else:
            tag = _Tag(lambda row: self._find(layout.entry, row))
        self._tags[code, data] = tag
        return tag

    def _find(self, entry: Entry, row: list[Any]) -> Any:
        finder = self._outside.get(entry.cls)
        if finder is None or len(row) != 1:
            raise CodecError(f"{entry.name}: is named, but nobody knows those")
        try:
            found = finder(row[0])
        except Exception as error:
            raise CodecError(f"{entry.name}: no {row[0]!r} is known") from error
        if type(found) is not entry.cls:
            raise CodecError(f"{entry.name}: no {row[0]!r} is known")
        return found

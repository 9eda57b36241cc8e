"""Published views in the store, for processes that do not map: one whole, and what changed since.

A record is a row of steps, each compressed by itself: from nothing to a whole view, and on to
later ones. Who has read a record goes on where it ended.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import replace

from lineloom_core.codec import CodecError, decode, encode, inflate
from lineloom_core.mapping.answers.view_change import ViewChange

from lineloom_service.engine.published import NOTHING, Published
from lineloom_service.engine.view_parts import Parts, read_change, with_breaths, write_change
from lineloom_service.store.records import Skip, ViewRecord

_LENGTH_BYTES = 4
_MOST_BYTES = 1 << 28
"""A step of more, inflated, is not ours."""


class ViewWriter:
    """Writes the views of one site; for a thread, one call at a time."""

    def __init__(self) -> None:
        self._written = NOTHING
        self._whole = self._changes = b""

    def write(self, published: Published) -> ViewRecord:
        """Return what goes into the store. Takes time with what changed since the last call."""
        changes = self._changes + _step(self._written, published)
        if len(changes) > len(self._whole):  # of so many changes, nobody reads the first faster
            self._whole, changes = _step(NOTHING, published), b""
        self._changes, self._written = changes, published
        return ViewRecord(published.position, self._whole + changes)


class ViewReader:
    """Reads the views of one site. What was in the one before are the same objects."""

    def __init__(self) -> None:
        self._data = b""
        self._read = NOTHING

    def read(self, record: ViewRecord) -> Published:
        """Return what was written; for a thread, one call at a time.

        Raises ValueError for what is damaged, or written by other code; then nothing is read.
        """
        known = record.data.startswith(self._data)
        try:
            published = self._read if known else NOTHING
            for step in _steps(record.data[len(self._data) if known else 0 :]):
                published = _after(published, step)
            if published.position != record.position:
                raise CodecError(f"it ends at entry {published.position}, not {record.position}")
            if not known:
                change = ViewChange.between(self._read.view, published.view)
                published = replace(published, view=change.apply(self._read.view))
        except (ValueError, TypeError, LookupError) as error:
            raise ValueError(f"unreadable view: {error}") from error
        self._data, self._read = record.data, published
        return published


def _step(before: Published, after: Published) -> bytes:
    head = encode((after.position, after.scans, after.skipped, after.skips))
    change = ViewChange.between(before.view, after.view)
    step = zlib.compress(encode((head, *with_breaths(write_change(change)))), 1)
    return len(step).to_bytes(_LENGTH_BYTES, "little") + step


def _steps(data: bytes) -> Iterator[Parts]:
    while data:
        end = _LENGTH_BYTES + int.from_bytes(data[:_LENGTH_BYTES], "little")
        if len(data) < end:
            raise CodecError("a step that is cut off")
        yield decode(inflate(data[_LENGTH_BYTES:end], _MOST_BYTES), tuple[bytes, ...])
        data = data[end:]


def _after(before: Published, step: Parts) -> Published:
    position, scans, skipped, skips = decode(step[0], tuple[int, int, int, tuple[Skip, ...]])
    view = read_change(step[1:]).apply(before.view)
    return Published(position, scans, skipped, view, skips)

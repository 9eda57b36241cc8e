"""Views on their way to those who have the one before: what changed, in parts.

Reading a large view in one go would hold every answer of the service up. From one view to the
next hardly anything changes, and what did not stays the same object at the other end, so whoever
compares the two is done at once. Where much changes, it is read part by part.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import islice
from typing import Any, TypeVar

from lineloom_core.codec import CodecError, decode, encode
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.answers.view_change import EMPTY_VIEW, TABLES, ViewChange

T = TypeVar("T")
Parts = tuple[bytes, ...]
"""A change of a view: the entries of its tables, some at a time, and then all but those."""

_TOGETHER = 50
"""Entries in a part: a reader is at it for less than a millisecond."""

_SPELL_S, _BREATH_S = 0.0005, 0.0005
"""So long objects are read before others get the interpreter, and so long they have it."""


def with_breaths(parts: Iterable[T]) -> Iterator[T]:
    """Let others have the interpreter now and then, for work of many small steps on a thread."""
    begin = time.perf_counter()
    for part in parts:
        yield part
        if time.perf_counter() - begin >= _SPELL_S:
            time.sleep(_BREATH_S)
            begin = time.perf_counter()


def write_change(change: ViewChange) -> Iterator[bytes]:
    """Return a change as parts, of which any number can be written before the next."""
    bare: dict[str, Any] = {}
    for name, table in change.tables().items():
        bare[name] = replace(table, new={})
        entries = iter(table.new.items())
        while some := dict(islice(entries, _TOGETHER)):
            yield encode((name, some))
    yield encode(change.with_tables(bare))


def read_change(parts: Parts) -> ViewChange:
    """Return the change that was written. Raises CodecError for other bytes."""
    new: dict[str, dict[Any, Any]] = {name: {} for name in TABLES}
    for part in with_breaths(parts[:-1]):
        name, some = decode(part, tuple[str, dict[Any, Any]])
        if name not in new or any(type(entry) is not TABLES[name] for entry in some.values()):
            raise CodecError(f"a part of a view that is no {name}")
        new[name].update(some)
    bare = decode(parts[-1], ViewChange)
    return bare.with_tables({n: replace(t, new=new[n]) for n, t in bare.tables().items()})


class ViewEncoder:
    """The worker's end: one for each run of a site, as the decoder has to have seen the same."""

    def __init__(self) -> None:
        self._sent = EMPTY_VIEW

    def encode(self, view: SiteView) -> Parts:
        """Return what the decoder needs, given all views before."""
        parts = tuple(write_change(ViewChange.between(self._sent, view)))
        self._sent = view
        return parts


class ViewDecoder:
    """The service's end, on a thread."""

    def __init__(self) -> None:
        self._view = EMPTY_VIEW

    def decode(self, parts: Parts) -> SiteView:
        """Return the view; what of it was in the one before are the same objects."""
        self._view = read_change(parts).apply(self._view)
        return self._view

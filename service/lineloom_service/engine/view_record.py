"""Published views in the store, for processes that do not map: whole, and read part by part.

In one piece a view of 4 000 objects would take the interpreter for 30 ms, at either end.
"""

from __future__ import annotations

import pickle
import zlib
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lineloom_service.engine.published import Published
from lineloom_service.engine.view_parts import (
    COLLECTIONS,
    collections_of,
    with_breaths,
    with_collections,
    without_collections,
)
from lineloom_service.store.records import ViewRecord


@dataclass(frozen=True, slots=True)
class _Parts:
    """rest: all but the view's collections, pickled. bodies: the collections' objects, each
    pickled, end to end. lengths: of the (n,) objects of each collection [bytes]."""

    rest: bytes
    bodies: bytes
    lengths: dict[str, NDArray[np.uint32]]


def write_view(published: Published) -> ViewRecord:
    """Return what goes into the store. Takes time with the map's size: for a thread."""
    bodies: list[bytes] = []
    lengths: dict[str, NDArray[np.uint32]] = {}
    for name, parts in collections_of(published.view).items():
        written = [pickle.dumps(part, protocol=5) for part in with_breaths(parts)]
        lengths[name] = np.array([len(body) for body in written], dtype=np.uint32)
        bodies += written
    rest = replace(published, view=without_collections(published.view))
    whole = _Parts(pickle.dumps(rest, protocol=5), b"".join(bodies), lengths)
    return ViewRecord(published.position, zlib.compress(pickle.dumps(whole, protocol=5), 1))


class ViewReader:
    """Reads the views of one site. Parts that were in the one before are the same objects."""

    def __init__(self) -> None:
        self._known: dict[bytes, object] = {}

    def read(self, record: ViewRecord) -> Published:
        """Return what was written; for a thread, one call at a time.

        Raises ValueError where other code wrote it and it does not fit.
        """
        try:
            whole = pickle.loads(zlib.decompress(record.data))
            if not isinstance(whole, _Parts):
                raise TypeError("it is something else")
            rest: Published = pickle.loads(whole.rest)
            collections = self._read(whole)
            view = with_collections(rest.view, collections)
        except Exception as error:
            raise ValueError(f"unreadable view: {error}") from error
        return replace(rest, view=view)

    def _read(self, whole: _Parts) -> dict[str, tuple[object, ...]]:
        known: dict[bytes, object] = {}
        collections: dict[str, tuple[object, ...]] = {}
        start = 0
        for name in COLLECTIONS:
            parts: list[object] = []
            for length in with_breaths(whole.lengths[name].tolist()):
                body = whole.bodies[start : start + length]
                start += length
                if body not in known:
                    known[body] = self._known[body] if body in self._known else pickle.loads(body)
                parts.append(known[body])
            collections[name] = tuple(parts)
        self._known = known
        return collections

"""Views on their way from a worker: only what is not as it was in the view before.

Reading a whole view holds every answer of the service up: one of 4 000 objects takes the
interpreter for 30 ms, its garbage collector included. From one view to the next hardly anything
changes, so what was sent stays where it is and is named by its number; and as it is the same
object in both views, whoever compares them is done at once.
"""

from __future__ import annotations

import pickle
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.answers.trajectories import Trajectories

T = TypeVar("T")

_FIELDS = ("lines", "keyframes", "constraints", "places")
"""Those that grow with the map and are tuples of many objects."""

_SCANS = "scans"
COLLECTIONS = (*_FIELDS, _SCANS)
"""What of a view travels part by part: these fields, and what trajectories are made of."""

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


def collections_of(view: SiteView) -> dict[str, tuple[object, ...]]:
    """Return the parts of a view, by collection."""
    parts: dict[str, tuple[object, ...]] = {name: getattr(view, name) for name in _FIELDS}
    made = view.trajectories
    return {**parts, _SCANS: made.blocks if isinstance(made, Trajectories) else ()}


def with_collections(view: SiteView, parts: Mapping[str, tuple[object, ...]]) -> SiteView:
    """Return the view with these parts in place of its own."""
    fields: dict[str, Any] = {name: parts[name] for name in _FIELDS}
    if isinstance(view.trajectories, Trajectories):
        blocks: tuple[Any, ...] = parts[_SCANS]
        fields["trajectories"] = replace(view.trajectories, blocks=blocks)
    return replace(view, **fields)


def without_collections(view: SiteView) -> SiteView:
    """Return what does not grow part by part."""
    return with_collections(view, dict.fromkeys(COLLECTIONS, ()))


@dataclass(frozen=True, slots=True)
class ViewParts:
    """A view of which parts were sent before.

    rest: the view without its collections, pickled. numbers: by collection, those of its objects
    in order. new: number -> object, pickled, for those that were not in the view before.
    """

    rest: bytes
    numbers: dict[str, list[int]]
    new: dict[int, bytes]


class ViewEncoder:
    """The worker's end: one for each run of a site, as the decoder has to have seen the same."""

    def __init__(self) -> None:
        self._sent: dict[bytes, int] = {}
        self._next = 0

    def encode(self, view: SiteView) -> ViewParts:
        """Return what the decoder needs, given all views before."""
        sent: dict[bytes, int] = {}
        numbers: dict[str, list[int]] = {}
        new: dict[int, bytes] = {}
        for name, parts in collections_of(view).items():
            numbers[name] = []
            for part in parts:
                body = pickle.dumps(part, protocol=5)
                number = self._sent.get(body, sent.get(body))
                if number is None:
                    number, self._next = self._next, self._next + 1
                    new[number] = body
                sent[body] = number
                numbers[name].append(number)
        self._sent = sent
        rest = pickle.dumps(without_collections(view), protocol=5)
        return ViewParts(rest, numbers, new)


class ViewDecoder:
    """The service's end, on a thread."""

    def __init__(self) -> None:
        self._parts: dict[int, object] = {}

    def decode(self, encoded: ViewParts) -> SiteView:
        """Return the view; its parts that were in the one before are the same objects."""
        read = {number: pickle.loads(new) for number, new in with_breaths(encoded.new.items())}
        known = self._parts | read
        self._parts = {n: known[n] for numbers in encoded.numbers.values() for n in numbers}
        rest: SiteView = pickle.loads(encoded.rest)
        collections = {
            name: tuple(known[n] for n in numbers) for name, numbers in encoded.numbers.items()
        }
        return with_collections(rest, collections)

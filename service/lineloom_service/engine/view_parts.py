"""Views on their way from a worker: only what is not as it was in the view before.

Reading a whole view holds every answer of the service up: one of 4 000 objects takes the
interpreter for 30 ms, its garbage collector included. From one view to the next hardly anything
changes, so what was sent stays where it is and is named by its number; and as it is the same
object in both views, whoever compares them is done at once.
"""

from __future__ import annotations

import pickle
import time
from dataclasses import dataclass, replace
from itertools import islice

from lineloom_core.mapping.site_view import SiteView

_COLLECTIONS = ("lines", "keyframes", "constraints", "submaps")
"""The fields that grow with the map and are tuples of many objects."""

_AT_A_TIME = 100
"""Objects read before others get the interpreter: about half a millisecond."""

_BREATH_S = 0.0005


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
        for name in _COLLECTIONS:
            numbers[name] = []
            for part in getattr(view, name):
                body = pickle.dumps(part, protocol=5)
                number = self._sent.get(body, sent.get(body))
                if number is None:
                    number, self._next = self._next, self._next + 1
                    new[number] = body
                sent[body] = number
                numbers[name].append(number)
        self._sent = sent
        rest = replace(view, lines=(), keyframes=(), constraints=(), submaps=())
        return ViewParts(pickle.dumps(rest, protocol=5), numbers, new)


class ViewDecoder:
    """The service's end, on a thread."""

    def __init__(self) -> None:
        self._parts: dict[int, object] = {}

    def decode(self, encoded: ViewParts) -> SiteView:
        """Return the view; its parts that were in the one before are the same objects."""
        known = self._parts | self._read(encoded.new)
        self._parts = {n: known[n] for numbers in encoded.numbers.values() for n in numbers}
        rest: SiteView = pickle.loads(encoded.rest)
        collections = {
            name: tuple(known[n] for n in numbers) for name, numbers in encoded.numbers.items()
        }
        return replace(rest, **collections)  # type: ignore[arg-type]

    def _read(self, new: dict[int, bytes]) -> dict[int, object]:
        read: dict[int, object] = {}
        bodies = iter(new.items())
        while some := list(islice(bodies, _AT_A_TIME)):
            read.update((number, pickle.loads(body)) for number, body in some)
            time.sleep(_BREATH_S)
        return read

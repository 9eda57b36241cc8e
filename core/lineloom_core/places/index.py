"""Which of many places are worth a full comparison: a shortlist in microseconds per place.

After geometric hashing (Wolfson and Rigoutsos 1997): every pair of like corners of two places
votes for the pose it implies; the best voted poses are judged by the length of line that lies on
line. That ranks; `recognise` decides. A place that is missed costs time, never a wrong map.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lineloom_core.places import _index_kernels as kernels
from lineloom_core.places.place import Place

CORNER_REACH, LEAST_SINE, MOST_CORNERS = 0.6, 0.5, 80
HALF, CELL, PEAKS, LINE_REACH = 16.0, 0.5, 3, 0.4

_FEW = 64
"""Places for whose room nobody tidies up."""


class PlaceIndex:
    """What places look like, packed in arrays. A cache: it answers by the places alone."""

    def __init__(self) -> None:
        self._slots: dict[tuple[int, tuple[int, ...]], int] = {}
        self._corners = _Rows(kernels.CORNER_COLUMNS)
        self._lines = _Rows(kernels.LINE_COLUMNS)
        self._gone: set[int] = set()

    def __len__(self) -> int:
        return len(self._slots)

    def add(self, place: Place) -> int:
        """Take a place in unless one of its id and keyframes is known; return its number."""
        name = (place.id, place.keyframes)
        self._gone.discard(place.id)
        slot = self._slots.get(name)
        if slot is None:
            slot = self._slots[name] = len(self._slots)
            self._corners.append(
                kernels.corners_of(place.lines, CORNER_REACH, LEAST_SINE, MOST_CORNERS)
            )
            self._lines.append(kernels.short_lines(place.lines))
        return slot

    def forget(self, place: int) -> None:
        """Drop the place of this id; its room is used again once half of all places are gone."""
        self._gone.add(place)
        if len(self._gone) <= max(_FEW, len(self._slots) // 2):
            return
        kept = [name for name in self._slots if name[0] not in self._gone]
        slots = [self._slots[name] for name in kept]
        self._corners, self._lines = self._corners.only(slots), self._lines.only(slots)
        self._slots = {name: slot for slot, name in enumerate(kept)}
        self._gone = set()

    def likeness(self, place: Place, others: Sequence[Place]) -> NDArray[np.float64]:
        """How many metres of line each of the others can explain of `place`, shape (n,)."""
        chosen = np.array([self.add(other) for other in others], dtype=np.int64)
        own = self.add(place)
        found = np.zeros(len(others))
        kernels.likeness_to_all(
            self._corners.rows, self._lines.rows, self._corners.ends, self._lines.ends, chosen,
            self._corners.of(own), self._lines.of(own), HALF, CELL, PEAKS, LINE_REACH, found,
        )  # fmt: skip
        return found

    def shortlist(self, place: Place, others: Sequence[Place], most: int) -> list[Place]:
        """The `most` others that look most like `place`, in the order given; all if no more."""
        if len(others) <= most:
            return list(others)
        best = np.argsort(-self.likeness(place, others), kind="stable")[:most]
        return [others[k] for k in np.sort(best).tolist()]


class _Rows:
    """Pieces of rows one behind the other; grows by doubling."""

    def __init__(self, columns: int) -> None:
        self._rows = np.empty((1024, columns))
        self._ends = np.zeros(64, dtype=np.int64)
        self._count = 0

    @property
    def rows(self) -> NDArray[np.float64]:
        return self._rows

    @property
    def ends(self) -> NDArray[np.int64]:
        """Piece k is rows[ends[k] : ends[k + 1]]."""
        return self._ends

    def of(self, piece: int) -> NDArray[np.float64]:
        return self._rows[self._ends[piece] : self._ends[piece + 1]]

    def only(self, pieces: Sequence[int]) -> _Rows:
        """These pieces by themselves, in this order."""
        other = _Rows(self._rows.shape[1])
        for piece in pieces:
            other.append(self.of(piece))
        return other

    def append(self, piece: NDArray[np.float64]) -> None:
        begin = int(self._ends[self._count])
        end = begin + len(piece)
        while end > len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        if self._count + 2 > len(self._ends):
            self._ends = np.concatenate([self._ends, np.zeros_like(self._ends)])
        self._rows[begin:end] = piece
        self._count += 1
        self._ends[self._count] = end

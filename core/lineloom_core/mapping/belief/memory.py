"""Results that depend on nothing but keyframes, kept because replaying asks for them again."""

from __future__ import annotations

from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose
from lineloom_core.places import (
    Place,
    PlaceIndex,
    Recognition,
    RecognitionConfig,
    count_steady,
    hypotheses,
    missing_share,
    recognise,
)

Pair = tuple[int, int]
_T = TypeVar("_T")

_TABLES_KEPT = 20_000
"""Pairs of places of which all hypotheses are kept, about 0.3 kB each."""


class Sealed(Protocol):
    """Where recognitions are when the history that they are of is sealed (`History`)."""

    def recognitions(self, place: int) -> dict[Pair, Recognition]:
        """Those that were asked for when the place was the latest."""


@storable("memory", _config=RecognitionConfig, _recognitions=dict[Pair, Recognition])
class Memory:
    """Places by id, and what came of comparing two of them. A cache: it decides nothing.

    Of places that the map has let go nothing is held here: who replays finds recognitions in the
    history, and makes the places anew.
    """

    def __init__(self, config: RecognitionConfig, sealed: Sealed | None = None) -> None:
        self._config = config
        self.sealed = sealed
        self.places: dict[int, Place] = {}
        self.index = PlaceIndex()
        self._recognitions: dict[Pair, Recognition] = {}
        self._hypotheses: dict[Pair, NDArray[np.float64]] = {}
        self._look_alikes: dict[Pair, NDArray[np.float64]] = {}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Recognitions are worth keeping; places and hypotheses are had again as needed."""
        self.__init__(state["_config"])  # type: ignore[misc]
        self._recognitions = state["_recognitions"]

    def recognise(self, reference: Place, current: Place) -> Recognition:
        """`places.recognise`, asked once per pair."""
        pair = (reference.id, current.id)
        found = self._recognitions.get(pair)
        if found is None and self.sealed is not None:
            found = self.sealed.recognitions(max(pair)).get(pair)
        if found is None:
            found = self._recognitions[pair] = recognise(reference, current, self._config)
        return found

    def hypotheses(self, reference: Place, current: Place) -> NDArray[np.float64]:
        """`places.hypotheses`, asked once per pair."""
        pair = (reference.id, current.id)
        if pair not in self._hypotheses:
            table = hypotheses(reference, current, self._config)
            _keep(self._hypotheses, pair, table)
        return self._hypotheses[pair]

    def look_alikes(self, reference: Place, current: Place) -> NDArray[np.float64]:
        """Those of the hypotheses that what stood still does not speak against.

        Rooms of the same walls with other furniture are no danger: recognition tells them apart.
        """
        pair = (reference.id, current.id)
        if pair not in self._look_alikes:
            table = self.hypotheses(reference, current)
            missing = [
                missing_share(*count_steady(reference, current, Pose.from_array(row[:3])))
                for row in table
            ]
            alike = table[np.array(missing) <= self._config.most_missing]
            _keep(self._look_alikes, pair, alike)
        return self._look_alikes[pair]

    def let_go(self, place: int) -> None:
        """The map has let a place go."""
        self.places.pop(place, None)
        self.index.forget(place)

    def hand_over(self, begin: int, end: int) -> dict[Pair, Recognition]:
        """Return the recognitions of places with ids up to `end`, to be held elsewhere from now on.

        What is older than `begin` was asked for anew since it was handed over: dropped.
        """
        over = {p: r for p, r in self._recognitions.items() if begin <= max(p) < end}
        self._recognitions = {p: r for p, r in self._recognitions.items() if max(p) >= end}
        return over

    def forget(self, keyframes: set[int]) -> None:
        """Drop what rests on keyframes that are gone; a place is named by its last one."""
        self.index = PlaceIndex()
        self.places = {p: place for p, place in self.places.items() if p not in keyframes}
        self._recognitions = _kept(self._recognitions, keyframes)
        self._hypotheses = _kept(self._hypotheses, keyframes)
        self._look_alikes = _kept(self._look_alikes, keyframes)


def _keep(items: dict[Pair, _T], pair: Pair, item: _T) -> None:
    """Remember an item; of too many the oldest goes."""
    items[pair] = item
    if len(items) > _TABLES_KEPT:
        del items[next(iter(items))]


def _kept(items: dict[Pair, _T], gone: set[int]) -> dict[Pair, _T]:
    return {(a, b): item for (a, b), item in items.items() if a not in gone and b not in gone}

"""Results that depend on nothing but keyframes, kept because replaying asks for them again."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

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


class Memory:
    """Places by id, and what came of comparing two of them. A cache: it decides nothing."""

    def __init__(self, config: RecognitionConfig) -> None:
        self._config = config
        self.places: dict[int, Place] = {}
        self.index = PlaceIndex()
        self._recognitions: dict[Pair, Recognition] = {}
        self._hypotheses: dict[Pair, NDArray[np.float64]] = {}
        self._look_alikes: dict[Pair, NDArray[np.float64]] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Recognitions are worth keeping; places and hypotheses are had again as needed."""
        return {**self.__dict__, "places": {}, "_hypotheses": {}, "_look_alikes": {}}

    def recognise(self, reference: Place, current: Place) -> Recognition:
        """`places.recognise`, asked once per pair."""
        pair = (reference.id, current.id)
        if pair not in self._recognitions:
            self._recognitions[pair] = recognise(reference, current, self._config)
        return self._recognitions[pair]

    def hypotheses(self, reference: Place, current: Place) -> NDArray[np.float64]:
        """`places.hypotheses`, asked once per pair."""
        pair = (reference.id, current.id)
        if pair not in self._hypotheses:
            self._hypotheses[pair] = hypotheses(reference, current, self._config)
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
            self._look_alikes[pair] = table[np.array(missing) <= self._config.most_missing]
        return self._look_alikes[pair]

    def forget(self, keyframes: set[int]) -> None:
        """Drop what rests on keyframes that are gone; a place is named by its last one."""
        self.index = PlaceIndex()
        self.places = {p: place for p, place in self.places.items() if p not in keyframes}
        self._recognitions = _kept(self._recognitions, keyframes)
        self._hypotheses = _kept(self._hypotheses, keyframes)
        self._look_alikes = _kept(self._look_alikes, keyframes)


def _kept(items: dict[Pair, _T], gone: set[int]) -> dict[Pair, _T]:
    return {(a, b): item for (a, b), item in items.items() if a not in gone and b not in gone}

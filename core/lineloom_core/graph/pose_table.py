"""Rows of poses as a mapping from node ids."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose


class PoseTable(Mapping[int, Pose]):
    """Poses by node id, read only, over rows (x, y, theta)."""

    def __init__(self, row_of: Mapping[int, int], rows: NDArray[np.float64]) -> None:
        self._row_of, self._rows = row_of, rows

    def __getitem__(self, node: int) -> Pose:
        return Pose(*self._rows[self._row_of[node]].tolist())

    def __iter__(self) -> Iterator[int]:
        return iter(self._row_of)

    def __len__(self) -> int:
        return len(self._row_of)

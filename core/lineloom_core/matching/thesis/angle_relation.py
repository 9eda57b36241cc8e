"""The geometrical relation "angle between two line segments", over 360 degrees (§4.3)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lineloom_core.matching.thesis.config import Windows
from lineloom_core.matching.thesis.consistency import ConsistencyTables
from lineloom_core.matching.thesis.line_segments import LineSegments
from lineloom_core.matching.thesis.near_pairs import Indices, near_pairs


def relative_angle(direction_k: ArrayLike, direction_m: ArrayLike) -> NDArray[np.float64]:
    """beta_(k,m): the angle from the reference line l_k to l_m, in [0, 2 pi) [rad].

    Both end points are put into the origin and l_k on the positive x axis (Fig. 4.4): as both
    lines are turned round alike, that is the difference of their directions.
    """
    beta: NDArray[np.float64] = np.mod(np.subtract(direction_m, direction_k), math.tau)
    return beta


def line_pairs(count: int, both_orders: bool) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """All k < m below `count`, with `both_orders` followed by the same pairs as (m, k)."""
    k, m = np.triu_indices(count, 1)
    if both_orders:
        k, m = np.concatenate([k, m]), np.concatenate([m, k])
    return k.astype(np.int64), m.astype(np.int64)


@dataclass(frozen=True, eq=False)
class AngleRelations:
    """n relations A(k, m, beta_(k,m)).

    lines: (n, 2) k, m. beta: (n,) [rad] in [0, 2 pi).
    """

    lines: NDArray[np.int64]
    beta: NDArray[np.float64]

    @staticmethod
    def of(L: LineSegments, both_orders: bool) -> AngleRelations:
        """Extract one relation per pair of line segments."""
        k, m = line_pairs(len(L), both_orders)
        return AngleRelations(
            np.column_stack([k, m]), relative_angle(L.directions[k], L.directions[m])
        )

    def __len__(self) -> int:
        return len(self.beta)

    def compatible(
        self, x: AngleRelations, tables: ConsistencyTables, windows: Windows
    ) -> tuple[Indices, Indices]:
        """Index pairs (g_c, g_x) of equal angle."""
        return near_pairs(self.beta, x.beta, windows.angle, period=math.tau)

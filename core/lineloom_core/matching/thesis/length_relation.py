"""The geometrical relation "line segment length" (§4.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.matching.thesis.config import Windows
from lineloom_core.matching.thesis.consistency import ConsistencyTables, compare_lengths
from lineloom_core.matching.thesis.line_segments import LineSegments
from lineloom_core.matching.thesis.near_pairs import Indices


@dataclass(frozen=True, eq=False)
class LengthRelations:
    """n relations L(k, ||l_k||, type(s_k), type(e_k)).

    lines: (n, 1) k. length: (n,) [m]. complete: (n,) are both end points edge points?
    """

    lines: NDArray[np.int64]
    length: NDArray[np.float64]
    complete: NDArray[np.bool_]

    @staticmethod
    def of(L: LineSegments) -> LengthRelations:
        """Extract one relation per line segment."""
        return LengthRelations(np.arange(len(L))[:, None], L.lengths, L.is_complete)

    def __len__(self) -> int:
        return len(self.length)

    def compatible(
        self, x: LengthRelations, tables: ConsistencyTables, windows: Windows
    ) -> tuple[Indices, Indices]:
        """Index pairs (g_c, g_x) that Algorithm 2 finds compatible."""
        table = compare_lengths(
            self.length[:, None], self.complete[:, None], x.length, x.complete, windows.length
        )
        i, j = np.nonzero(table)
        return i, j

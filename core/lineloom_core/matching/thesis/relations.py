"""The geometrical relations of one scan, G (chapter 4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from lineloom_core.matching.thesis.angle_relation import AngleRelations
from lineloom_core.matching.thesis.config import Windows
from lineloom_core.matching.thesis.consistency import ConsistencyTables
from lineloom_core.matching.thesis.edge_relation import EdgeRelations
from lineloom_core.matching.thesis.length_relation import LengthRelations
from lineloom_core.matching.thesis.near_pairs import Indices
from lineloom_core.matching.thesis.parallel_relation import ParallelRelations
from lineloom_core.matching.thesis.primitives import Primitives


class Relations(Protocol):
    """n relations of one of the four kinds."""

    @property
    def lines(self) -> NDArray[np.int64]:
        """Extraction numbers of the lines of each relation, (n, p); NONE for a missing one."""

    def __len__(self) -> int: ...

    def compatible(
        self, x: Self, tables: ConsistencyTables, windows: Windows
    ) -> tuple[Indices, Indices]:
        """Index pairs (g_c, g_x) of the relations whose geometrical parameters are consistent.

        `self` belongs to S_c, `x` to S_x; `tables` is T_{x x c}.
        """


@dataclass(frozen=True, eq=False)
class RelationSet:
    """G_c or G_r: one relation for each line, pair of lines or pair of edges.

    L: length (§4.2); A: angle between two line segments (§4.3); P: parallel line distance (§4.4);
    E: edge distance (§4.5).
    """

    L: LengthRelations
    A: AngleRelations
    P: ParallelRelations
    E: EdgeRelations

    @property
    def kinds(self) -> tuple[Relations, Relations, Relations, Relations]:
        """The four kinds, always in this order."""
        return self.L, self.A, self.P, self.E

    def __len__(self) -> int:
        return len(self.L) + len(self.A) + len(self.P) + len(self.E)


def extract_relations(
    primitives: Primitives, windows: Windows, *, both_orders: bool = False
) -> RelationSet:
    """Extract the four kinds of geometrical relations of one scan.

    With `both_orders` those between two primitives come as (k, m) and as (m, k). Departure: the
    text has k < m alone, so that a pair of walls which the other scan meets in the other order
    (a full turn that begins elsewhere, or a robot that has turned) has no like there.
    """
    L, E = primitives.L, primitives.E
    return RelationSet(
        LengthRelations.of(L),
        AngleRelations.of(L, both_orders),
        ParallelRelations.of(L, both_orders, windows),
        EdgeRelations.of(E, both_orders, windows),
    )

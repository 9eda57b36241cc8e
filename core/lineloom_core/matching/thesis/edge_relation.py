"""The geometrical relation "edge distance" (§4.5)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry.angles import wrap_array
from lineloom_core.matching.thesis.angle_relation import line_pairs
from lineloom_core.matching.thesis.config import Windows
from lineloom_core.matching.thesis.consistency import ConsistencyTables
from lineloom_core.matching.thesis.edges import Edges
from lineloom_core.matching.thesis.near_pairs import Indices, near_pairs


@dataclass(frozen=True, eq=False)
class EdgeRelations:
    """n relations E(k, m, d^e, theta_1, theta_2, theta_3, theta_4).

    edges: (n, 2) k, m, numbers of edges. lines: (n, 4) the two lines of edge k and the two of
    edge m; NONE where a jump edge has none. d_e: (n,) [m]. theta: (n, 4) [rad], counter-clockwise
    from each of these lines to the distance line from edge k to edge m; slack: (n, 4) [rad] how
    far either side of it theta may be, 0 where the line is known.
    """

    edges: NDArray[np.int64]
    lines: NDArray[np.int64]
    d_e: NDArray[np.float64]
    theta: NDArray[np.float64]
    slack: NDArray[np.float64]

    @staticmethod
    def of(E: Edges, both_orders: bool, windows: Windows) -> EdgeRelations:
        """Extract one relation per pair of edges that do not coincide.

        Departure: virtual edges are related to virtual edges only, as they are compared with their
        own kind only; all pairs would be O(n^4) relations in any case.
        """
        k, m = line_pairs(len(E), both_orders)
        dx, dy = (E.point[m] - E.point[k]).T
        d_e = np.hypot(dx, dy)
        apart = d_e >= windows.least_edge_distance
        k, m, d_e = k[apart], m[apart], d_e[apart]
        distance_line = np.arctan2(dy[apart], dx[apart])
        directions = np.hstack([E.directions[k], E.directions[m]])
        return EdgeRelations(
            edges=np.column_stack([k, m]),
            lines=np.hstack([E.lines[k], E.lines[m]]),
            d_e=d_e,
            theta=np.mod(distance_line[:, None] - directions, math.tau),
            slack=np.hstack([E.slack[k], E.slack[m]]),
        )

    def __len__(self) -> int:
        return len(self.d_e)

    def compatible(
        self, x: EdgeRelations, tables: ConsistencyTables, windows: Windows
    ) -> tuple[Indices, Indices]:
        """Index pairs (g_c, g_x) of equal distance and angles, and of consistent edges.

        Departures: the window of the angles widens as the distance shrinks, by what an error of
        the distance's window across the distance line turns it; a missing angle is compared with
        what it may be at least and at most.
        """
        i, j = near_pairs(self.d_e, x.d_e, windows.distance)
        edges = tables.edges
        keep = edges[x.edges[j, 0], self.edges[i, 0]] & edges[x.edges[j, 1], self.edges[i, 1]]
        i, j = i[keep], j[keep]
        window = windows.angle + 0.5 * windows.distance / self.d_e[i]
        apart = np.abs(wrap_array(self.theta[i] - x.theta[j]))
        keep = np.all(apart <= window[:, None] + self.slack[i] + x.slack[j], axis=1)
        return i[keep], j[keep]

"""Edges of one scan (§3.3): angle edges, jump edges, virtual edges."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lineloom_core.geometry import Pose

ANGLE, JUMP, VIRTUAL = 0, 1, 2
NONE = -1
"""In place of an extraction number: the edge has no such line segment."""


@dataclass(frozen=True, eq=False)
class Edges:
    """n edges i_(k,m) in counter-clockwise order.

    kind: (n,) ANGLE, JUMP or VIRTUAL. point: (n, 2) [m] in the laser's frame. lines: (n, 2) the
    extraction numbers (k, m) of the line that ends in the edge and of the one that starts there;
    NONE for the missing one of a jump edge. Of a virtual edge, m is the line that lies
    counter-clockwise of k by less than half a turn. directions: (n, 2) [rad] of both lines, of a
    missing line the middle of what is possible; slack: (n, 2) [rad] half the width of that, 0
    where the line is known (§4.5's "upper bound for this angle").
    """

    kind: NDArray[np.int64]
    point: NDArray[np.float64]
    lines: NDArray[np.int64]
    directions: NDArray[np.float64]
    slack: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.kind)

    @cached_property
    def beta(self) -> NDArray[np.float64]:
        """Relative angles beta_(k,m) of the two lines (§4.3), (n,) [rad] in [0, 2 pi)."""
        beta: NDArray[np.float64] = np.mod(self.directions[:, 1] - self.directions[:, 0], math.tau)
        return beta

    @cached_property
    def beta_slack(self) -> NDArray[np.float64]:
        """Half the width of what beta may be, (n,) [rad]; 0 where both lines are known."""
        slack: NDArray[np.float64] = self.slack.sum(axis=1)
        return slack

    @staticmethod
    def of(
        kind: int,
        point: ArrayLike,
        lines: ArrayLike,
        directions: ArrayLike,
        slack: ArrayLike | None = None,
    ) -> Edges:
        """Build edges of one kind from n rows each; every line known unless `slack` is given."""
        points = np.asarray(point, dtype=np.float64).reshape(-1, 2)
        wide = np.zeros_like(points) if slack is None else np.asarray(slack, dtype=np.float64)
        return Edges(
            np.full(len(points), kind, np.int64),
            points,
            np.asarray(lines, dtype=np.int64).reshape(-1, 2),
            np.asarray(directions, dtype=np.float64).reshape(-1, 2),
            wide.reshape(-1, 2),
        )

    @staticmethod
    def joined(parts: Iterable[Edges]) -> Edges:
        """Put edges together in the order of extraction: by line, start before end."""
        all_parts = list(parts)
        kind = np.concatenate([p.kind for p in all_parts])
        lines = np.concatenate([p.lines for p in all_parts])
        lone_start = lines[:, 0] == NONE
        place = np.where(lone_start, 2 * lines[:, 1], 2 * lines[:, 0] + 1)
        order = np.lexsort((lines[:, 1], place, kind == VIRTUAL))
        return Edges(
            kind[order],
            np.concatenate([p.point for p in all_parts])[order],
            lines[order],
            np.concatenate([p.directions for p in all_parts])[order],
            np.concatenate([p.slack for p in all_parts])[order],
        )

    def moved(self, T_target_laser: Pose) -> Edges:
        """Return the same edges in another frame."""
        return replace(
            self,
            point=T_target_laser.transform(self.point),
            directions=self.directions + T_target_laser.theta,
        )

"""The list L of line segments of one scan (§3.2, Table 3.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lineloom_core.geometry import Pose


@dataclass(frozen=True, eq=False)
class LineSegments:
    """n line segments in counter-clockwise order of extraction; l_{k+1} of the text is row k.

    s, e: start and end points, (n, 2) [m] in the laser's frame, scanned from s to e, so that the
    free side lies on the left. s_is_edge, e_is_edge: (n,) True for an edge point, False for an
    interior point; what is not known to be an edge point counts as interior. first, last: (n,)
    indices of the beams that hit the first and the last point.
    """

    s: NDArray[np.float64]
    e: NDArray[np.float64]
    s_is_edge: NDArray[np.bool_]
    e_is_edge: NDArray[np.bool_]
    first: NDArray[np.int64]
    last: NDArray[np.int64]

    @staticmethod
    def of(
        segments: ArrayLike,
        edge_ends: Sequence[tuple[bool, bool]] | None = None,
        beams: ArrayLike | None = None,
    ) -> LineSegments:
        """Build from rows x1, y1, x2, y2 [m]; all ends interior and beams 0 unless given.

        edge_ends: is (start, end) of each an edge point? beams: (n, 2) first and last beam.
        """
        rows = np.asarray(segments, dtype=np.float64).reshape(-1, 4)
        n = len(rows)
        edge = np.zeros((n, 2), bool) if edge_ends is None else np.array(edge_ends, bool)
        hit = np.zeros((n, 2), np.int64) if beams is None else np.asarray(beams, dtype=np.int64)
        edge, hit = edge.reshape(n, 2), hit.reshape(n, 2)
        return LineSegments(
            rows[:, :2].copy(), rows[:, 2:].copy(), edge[:, 0], edge[:, 1], hit[:, 0], hit[:, 1]
        )

    def __len__(self) -> int:
        return len(self.s)

    @cached_property
    def lengths(self) -> NDArray[np.float64]:
        """||l_k||, (n,) [m]."""
        length: NDArray[np.float64] = np.hypot(*(self.e - self.s).T)
        return length

    @cached_property
    def directions(self) -> NDArray[np.float64]:
        """Directions from s to e, (n,) [rad]."""
        dx, dy = (self.e - self.s).T
        direction: NDArray[np.float64] = np.arctan2(dy, dx)
        return direction

    @cached_property
    def offsets(self) -> NDArray[np.float64]:
        """Signed distances of the infinite lines from the origin along their left normals [m]."""
        middle = 0.5 * (self.s + self.e)
        c, s = np.cos(self.directions), np.sin(self.directions)
        offset: NDArray[np.float64] = c * middle[:, 1] - s * middle[:, 0]
        return offset

    @cached_property
    def is_complete(self) -> NDArray[np.bool_]:
        """Are both end points edge points, so that the length is that of the wall (Fig. 3.6)?"""
        complete: NDArray[np.bool_] = self.s_is_edge & self.e_is_edge
        return complete

    def moved(self, T_target_laser: Pose) -> LineSegments:
        """Return the same line segments in another frame."""
        return replace(self, s=T_target_laser.transform(self.s), e=T_target_laser.transform(self.e))


def intersection(
    direction_k: ArrayLike, offset_k: ArrayLike, direction_m: ArrayLike, offset_m: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Intersections i_(k,m) of infinite lines, (..., 2) [m], and the sines between them, (...).

    Directions [rad] and offsets [m] as in `LineSegments`, of any shapes that broadcast. Where two
    lines are parallel the sine is about 0 and the point means nothing.
    """
    tk, ok, tm, om = np.broadcast_arrays(direction_k, offset_k, direction_m, offset_m)
    sine = np.sin(tm - tk)
    safe = np.where(np.abs(sine) < 1e-9, 1.0, sine)
    x = (np.cos(tm) * ok - np.cos(tk) * om) / safe
    y = (np.sin(tm) * ok - np.sin(tk) * om) / safe
    return np.stack([x, y], axis=-1), sine

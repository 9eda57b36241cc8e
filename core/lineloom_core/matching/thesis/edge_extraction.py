"""Finding the edges of a scan and with them the types of the end points (§3.2, §3.3)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.matching.thesis.config import PrimitiveConfig
from lineloom_core.matching.thesis.edges import ANGLE, JUMP, NONE, VIRTUAL, Edges
from lineloom_core.matching.thesis.line_segments import LineSegments, intersection
from lineloom_core.scan import Scan


@dataclass(frozen=True, eq=False)
class Sweep:
    """What edge extraction asks of a counter-clockwise scan."""

    ranges: NDArray[np.float64]
    angle_min: float
    angle_increment: float

    @staticmethod
    def of(scan: Scan) -> Sweep:
        """Take what is needed from a scan with a positive angle increment."""
        return Sweep(scan.ranges, scan.angle_min, scan.angle_increment)

    def __len__(self) -> int:
        return len(self.ranges)

    @property
    def full_turn(self) -> bool:
        """Does the last beam neighbour the first?"""
        return len(self) * self.angle_increment > math.tau - 1.5 * self.angle_increment

    def beam(self, index: int) -> int | None:
        """The beam of that index, around the turn if it is full; None beyond the border."""
        if self.full_turn:
            return index % len(self)
        return index if 0 <= index < len(self) else None

    def beams_between(self, i: int, j: int) -> int:
        """Steps counter-clockwise from beam i to beam j; negative only if the turn is not full."""
        return (j - i) % len(self) if self.full_turn else j - i

    def bearing_from(self, i: int, x: float, y: float) -> float:
        """Where (x, y) lies counter-clockwise of beam i, in beams."""
        turn = math.tau / self.angle_increment
        steps = (math.atan2(y, x) - self.angle_min) / self.angle_increment - i
        return steps - turn * math.floor(steps / turn + 0.5)


def angle_edges(L: LineSegments, sweep: Sweep, config: PrimitiveConfig) -> Edges:
    """Edges of consecutive lines l_k, l_{k+1} that meet between two neighbouring beams (§3.3).

    Departures: up to `corner_gap` beams may lie between the two end points, and the intersection
    may lie 1.5 beams outside of them: corners are rounded by noise, and runs of a few points are
    no lines.
    """
    n = len(L)
    found = []
    for k in range(n if sweep.full_turn and n > 2 else n - 1):
        m = (k + 1) % n
        gap = sweep.beams_between(int(L.last[k]), int(L.first[m]))
        if not 0 <= gap <= config.corner_gap:
            continue
        point, sine = intersection(L.directions[k], L.offsets[k], L.directions[m], L.offsets[m])
        if abs(sine) < math.sin(config.least_angle):
            continue
        reach = max(math.hypot(*(point - L.e[k])), math.hypot(*(point - L.s[m])))
        bearing = sweep.bearing_from(int(L.last[k]), float(point[0]), float(point[1]))
        if reach < config.corner_reach and -1.5 <= bearing <= gap + 1.5:
            found.append((k, m, point))
    lines = np.array([(k, m) for k, m, _ in found], np.int64).reshape(-1, 2)
    return Edges.of(ANGLE, [p for _, _, p in found], lines, L.directions[lines])


def jump_edges(L: LineSegments, sweep: Sweep, corners: Edges, config: PrimitiveConfig) -> Edges:
    """End points beyond which the next beam passes on behind the line (§3.3).

    Of the missing line only this is known: it starts (or ends) in the edge and lies in the shadow
    of the line that is there, since the beam through the edge met nothing before (Fig. 4.2(b)).
    Departure: "further" takes a margin of three times the range noise, 5 cm and 0.5 % of the
    range; a neighbour without return says nothing.
    """
    at_end, at_start = set(corners.lines[:, 0].tolist()), set(corners.lines[:, 1].tolist())
    points, lines, directions, slack = [], [], [], []
    for k in range(len(L)):
        if k not in at_start and _passes_behind(L, k, int(L.first[k]) - 1, sweep, config):
            beam = math.atan2(L.s[k, 1], L.s[k, 0])
            opening = float(np.mod(L.directions[k] - beam, math.tau))  # beam to line, 0..pi
            points.append(L.s[k])
            lines.append((NONE, k))
            directions.append((beam + math.pi + 0.5 * opening, L.directions[k]))
            slack.append((0.5 * opening, 0.0))
        if k not in at_end and _passes_behind(L, k, int(L.last[k]) + 1, sweep, config):
            beam = math.atan2(L.e[k, 1], L.e[k, 0])
            shadow = math.pi - float(np.mod(L.directions[k] - beam, math.tau))
            points.append(L.e[k])
            lines.append((k, NONE))
            directions.append((L.directions[k], beam - 0.5 * shadow))
            slack.append((0.0, 0.5 * shadow))
    return Edges.of(JUMP, points, lines, directions, slack)


def virtual_edges(L: LineSegments, corners: Edges, config: PrimitiveConfig) -> Edges:
    """Intersections of all pairs of lines that form no angle edge (§3.3)."""
    k, m = np.triu_indices(len(L), 1)
    point, sine = intersection(L.directions[k], L.offsets[k], L.directions[m], L.offsets[m])
    corner = {frozenset(pair) for pair in corners.lines.tolist()}
    is_corner = np.array([frozenset(p) in corner for p in zip(k.tolist(), m.tolist(), strict=True)])
    keep = (np.abs(sine) > math.sin(config.least_angle)) & ~is_corner.astype(bool)
    pairs = np.column_stack([k, m])[keep]
    pairs[sine[keep] < 0.0] = pairs[sine[keep] < 0.0][:, ::-1]
    return Edges.of(VIRTUAL, point[keep], pairs, L.directions[pairs])


def with_edge_points(L: LineSegments, corners: Edges, jumps: Edges) -> LineSegments:
    """Mark the ends that are edge points (§3.2) and put those of angle edges into the corner.

    Departure: the text leaves the end points where beams happened to fall, up to a beam's spacing
    from the corner, which would make the lengths of complete line segments depend on the pose.
    """
    s, e = L.s.copy(), L.e.copy()
    s_is_edge, e_is_edge = np.zeros(len(L), bool), np.zeros(len(L), bool)
    e[corners.lines[:, 0]] = corners.point
    s[corners.lines[:, 1]] = corners.point
    for edges in (corners, jumps):
        ending, starting = edges.lines[:, 0], edges.lines[:, 1]
        e_is_edge[ending[ending != NONE]] = True
        s_is_edge[starting[starting != NONE]] = True
    return replace(L, s=s, e=e, s_is_edge=s_is_edge, e_is_edge=e_is_edge)


def _passes_behind(
    L: LineSegments, k: int, index: int, sweep: Sweep, config: PrimitiveConfig
) -> bool:
    """Did beam `index` return from further away than its projection on line k?"""
    beam = sweep.beam(index)
    if beam is None or not math.isfinite(sweep.ranges[beam]):
        return False
    bearing = sweep.angle_min + beam * sweep.angle_increment
    across = math.sin(bearing - float(L.directions[k]))
    projection = float(L.offsets[k]) / across if abs(across) > 1e-9 else math.inf
    r = float(sweep.ranges[beam])
    return 0.0 < projection < math.inf and r > projection + 3.0 * config.sigma + 0.05 + 0.005 * r

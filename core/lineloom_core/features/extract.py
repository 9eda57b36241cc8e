"""Line segments, end points, edges (thesis chapter 3) and circles of one scan."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.features import _circle_kernels, _kernels
from lineloom_core.parameters import parameter
from lineloom_core.scan import Scan

CHORD_REACH = 0.09
"""How far off a circle [m] the ends and middle of its chords lie: the split threshold and noise."""


@storable("extraction-config", shared=True)
@dataclass(frozen=True, slots=True)
class ExtractionConfig:
    """Line segments, corners and circles of a scan (thesis chapter 3)."""

    sigma: float = parameter(0.015, "m", "range noise of the lidar", 1e-4, 1.0)
    break_angle: float = parameter(
        math.radians(8.0),
        "rad",
        "flattest incidence still taken for one surface (lambda)",
        0.0,
        1.5,
    )
    split: float = parameter(0.065, "m", "threshold t of Algorithm 1", 1e-3, 10.0)
    merge_factor: float = parameter(
        0.8, "", "neighbours are collinear whose joint deviation is below this times `split`"
    )
    min_points: int = parameter(5, "points", "fewest of a line", 2)
    min_length: float = parameter(0.2, "m", "shortest line")
    max_gap_beams: int = parameter(6, "beams", "without a return that do not break a surface")
    max_gap: float = parameter(
        0.3, "m", "how far apart collinear runs may lie to be one line all the same"
    )
    corner_reach: float = parameter(
        0.35, "m", "how far a corner may lie from the ends of its two lines"
    )
    min_circle_points: int = parameter(7, "points", "fewest of a circle", 3)


@storable("scan-features")
@dataclass(frozen=True, eq=False)
class ScanFeatures:
    """What a scan shows, in the laser's frame; n lines in counter-clockwise order (Table 3.1).

    lines: (n, 12): x1, y1, x2, y2 [m], direction [rad] and signed offset [m] along the left
        normal, length [m], variances of direction [rad^2] and of the offset at the centroid
        [m^2], number of points, first and last beam. Oriented: scanned from 1 to 2, so the free
        side lies on the left and directions span the full 360 degrees (§4.3).
    ends: (n, 2) INTERIOR, EDGE or UNKNOWN for start and end (§3.2). edges: (n, 2, 2) the corner
        points that go with EDGE ends (§3.3), elsewhere the bare end points.
    circles: (k, 12): centre x, y and radius [m], variances of the centre xx, xy, yy and of the
        radius [m^2], sense (+1 a column seen from outside, -1 a round room from inside), arc that
        is seen [rad], number of points, first and last beam. Their chords are in `lines` too.
    points: (m, 2) finite returns [m], surface by surface; beams: (m,) their indices;
        breaks: (m,) True at the last point of each surface.
    ranges, angle_min, angle_increment: the sweep itself, counter-clockwise, for free-space checks.
    """

    lines: NDArray[np.float64]
    ends: NDArray[np.int64]
    edges: NDArray[np.float64]
    circles: NDArray[np.float64]
    points: NDArray[np.float64]
    beams: NDArray[np.int64]
    breaks: NDArray[np.bool_]
    ranges: NDArray[np.float64]
    angle_min: float
    angle_increment: float

    def __len__(self) -> int:
        return int(self.lines.shape[0])

    @property
    def wall(self) -> float:
        """Metres of surface that the points stand for: what lies between neighbouring beams."""
        return float(np.hypot(self.points[:, 0], self.points[:, 1]).sum() * self.angle_increment)

    def straight(self) -> ScanFeatures:
        """These features without the lines that are chords of a circle; the same if there is none.

        A chord lies where the split happened to fall: seen from elsewhere it is another one.
        """
        if len(self.circles) == 0:
            return self
        kept = ~_circle_kernels.chords(self.lines, self.circles, CHORD_REACH)
        return replace(self, lines=self.lines[kept], ends=self.ends[kept], edges=self.edges[kept])

    def normals(self) -> NDArray[np.float64]:
        """Unit normals of the points towards the free side, (m, 2); zeros where there is none."""
        found: NDArray[np.float64] = _kernels.point_normals(self.points, self.breaks, 3)
        return found


def extract_features(
    scan: Scan, config: ExtractionConfig | None = None, *, inverted: bool = False
) -> ScanFeatures:
    """Extract the features of one scan; `inverted` = the lidar is mounted upside down."""
    config = config or ExtractionConfig()
    if scan.angle_increment < 0 or inverted:
        scan = scan.counter_clockwise(inverted=inverted)
    points, beams, breaks, lines, ends, edges = _kernels.extract(
        scan.ranges,
        scan.angle_min,
        scan.angle_increment,
        config.sigma,
        config.break_angle,
        config.split,
        config.merge_factor,
        config.min_points,
        config.min_length,
        config.max_gap_beams,
        config.max_gap,
        config.corner_reach,
    )
    circles = _circle_kernels.find_circles(
        points, beams, breaks, lines, len(scan.ranges), config.sigma, config.min_circle_points
    )
    return ScanFeatures(
        lines=lines,
        ends=ends,
        edges=edges,
        circles=circles,
        points=points,
        beams=beams,
        breaks=breaks,
        ranges=scan.ranges,
        angle_min=scan.angle_min,
        angle_increment=scan.angle_increment,
    )

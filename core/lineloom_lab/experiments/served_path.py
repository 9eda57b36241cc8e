"""What a running service made of a recording, against the truth (§6.2 over HTTP)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.matching.thesis import Windows, extract_primitives
from lineloom_core.matching.thesis.line_segments import LineSegments
from numpy.typing import NDArray

from lineloom_lab.evaluation.error_area import error_area
from lineloom_lab.evaluation.trajectory import DegenerateTrajectoryError, align_rigid
from lineloom_lab.experiments.contestant import rows
from lineloom_lab.experiments.recording import Recording


@dataclass(frozen=True, eq=False)
class Answered:
    """What a service answered after the n scans of a recording.

    components, poses: of every scan its component and T_component_laser, None where it has none.
    lines: of every component its map, (k, 4) rows x1, y1, x2, y2 [m]. seconds: from the first POST
    until all was in the map.
    """

    components: tuple[str | None, ...]
    poses: tuple[Pose | None, ...]
    lines: dict[str, NDArray[np.float64]]
    seconds: float


@dataclass(frozen=True, eq=False)
class ServedPath:
    """The answer beside the recording; errors are of the scans of the largest component.

    key, label, colour: of the matcher, as of `Contestant`.
    """

    key: str
    label: str
    colour: str
    recording: Recording
    answered: Answered

    @cached_property
    def largest(self) -> str | None:
        """The component of most scans, None where no scan has any."""
        counts = Counter(c for c in self.answered.components if c is not None)
        return counts.most_common(1)[0][0] if counts else None

    @cached_property
    def estimated(self) -> dict[int, Pose]:
        """T_component_laser of the largest component's scans by their number."""
        return {
            i: pose
            for i, (c, pose) in enumerate(
                zip(self.answered.components, self.answered.poses, strict=True)
            )
            if c == self.largest and pose is not None
        }

    @cached_property
    def T_world_first(self) -> Pose:
        """T_world_component that puts the first of its scans where it was taken, as §6.2 does."""
        if not self.estimated:
            return Pose.identity()
        first = min(self.estimated)
        return self.recording.poses[first] @ self.estimated[first].inverse()

    @cached_property
    def T_world_best(self) -> Pose:
        """T_world_component that leaves the least squared error; of one place, the first's."""
        estimated, true = self._arrays()
        try:
            return align_rigid(estimated, true)
        except DegenerateTrajectoryError:
            return self.T_world_first

    def errors(self, T_world_component: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Errors of position [m] and heading [rad] by scan of the largest component."""
        estimated, true = self._arrays()
        placed = T_world_component.transform(estimated[:, :2])
        turned = wrap_array(estimated[:, 2] + T_world_component.theta - true[:, 2])
        return np.hypot(*(placed - true[:, :2]).T), np.abs(turned)

    @cached_property
    def percentages(self) -> NDArray[np.float64]:
        """Error area percentage of consecutive scans, both of the largest component (§6.3)."""
        windows, scans = Windows(), self.recording.scans
        L = {i: extract_primitives(scans[i]).L for i in self.estimated}
        found = []
        for i in sorted(self.estimated):
            if i + 1 in self.estimated:
                T = self.estimated[i].between(self.estimated[i + 1])
                pairs = lying_on(L[i], L[i + 1].moved(T), windows)
                found.append(error_area(rows(L[i]), rows(L[i + 1]), pairs, T).percentage)
        return np.array(found)

    def map_lines(self) -> NDArray[np.float64]:
        """The largest component's map in the world frame, (k, 4) [m]."""
        lines = self.answered.lines.get(self.largest or "", np.zeros((0, 4)))
        return self.T_world_best.transform(lines.reshape(-1, 2)).reshape(-1, 4)

    def figures(self) -> dict[str, float]:
        """Return what a script wants to know; metres, radians, percent, seconds.

        Errors only where a scan is placed, the error area only where two in a row are.
        """
        found: dict[str, float] = {
            "scans": len(self.recording),
            "placed": sum(c is not None for c in self.answered.components),
            "components": len({c for c in self.answered.components if c is not None}),
            "in_largest": len(self.estimated),
            "seconds_per_scan": self.answered.seconds / len(self.recording),
        }
        if not self.estimated:
            return found
        (first, turned), (best, _) = map(self.errors, (self.T_world_first, self.T_world_best))
        lines = self.map_lines()
        spread = np.ptp(lines.reshape(-1, 2), axis=0) if len(lines) else np.zeros(2)
        found |= {
            "error_from_first_max": float(first.max()),
            "error_from_first_mean": float(first.mean()),
            "rotation_from_first_max": float(turned.max()),
            "error_max": float(best.max()),
            "error_mean": float(best.mean()),
            "map_lines": len(lines),
            "map_length": float(spread.max()),
            "map_width": float(spread.min()),
        }
        shares = self.percentages[np.isfinite(self.percentages)]
        if len(shares):
            found["error_area_percentage_median"] = float(np.median(shares))
            found["error_area_percentage_mean"] = float(shares.mean())
        return found

    def _arrays(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        numbers = sorted(self.estimated)
        estimated = np.array([self.estimated[i].to_array() for i in numbers]).reshape(-1, 3)
        true = np.array([self.recording.poses[i].to_array() for i in numbers]).reshape(-1, 3)
        return estimated, true


def lying_on(r: LineSegments, c: LineSegments, windows: Windows) -> Sequence[tuple[int, int]]:
    """Pairs (k, m) of line segments that lie on each other, both in the frame of S_r.

    Within the windows that §6.3.1 checks aligned pairs by, 5 degrees and 10 cm; of several the one
    that l_m shares most of its length with.
    """
    u = np.column_stack([np.cos(r.directions), np.sin(r.directions)])
    turned = np.abs(wrap_array(c.directions[None, :] - r.directions[:, None]))
    middle = 0.5 * (c.s + c.e)[None, :, :] - r.s[:, None, :]
    apart = np.abs(u[:, None, 0] * middle[..., 1] - u[:, None, 1] * middle[..., 0])
    start = np.einsum("kd,kmd->km", u, c.s[None] - r.s[:, None])
    end = np.einsum("kd,kmd->km", u, c.e[None] - r.s[:, None])
    shared = np.minimum(end, r.lengths[:, None]) - np.maximum(start, 0.0)
    shared[(turned > windows.angle) | (apart > windows.distance)] = -math.inf
    if not shared.size:
        return []
    best = shared.argmax(axis=0)
    return [(int(k), m) for m, k in enumerate(best.tolist()) if shared[k, m] > 0.0]

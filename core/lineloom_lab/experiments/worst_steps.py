"""The worst steps of a mapped log, drawn: both scans as the map lays them, and as they truly lie.

Wrong steps are drawn furthest off first; breaks, where the map does not tie a scan to the one
before it, by how much the two have in common.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lineloom_core.geometry import Pose, se2
from lineloom_core.scan import Scan
from scipy.spatial import cKDTree

from lineloom_lab.evaluation.log_bench import LogCase
from lineloom_lab.evaluation.log_bench_judge import PlacedRobot
from lineloom_lab.evaluation.log_bench_log import Recording
from lineloom_lab.evaluation.log_bench_steps import BadStep, broken_steps, wrong_steps
from lineloom_lab.experiments.figure import Figure, grid
from lineloom_lab.experiments.overlay import overlay
from lineloom_lab.experiments.plan import Plan

_NEAR_M = 0.3
_REACH_QUANTILE, _LEAST_REACH_M, _MOST_REACH_M = 0.75, 3.0, 20.0


@dataclass(frozen=True, slots=True)
class StepAlbum:
    """Draws the worst steps of every run into a folder that exists; see `log_bench.Witness`."""

    folder: Path

    def __call__(
        self, case: LogCase, robots: Sequence[Recording], placed: Sequence[PlacedRobot]
    ) -> None:
        """Write a page of wrong steps and one of breaks, SVG and PNG, where there are any."""
        name = f"{case.source.name}, {case.setting.name}"
        for figure in draw_worst_steps(name, robots, placed):
            figure.save(self.folder)


def draw_worst_steps(
    name: str, robots: Sequence[Recording], placed: Sequence[PlacedRobot], most: int = 10
) -> list[Figure]:
    """Draw the `most` worst of either kind, one a row: as the map has it, as it is."""
    wrong, breaks = wrong_steps(placed), broken_steps(placed)
    breaks.sort(key=lambda step: -_overlap(step, robots[step.robot]))
    file = name.replace(",", "").replace(" ", "-")
    figures = []
    for kind, steps in (("wrong steps", wrong), ("breaks", breaks)):
        panels = [p for s in steps[:most] for p in _panels(s, robots[s.robot], placed[s.robot])]
        if panels:
            figures.append(
                Figure(
                    f"{kind.replace(' ', '-')}-{file}",
                    f"{name}: the worst of {len(steps)} {kind}",
                    "Side by side: two scans in a row as mapped, and as they truly lie.",
                    grid(panels, 2),
                    420.0,
                )
            )
    return figures


def overlap_share(reference: Scan, current: Scan, T_ref_cur: Pose) -> float:
    """Return the share of the current scan's points that lie within 0.3 m of the reference's."""
    a, b = reference.points(), T_ref_cur.transform(current.points())
    if not len(a) or not len(b):
        return 0.0
    distance, _ = cKDTree(a).query(b, distance_upper_bound=_NEAR_M)
    return float(np.mean(np.isfinite(distance)))


def _panels(step: BadStep, robot: Recording, placed: PlacedRobot) -> list[Plan]:
    i = step.index
    before, after = robot.scans[i], robot.scans[i + 1]
    truth = Pose(*se2.between(robot.reference[i], robot.reference[i + 1]).tolist())
    told = f"{robot.robot} {i} to {i + 1}, {after.stamp - before.stamp:.2f} s"
    believed = None
    if step.off_m is None or step.off_rad is None:
        said = f"{told}: {_why_not(placed, i)}"
    else:
        believed = Pose(*se2.between(placed.poses[i], placed.poses[i + 1]).tolist())
        said = f"{told}: off by {step.off_m:.2f} m, {math.degrees(step.off_rad):.1f} degrees"
    share = _overlap(step, robot)
    true = (
        f"true: {math.hypot(truth.x, truth.y):.2f} m, {math.degrees(truth.theta):.0f} degrees, "
        f"overlap {100 * share:.0f} %"
    )
    reach = _reach(before, after)
    return [
        overlay(said, before, after, believed, reach),
        overlay(true, before, after, truth, reach),
    ]


def _overlap(step: BadStep, robot: Recording) -> float:
    i = step.index
    truth = Pose(*se2.between(robot.reference[i], robot.reference[i + 1]).tolist())
    return overlap_share(robot.scans[i], robot.scans[i + 1], truth)


def _why_not(placed: PlacedRobot, index: int) -> str:
    missing = [i for i in (index, index + 1) if not placed.placed[i]]
    if missing:
        return f"{' and '.join(map(str, missing))} unplaced"
    return "in two components"


def _reach(before: Scan, after: Scan) -> float:
    """Return how far most of what either lidar saw lies [m]."""
    ranges = np.concatenate([before.ranges, after.ranges])
    ranges = ranges[np.isfinite(ranges)]
    far = float(np.quantile(ranges, _REACH_QUANTILE)) if len(ranges) else 0.0
    return min(max(far, _LEAST_REACH_M), _MOST_REACH_M)

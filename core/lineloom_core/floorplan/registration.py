"""Registering a map to a floor plan, without any guess; or saying why it cannot be done.

1. hypotheses: everywhere in the plan that wall lies on wall (`correlation`);
2. each refined and judged in both directions: the map's walls on the plan's, and the plan's walls
   against the free space that was seen (`fit`);
3. accepted only where enough is explained, little is contradicted, both directions are held, and
   no other place in the plan does nearly as well: a symmetric building has two answers, so none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lineloom_core.floorplan.fit import Fit, Judge
from lineloom_core.floorplan.plan import FloorPlan, lengths
from lineloom_core.floorplan.samples import Samples
from lineloom_core.fusion.occupancy import OccupancyGrid
from lineloom_core.geometry import Pose, wrap

Verdict = Literal["registered", "ambiguous", "none"]

_LEAST_WALL_M = 15.0
_LEAST_EXPLAINED = 0.5
_MOST_MISSING = 0.2
_LEAST_ACROSS_M = 3.0
_LEAST_MARGIN = 0.35
"""Of a map that is explained whole; the less is explained, the more must the next be worse. Maps
of simulated floors in plans of other floors reach 0.27, in their own 0.45 and more."""
_LEAST_MARGIN_M = 4.0
_APART_M = 1.0
_APART_RAD = math.radians(10.0)
_REFINED = 48
_NAMED = 4
_PLAN_SPACING_M = 0.1
_SITE_SPACING_M = 0.2
_MOST_SAMPLES = 400_000
_LEAST_LINE_M = 0.3
_ODD_EXTENT_M = (3.0, 1000.0)


@dataclass(frozen=True)
class Registration:
    """verdict: "registered": T_plan_map holds; "ambiguous": several places do as well as each
    other; "none": the map fits nowhere. best: the best fit there was, whatever the verdict. rivals:
    poses that do nearly as well. margin: by how much the best is better than the next, 0..1."""

    verdict: Verdict
    T_plan_map: Pose | None
    reason: str
    best: Fit | None = None
    rivals: tuple[Pose, ...] = ()
    margin: float = 0.0


def judge_of(plan: FloorPlan, lines: NDArray[np.float64], grid: OccupancyGrid) -> Judge:
    """Prepare the comparison of a map's lines (n, 4) [m] and its free space with a plan."""
    kept = np.flatnonzero(lengths(lines) >= _LEAST_LINE_M)
    site = Samples.of(lines[kept], _SITE_SPACING_M)
    spacing = max(_PLAN_SPACING_M, float(lengths(plan.lines).sum()) / _MOST_SAMPLES)
    return Judge(
        plan=Samples.of(plan.lines, spacing), site=replace(site, line=kept[site.line]), grid=grid
    )


def register(plan: FloorPlan, lines: NDArray[np.float64], grid: OccupancyGrid) -> Registration:
    """Find the map in the plan. lines (n, 4) and grid in the map's frame [m].

    A map that has no place is tried against the plan's mirror image too, to say so if that is it.
    """
    found = _search(plan, lines, grid)
    if found.verdict != "none" or found.best is None:
        return found
    mirrored = FloorPlan.of(plan.lines * np.array([1.0, -1.0, 1.0, -1.0]))
    if _search(mirrored, lines, grid).verdict != "registered":
        return found
    advice = "mirrored it would fit: is the plan drawn mirrored, or the lidar upside down?"
    return replace(found, reason=f"{found.reason}; {advice}")


def _search(plan: FloorPlan, lines: NDArray[np.float64], grid: OccupancyGrid) -> Registration:
    # Here, so that a service that starts need not wait for SciPy.
    from lineloom_core.floorplan.correlation import hypotheses

    if not _ODD_EXTENT_M[0] <= plan.extent <= _ODD_EXTENT_M[1]:
        return _none(f"the plan measures {plan.extent:.4g} m: is it in metres?")
    judge = judge_of(plan, lines, grid)
    seen = float(judge.site.weight.sum())
    if seen < _LEAST_WALL_M:
        return _none(f"only {seen:.0f} m of wall are mapped, {_LEAST_WALL_M:g} m are needed")
    fits = [
        judge.judge(judge.refine(h.T_plan_map))
        for h in hypotheses(judge.plan, judge.site)[:_REFINED]
    ]
    best = max(fits, key=lambda f: f.support)
    refusal = _refusal(best)
    if refusal is not None:
        return _none(refusal, best)
    others = [f for f in fits if _apart(f.T_plan_map, best.T_plan_map)]
    margin = 1.0 - max([0.0, *(f.support for f in others)]) / best.support
    needed = max(_LEAST_MARGIN / best.share_explained, _LEAST_MARGIN_M / best.support)
    if margin < needed:
        rivals = _distinct([f for f in others if f.support > (1.0 - needed) * best.support])
        return Registration("ambiguous", None, _places(best, rivals, margin), best, rivals, margin)
    reason = (
        f"{best.share_explained:.0%} of the mapped walls lie on the plan's, "
        f"{margin:.0%} more than anywhere else"
    )
    return Registration("registered", best.T_plan_map, reason, best, (), margin)


def follow(judge: Judge, known: Registration) -> Registration | None:
    """Carry a registration over to a map that has grown since; None where it no longer holds."""
    if known.T_plan_map is None:
        return None
    fit = judge.judge(judge.refine(known.T_plan_map))
    if _refusal(fit) is not None or _apart(fit.T_plan_map, known.T_plan_map):
        return None
    return Registration("registered", fit.T_plan_map, known.reason, fit, (), known.margin)


def _refusal(fit: Fit) -> str | None:
    """Return why a fit is not good enough, None where it is."""
    if fit.share_explained < _LEAST_EXPLAINED:
        return (
            f"nowhere in the plan do more than {fit.share_explained:.0%} of the mapped walls lie "
            f"on walls of the plan ({_LEAST_EXPLAINED:.0%} are needed)"
        )
    if fit.share_missing > _MOST_MISSING:
        return (
            f"at the best place the robots looked through {fit.share_missing:.0%} of the plan's "
            f"walls that they could judge (at most {_MOST_MISSING:.0%} may be)"
        )
    if fit.across < _LEAST_ACROSS_M:
        return "the mapped walls are nearly all parallel: nothing fixes the place along them"
    return None


def _none(reason: str, best: Fit | None = None) -> Registration:
    return Registration("none", None, reason, best)


def _places(best: Fit, rivals: tuple[Pose, ...], margin: float) -> str:
    where = ", ".join(
        f"({p.x:.1f}, {p.y:.1f}, {math.degrees(p.theta):.0f} deg)"
        for p in (best.T_plan_map, *rivals[:_NAMED])
    )
    return (
        f"{1 + len(rivals)} places in the plan fit nearly as well as each other (the best is "
        f"{margin:.0%} better): {where}. Map more, or a part that looks like no other"
    )


def _apart(a: Pose, b: Pose) -> bool:
    return a.distance(b) > _APART_M or abs(wrap(a.theta - b.theta)) > _APART_RAD


def _distinct(fits: list[Fit]) -> tuple[Pose, ...]:
    kept: list[Pose] = []
    for fit in sorted(fits, key=lambda f: -f.support):
        if all(_apart(fit.T_plan_map, pose) for pose in kept):
            kept.append(fit.T_plan_map)
    return tuple(kept)

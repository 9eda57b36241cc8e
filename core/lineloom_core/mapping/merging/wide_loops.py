"""Loops found by place recognition within one component.

A candidate is believed when the drift allows it and another candidate corrects the graph alike,
or when it moves things by little. What the solved graph then does not bear out is withdrawn.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.checks import DOUBTED, WIDE_LOOP
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.mapping.belief.constraint import CONSTRAINT_FLOOR, Constraint
from lineloom_core.mapping.belief.graph_drift import Drifts
from lineloom_core.mapping.belief.refusals import refuse_barred
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.facts.drift import reach
from lineloom_core.places import Place


def close_wide_loops(site: SiteMap, place: Place) -> bool:
    """Accept loop candidates that agree with the graph's drift and with each other."""
    root = site.component_root(place.anchor)
    candidates = [
        c
        for c in site.constraints.values()
        if c.state == "candidate"
        and site.component_root(c.keyframe_a) == root
        and site.component_root(c.keyframe_b) == root
    ]
    candidates = refuse_barred(site, candidates)
    drifts = site.drifts(k for c in candidates for k in (c.keyframe_a, c.keyframe_b))
    # All are judged by the graph as it was: accepting one changes what the drift allows the next.
    corrections = {c.id: _in_the_map(site, c) for c in candidates}
    judged = [_judged(site, c, candidates, corrections, drifts) for c in candidates]
    believed = [c for c in judged if c.consistency_set]
    for c in believed:
        site.add_constraint(c)
    if believed:
        site.optimise(root)
        _drop_contradicted(site, candidates, root)
    return bool(believed)


def _judged(
    site: SiteMap,
    c: Constraint,
    candidates: list[Constraint],
    corrections: dict[str, Pose],
    drifts: Drifts,
) -> Constraint:
    """The candidate with its figures, accepted where nothing speaks against it."""
    config, off = site.config.wide_loops, _correction(site, c)
    figures = {"drift_sigmas": _sigmas(c, off, drifts), **_corrected(off)}
    agreeing: list[str] = []
    if not WIDE_LOOP.against(config, figures):
        others = (o for o in candidates if o.id != c.id)
        agreeing = [o.id for o in others if _loops_agree(site, c, o, corrections, drifts)]
        figures["agreeing"] = float(len(agreeing))
    c = c.with_figures(figures)
    objection = WIDE_LOOP.objection(config, figures)
    if objection:
        return c.moved_to("candidate", objection, site.now)
    ids = tuple(sorted([c.id, *agreeing]))
    return c.moved_to("accepted", "within the drift and confirmed", site.now, consistency_set=ids)


def _correction(site: SiteMap, c: Constraint) -> Pose:
    """What the constraint says besides the graph: T_a_b measured to T_a_b estimated."""
    return c.T_a_b.between(site.pose(c.keyframe_a).between(site.pose(c.keyframe_b)))


def _corrected(off: Pose) -> dict[str, float]:
    return {"corrected_m": math.hypot(off.x, off.y), "corrected_rad": abs(off.theta)}


def _sigmas(c: Constraint, off: Pose, drifts: Drifts) -> float:
    """The correction against the drift in between."""
    error = off.to_array()
    covariance = drifts(c.keyframe_a, c.keyframe_b) + CONSTRAINT_FLOOR
    return math.sqrt(float(error @ np.linalg.solve(covariance, error)))


def _loops_agree(
    site: SiteMap, c: Constraint, o: Constraint, corrections: dict[str, Pose], drifts: Drifts
) -> bool:
    """Two loops agree when they correct the graph alike, give or take the drift in between."""
    if {c.place_a, c.place_b} & {o.place_a, o.place_b} == {c.place_a, c.place_b}:
        return False
    config, at = site.config.wide_loops, site.pose(c.keyframe_b)
    off = (corrections[c.id] @ at).between(corrections[o.id] @ at)
    if abs(angle_difference(off.theta, 0.0)) >= config.turn:
        return False
    apart = math.hypot(off.x, off.y)
    if apart < config.slack:
        return True
    slack = (
        config.slack
        + reach(drifts(c.keyframe_a, o.keyframe_a), config.most_sigmas)
        + reach(drifts(c.keyframe_b, o.keyframe_b), config.most_sigmas)
    )
    return apart < slack


def _in_the_map(site: SiteMap, c: Constraint) -> Pose:
    """The correction as what it moves in the map's frame at the newer end."""
    return site.pose(c.keyframe_a) @ c.T_a_b @ site.pose(c.keyframe_b).inverse()


def _drop_contradicted(site: SiteMap, candidates: list[Constraint], root: int) -> None:
    """Reject again what the optimised graph does not bear out."""
    dropped = False
    for c in (site.constraints[candidate.id] for candidate in candidates):
        off = _correction(site, c)
        strain = {"strain_m": math.hypot(off.x, off.y), "strain_rad": abs(off.theta)}
        objection = DOUBTED.objection(site.config.doubt, strain)
        if c.state == "accepted" and objection:
            site.add_constraint(c.with_figures(strain).moved_to("rejected", objection, site.now))
            dropped = True
    if dropped:
        site.optimise(root)

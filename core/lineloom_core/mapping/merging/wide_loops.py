"""Loops found by place recognition within one component.

A candidate is believed when the drift allows it and another candidate corrects the graph alike,
or when it moves things by little. What the solved graph then does not bear out is withdrawn.
"""

from __future__ import annotations

import numpy as np

from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.mapping.belief.constraint import CONSTRAINT_FLOOR, Constraint
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
    # All are judged by the graph as it was: accepting one changes what the drift allows the next.
    judged = [(c, _confirmed(site, c, candidates)) for c in candidates]
    believed = [(c, agreeing) for c, agreeing in judged if agreeing is not None]
    for c, agreeing in believed:
        ids = tuple(sorted([c.id, *(o.id for o in agreeing)]))
        site.add_constraint(
            c.moved_to("accepted", "within the drift and confirmed", site.now, consistency_set=ids)
        )
    if believed:
        site.optimise(root)
        _drop_contradicted(site, [c.id for c in candidates], root)
    return bool(believed)


def _confirmed(
    site: SiteMap, c: Constraint, candidates: list[Constraint]
) -> list[Constraint] | None:
    """The others that agree with a candidate; None where it is not to be believed."""
    if not _within_drift(site, c):
        return None
    agreeing = [o for o in candidates if o.id != c.id and _loops_agree(site, c, o)]
    return agreeing if agreeing or _small_step(site, c) else None


def _correction(site: SiteMap, c: Constraint) -> Pose:
    """What the constraint says besides the graph: T_a_b measured to T_a_b estimated."""
    return c.T_a_b.between(site.pose(c.keyframe_a).between(site.pose(c.keyframe_b)))


def _within_drift(site: SiteMap, c: Constraint) -> bool:
    off = _correction(site, c).to_array()
    covariance = site.drift(c.keyframe_a, c.keyframe_b) + CONSTRAINT_FLOOR
    return float(off @ np.linalg.solve(covariance, off)) < site.config.join.loop_gate**2


def _small_step(site: SiteMap, c: Constraint) -> bool:
    off = _correction(site, c)
    return bool(np.hypot(off.x, off.y) < 0.5 and abs(off.theta) < 0.08)


def _loops_agree(site: SiteMap, c: Constraint, o: Constraint) -> bool:
    """Two loops agree when they correct the graph alike, give or take the drift in between."""
    if {c.place_a, c.place_b} & {o.place_a, o.place_b} == {c.place_a, c.place_b}:
        return False
    T_c, T_o = (
        site.pose(k.keyframe_a) @ k.T_a_b @ site.pose(k.keyframe_b).inverse() for k in (c, o)
    )
    at = site.pose(c.keyframe_b)
    off = (T_c @ at).between(T_o @ at)
    slack = (
        0.3
        + reach(site.drift(c.keyframe_a, o.keyframe_a))
        + reach(site.drift(c.keyframe_b, o.keyframe_b))
    )
    return bool(np.hypot(off.x, off.y) < slack and abs(angle_difference(off.theta, 0.0)) < 0.1)


def _drop_contradicted(site: SiteMap, ids: list[str], root: int) -> None:
    """Withdraw accepted constraints that the optimised graph does not bear out."""
    dropped = False
    for constraint_id in ids:
        c = site.constraints[constraint_id]
        if c.state != "accepted":
            continue
        off = _correction(site, c)
        if np.hypot(off.x, off.y) > 0.4 or abs(off.theta) > 0.1:
            site.add_constraint(c.moved_to("rejected", "the graph contradicts it", site.now))
            dropped = True
    if dropped:
        site.optimise(root)

"""From candidates to believed constraints: nothing is joined on a single match.

Steps of `consider`: 1. recognise the new place among the others; 2. keep what passes as
candidates; 3. find the largest set of candidates that agree pairwise (PCM); 4. demand its size,
its evidence, and that no other set rivals it; 5. hold both maps against each other wherever they
would overlap; 6. accept, join, optimise; 7. throw out what the graph then contradicts.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.graph import consistent_sets, pairwise_consistent, rigid_join
from lineloom_core.mapping.changes import ComponentMerged
from lineloom_core.mapping.constraint import Constraint, closure_information, turned
from lineloom_core.mapping.site_map import SiteMap
from lineloom_core.places import Place, Recognition, recognise
from lineloom_core.places.recognition import count_points

CONSTRAINT_FLOOR = np.diag([0.05**2, 0.05**2, 0.01**2])
"""How far two right constraints may disagree besides drift."""


def consider(site: SiteMap, place: Place) -> tuple[list[ComponentMerged], bool]:
    """Look for a new place among all others; return the merges and whether poses moved."""
    fresh = [found for other in _worth_trying(site, place) if (found := _try(site, other, place))]
    for constraint in fresh:
        site.add_constraint(constraint)
    merges: list[ComponentMerged] = []
    moved = False
    roots = sorted({site.component_root(c.keyframe_a) for c in fresh})
    for root in roots:
        if root == site.component_root(place.anchor):
            moved = _close_loops(site, place) or moved
        else:
            merged = _join(site, root, place.anchor)
            if merged is not None:
                merges.append(merged)
                moved = True
    return merges, moved


def _worth_trying(site: SiteMap, place: Place) -> list[Place]:
    """Other components' places, and those of this one that may be here, given the drift."""
    tied = any(
        edge.kind != "sequential"
        for keyframe in place.keyframes
        for edge in site.graph.edges_at(keyframe)
    )
    chosen = []
    for other in site.places.values():
        if other.id == place.id:
            continue
        if not site.same_component(other.anchor, place.anchor):
            chosen.append(other)
            continue
        if tied or (other.track == place.track and not _lies_apart(site, other, place)):
            continue
        distance = site.pose(other.anchor).distance(site.pose(place.anchor))
        slack = 3.0 * site.config.join.drift_rate[0] * site.way_between(other.anchor, place.anchor)
        if distance < 4.0 + slack:
            chosen.append(other)
    return chosen


def _lies_apart(site: SiteMap, other: Place, place: Place) -> bool:
    driven = site.driven_between(other.anchor, place.anchor)
    return driven > site.config.closure.apart + site.config.places.span


def _try(site: SiteMap, reference: Place, current: Place) -> Constraint | None:
    """Recognise one place in another; a plausible outcome becomes a candidate."""
    found = recognise(reference, current, site.config.recognition)
    if not found.plausible or found.T_reference_current is None:
        return None
    same = site.same_component(reference.anchor, current.anchor)
    a, b, T_a_b = _nearest_keyframes(reference, current, found.T_reference_current)
    return Constraint(
        id=site.new_constraint_id(),
        kind="loop" if same else "rendezvous",
        state="candidate",
        keyframe_a=a,
        keyframe_b=b,
        T_a_b=T_a_b,
        information=_information_at(found, current, b),
        reason="waiting for others that agree",
        checks=found.checks,
        place_a=reference.id,
        place_b=current.id,
        evidence=found.evidence,
    )


def _nearest_keyframes(
    reference: Place, current: Place, T_reference_current: Pose
) -> tuple[int, int, Pose]:
    """The two keyframes that came nearest to each other: least lever, least drift inside."""
    best: tuple[float, int, int, Pose] | None = None
    for ka, pa in zip(reference.keyframes, reference.poses, strict=True):
        for kb, pb in zip(current.keyframes, current.poses, strict=True):
            there = T_reference_current @ pb
            d = pa.distance(there)
            if best is None or d < best[0]:
                best = d, ka, kb, pa.between(there)
    assert best is not None
    return best[1], best[2], best[3]


def _information_at(found: Recognition, current: Place, keyframe: int) -> NDArray[np.float64]:
    """Move the information from the current place's anchor to one of its keyframes."""
    assert found.T_reference_current is not None
    at_anchor = turned(found.information, found.T_reference_current.theta)
    T_anchor_keyframe = current.poses[current.keyframes.index(keyframe)]
    # xi_anchor = Ad(T_anchor_keyframe) xi_keyframe for a rigid place.
    A = T_anchor_keyframe.adjoint()
    return closure_information(A.T @ at_anchor @ A)


def _join(site: SiteMap, root: int, keyframe: int) -> ComponentMerged | None:
    """Join the component of `keyframe` with that of `root` if a set of candidates convinces."""
    other_root = site.component_root(keyframe)
    a_root, b_root = min(root, other_root), max(root, other_root)
    candidates = _candidates_between(site, a_root, b_root)
    chosen, rival = _best_sets(site, candidates)
    objection = _objection_to_set(site, chosen, rival)
    if objection:
        return None
    members_a = {n: site.pose(n) for n in site.graph.component_of(a_root)}
    members_b = {n: site.pose(n) for n in site.graph.component_of(b_root)}
    T_A_B = rigid_join(members_a, members_b, [c.edge() for c in chosen])
    share = _conflict_share(site, a_root, b_root, T_A_B)
    if share > site.config.join.most_conflict:
        return None
    survivor, absorbed = site.component_id(a_root), site.component_id(b_root)
    site.graph.move_component(b_root, T_A_B)
    ids = tuple(c.id for c in chosen)
    for constraint in chosen:
        accepted = constraint.moved_to(
            "accepted", f"{len(ids)} constraints agree", consistency_set=ids
        )
        site.add_constraint(replace(accepted, checks={**accepted.checks, "map_conflict": share}))
    _drop_others(site, candidates, chosen)
    site.optimise(a_root)
    site.merged_into[absorbed] = survivor
    return ComponentMerged(survivor, absorbed, ids)


def _candidates_between(site: SiteMap, a_root: int, b_root: int) -> list[Constraint]:
    """Open candidates between two components, best first, each leading from a to b."""
    found = []
    for c in site.constraints.values():
        if c.state != "candidate":
            continue
        ra, rb = site.component_root(c.keyframe_a), site.component_root(c.keyframe_b)
        if (ra, rb) == (a_root, b_root):
            found.append(c)
        elif (ra, rb) == (b_root, a_root):
            found.append(_turned_round(c))
    found.sort(key=lambda c: (-c.evidence, c.id))
    return found[: site.config.join.most_candidates]


def _turned_round(c: Constraint) -> Constraint:
    # A tangent at b is -Ad(T_a_b) of itself at a: the information goes along.
    A = c.T_a_b.inverse().adjoint()
    return replace(
        c,
        keyframe_a=c.keyframe_b,
        keyframe_b=c.keyframe_a,
        T_a_b=c.T_a_b.inverse(),
        information=A.T @ c.information @ A,
        place_a=c.place_b,
        place_b=c.place_a,
    )


def _best_sets(
    site: SiteMap, candidates: list[Constraint]
) -> tuple[list[Constraint], list[Constraint]]:
    """The largest set of candidates that agree with each other, and the next one."""
    if not candidates:
        return [], []
    n = len(candidates)
    T_A_a = np.array([site.pose(c.keyframe_a).to_array() for c in candidates])
    T_B_b = np.array([site.pose(c.keyframe_b).to_array() for c in candidates])
    T_a_b = np.array([c.T_a_b.to_array() for c in candidates])
    agree = pairwise_consistent(
        T_A_a, T_B_b, T_a_b, np.broadcast_to(CONSTRAINT_FLOOR, (n, 3, 3)),
        lambda i, j: site.drift(candidates[i].keyframe_a, candidates[j].keyframe_a),
        lambda i, j: site.drift(candidates[i].keyframe_b, candidates[j].keyframe_b),
    )  # fmt: skip
    sets = [[candidates[i] for i in members] for members in consistent_sets(agree, least=1)]
    sets.sort(key=lambda s: -sum(c.evidence for c in s))
    return sets[0], sets[1] if len(sets) > 1 else []


def _objection_to_set(site: SiteMap, chosen: list[Constraint], rival: list[Constraint]) -> str:
    """Why a set does not convince; empty where it does."""
    config = site.config.join
    if len(chosen) < config.least_set:
        return "too few constraints agree"
    if len({c.place_a for c in chosen}) < 2 or len({c.place_b for c in chosen}) < 2:
        return "all constraints rest on one place"
    evidence = sum(c.evidence for c in chosen)
    if evidence < config.least_evidence:
        return "too little evidence in all"
    if evidence < config.lead * sum(c.evidence for c in rival):
        return "another set of constraints says something else"
    return ""


def _conflict_share(site: SiteMap, a_root: int, b_root: int, T_A_B: Pose) -> float:
    """Free-space conflict over all places of both components that would overlap."""
    matched = conflict = 0.0
    for a in site.places.values():
        if site.component_root(a.anchor) != a_root:
            continue
        for b in site.places.values():
            if site.component_root(b.anchor) != b_root:
                continue
            T_a_b = site.pose(a.anchor).between(T_A_B @ site.pose(b.anchor))
            if np.hypot(T_a_b.x, T_a_b.y) > site.config.places.span:
                continue
            m, c = count_points(a, b, T_a_b)
            matched += m
            conflict += c
    return conflict / max(matched + conflict, 1.0)


def _drop_others(site: SiteMap, candidates: list[Constraint], chosen: list[Constraint]) -> None:
    kept = {c.id for c in chosen}
    for c in candidates:
        if c.id not in kept:
            stored = site.constraints[c.id]
            site.add_constraint(
                stored.moved_to("rejected", "contradicts the set that was accepted")
            )


def _close_loops(site: SiteMap, place: Place) -> bool:
    """Accept loop candidates that agree with the graph's drift and with each other."""
    root = site.component_root(place.anchor)
    candidates = [
        c
        for c in site.constraints.values()
        if c.state == "candidate"
        and site.component_root(c.keyframe_a) == root
        and site.component_root(c.keyframe_b) == root
    ]
    moved = False
    for c in candidates:
        agreeing = [o for o in candidates if o.id != c.id and _loops_agree(site, c, o)]
        if _within_drift(site, c) and (agreeing or _small_step(site, c)):
            ids = tuple(sorted([c.id, *(o.id for o in agreeing)]))
            site.add_constraint(
                c.moved_to("accepted", "within the drift and confirmed", consistency_set=ids)
            )
            moved = True
    if moved:
        site.optimise(root)
        _drop_contradicted(site, [c.id for c in candidates], root)
    return moved


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
    slack = 0.3 + 3.0 * site.config.join.drift_rate[0] * (
        site.way_between(c.keyframe_a, o.keyframe_a) + site.way_between(c.keyframe_b, o.keyframe_b)
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
            site.add_constraint(c.moved_to("rejected", "the graph contradicts it"))
            dropped = True
    if dropped:
        site.optimise(root)

"""Joining two components: when a set of constraints convinces.

Steps of `join`: 1. leave out what says the same as something barred; 2. find the largest set of
candidates that agree pairwise (PCM); 3. demand its size, its evidence, and that no other set rivals
it; 4. demand that the places it rests on are distinctive: nothing elsewhere in their own component,
where the truth is known, looks as much like them; 5. hold both maps against each other wherever
they would overlap; 6. accept, join, optimise.
"""

from __future__ import annotations

from itertools import islice

import numpy as np

from lineloom_core.checks import JOINED
from lineloom_core.geometry import Pose
from lineloom_core.graph import Trial, consistent_sets, pairwise_consistent, rigid_join
from lineloom_core.mapping.belief.constraint import CONSTRAINT_FLOOR, Constraint, turned_round
from lineloom_core.mapping.belief.refusals import refuse_barred
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.merging.component_merged import ComponentMerged
from lineloom_core.mapping.merging.distinctive import is_distinctive
from lineloom_core.mapping.merging.overlap import overlap_of_sets


def join(site: SiteMap, root: int, keyframe: int) -> ComponentMerged | None:
    """Join the component of `keyframe` with that of `root` if a set of candidates convinces."""
    other_root = site.component_root(keyframe)
    a_root, b_root = min(root, other_root), max(root, other_root)
    candidates = refuse_barred(site, _candidates_between(site, a_root, b_root))
    chosen, rival = _best_sets(site, candidates)
    config, figures = site.config.join, _figures(site, chosen, rival)
    if chosen and not JOINED.against(config, figures):
        figures["set_distinctive"] = float(_distinctive(site, chosen))
    if objection := JOINED.objection(config, figures):
        _wait(site, candidates, objection)
        return None
    T_A_B, trial = _solved_together(site, a_root, b_root, chosen)
    figures |= overlap_of_sets(site, chosen, trial.poses, kin=bool(figures["kin"]))
    if objection := JOINED.objection(config, figures):
        _wait(site, chosen, objection)
        return None
    merged = _accept(site, chosen, b_root, T_A_B, figures)
    site.graph.adopt(trial)
    _drop_others(site, candidates, chosen)
    return merged


def _accept(
    site: SiteMap, chosen: list[Constraint], b_root: int, T_A_B: Pose, figures: dict[str, float]
) -> ComponentMerged:
    """Carry b's component into a's frame and put the set into the graph."""
    survivor, absorbed = (
        site.component_id(k) for k in (chosen[0].keyframe_a, chosen[0].keyframe_b)
    )
    site.move_component(b_root, T_A_B)
    ids = tuple(c.id for c in chosen)
    for constraint in chosen:
        accepted = constraint.moved_to(
            "accepted", f"{len(ids)} constraints agree", site.now, consistency_set=ids
        )
        site.add_constraint(accepted.with_figures(figures))
    site.merged_into[absorbed] = survivor
    return ComponentMerged(survivor, absorbed, ids)


def _figures(site: SiteMap, chosen: list[Constraint], rival: list[Constraint]) -> dict[str, float]:
    """What is had of a set at once; every one of its constraints will show it."""
    places = {c.place_a for c in chosen}, {c.place_b for c in chosen}
    ends = (chosen[0].keyframe_a, chosen[0].keyframe_b) if chosen else ()
    return {
        "set_size": float(len(chosen)),
        "set_places": float(min(map(len, places))),
        "known_places": float(min(map(site.places_in_component, ends), default=0)),
        "set_evidence": float(sum(c.evidence for c in chosen)),
        "rival_evidence": float(sum(c.evidence for c in rival)),
        "kin": float(bool(ends) and site.are_kin(*ends)),
    }


def _wait(site: SiteMap, candidates: list[Constraint], objection: str) -> None:
    """Join nothing yet, and let every candidate say what it waits for."""
    for c in candidates:
        site.add_constraint(site.constraints[c.id].moved_to("candidate", objection, site.now))


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
            found.append(turned_round(c))
    found.sort(key=lambda c: (-c.evidence, c.id))
    return found[: site.config.join.most_candidates]


def _best_sets(
    site: SiteMap, candidates: list[Constraint]
) -> tuple[list[Constraint], list[Constraint]]:
    """The largest set of candidates that agree with each other, and the next one."""
    if not candidates:
        return [], []
    n = len(candidates)
    ends = [c.keyframe_a for c in candidates], [c.keyframe_b for c in candidates]
    T_A_a = np.array([site.pose(c.keyframe_a).to_array() for c in candidates])
    T_B_b = np.array([site.pose(c.keyframe_b).to_array() for c in candidates])
    T_a_b = np.array([c.T_a_b.to_array() for c in candidates])
    agree = pairwise_consistent(
        T_A_a, T_B_b, T_a_b, np.broadcast_to(CONSTRAINT_FLOOR, (n, 3, 3)),
        site.drifts(ends[0]).among(ends[0]), site.drifts(ends[1]).among(ends[1]),
    )  # fmt: skip
    sets = [[candidates[i] for i in members] for members in consistent_sets(agree, least=1)]
    sets.sort(key=lambda s: -sum(c.evidence for c in s))
    return sets[0], sets[1] if len(sets) > 1 else []


def _distinctive(site: SiteMap, chosen: list[Constraint]) -> int:
    """How many of a set stand out, counted up to what it takes.

    Those with most evidence are asked first: each is held against all places of its own maps, a
    thousand of which take seconds.
    """
    found = (
        c for c in sorted(chosen, key=lambda c: (-c.evidence, c.id)) if is_distinctive(site, c)
    )
    return sum(1 for _ in islice(found, site.config.join.least_distinctive))


def _solved_together(
    site: SiteMap, a_root: int, b_root: int, chosen: list[Constraint]
) -> tuple[Pose, Trial]:
    """T_A_B, and all in a's frame as it would be if the set were believed.

    Both maps have drifted: held against each other as rigid pieces, right ones would collide.
    """
    between = [c.edge() for c in chosen]
    T_A_B = rigid_join(
        {c.keyframe_a: site.pose(c.keyframe_a) for c in chosen},
        {c.keyframe_b: site.pose(c.keyframe_b) for c in chosen},
        between,
    )
    return T_A_B, site.graph.solve_joined(a_root, b_root, T_A_B, between)


def _drop_others(site: SiteMap, candidates: list[Constraint], chosen: list[Constraint]) -> None:
    kept = {c.id for c in chosen}
    for c in candidates:
        if c.id not in kept:
            stored = site.constraints[c.id]
            site.add_constraint(
                stored.moved_to("rejected", "contradicts the set that was accepted", site.now)
            )

"""Sets of candidates between two components that tell one story, and how they would lie joined."""

from __future__ import annotations

import numpy as np

from lineloom_core.geometry import Pose
from lineloom_core.graph import Trial, consistent_sets, pairwise_consistent, rigid_join
from lineloom_core.mapping.belief.constraint import CONSTRAINT_FLOOR, Constraint, turned_round
from lineloom_core.mapping.belief.site_map import SiteMap


def candidates_between(site: SiteMap, a_root: int, b_root: int) -> list[Constraint]:
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


def best_sets(
    site: SiteMap, candidates: list[Constraint]
) -> tuple[list[Constraint], list[Constraint]]:
    """The set of candidates that agree with each other and have most evidence, and the next one."""
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


def solved_together(
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

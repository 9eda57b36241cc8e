"""Believing what an operator said, once both keyframes that it is of are there."""

from __future__ import annotations

from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.merging.component_merged import ComponentMerged


def join_said(site: SiteMap, keyframe: int) -> tuple[list[ComponentMerged], bool]:
    """Take what was said of this keyframe and older ones; the merges, and whether poses moved."""
    due = [
        c
        for _, c in sorted(site.verdicts.joined.items())
        if max(c.keyframe_a, c.keyframe_b) == keyframe
        and all(site.knows(k) for k in (c.keyframe_a, c.keyframe_b))
    ]
    merges = [merged for c in due if (merged := _believe(site, c)) is not None]
    if due:
        site.optimise(keyframe)
    return merges, bool(due)


def _believe(site: SiteMap, c: Constraint) -> ComponentMerged | None:
    """Put a constraint into the graph; the younger component comes into the older one's frame."""
    merged = None
    if not site.same_component(c.keyframe_a, c.keyframe_b):
        roots = site.component_root(c.keyframe_a), site.component_root(c.keyframe_b)
        T_A_B = site.pose(c.keyframe_a) @ c.T_a_b @ site.pose(c.keyframe_b).inverse()
        survivor, absorbed = (site.component_id(root) for root in sorted(roots))
        if roots[0] < roots[1]:
            site.move_component(roots[1], T_A_B)
        else:
            site.move_component(roots[0], T_A_B.inverse())
        site.merged_into[absorbed] = survivor
        merged = ComponentMerged(survivor, absorbed, (c.id,))
    site.add_constraint(c.moved_to("accepted", c.reason, site.now))
    return merged

"""What an operator's join would be, before anything is believed of it."""

from __future__ import annotations

from lineloom_core.mapping.answers.evidence import JoinTrial
from lineloom_core.mapping.answers.explain import explain
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.facts.history import History
from lineloom_core.mapping.merging.operators_word import objections


def join_trial(site: SiteMap, history: History, c: Constraint) -> JoinTrial:
    """How the maps would lie, and what speaks for it and against it; changes nothing."""
    holders = [site.resting.on(k)[0] for k in (c.keyframe_a, c.keyframe_b)]
    same = site.same_component(c.keyframe_a, c.keyframe_b)
    return JoinTrial(
        constraint=c.id,
        component_a=site.component_id(holders[0]),
        component_b=site.component_id(holders[1]),
        keyframe_a=history[c.keyframe_a].name,
        keyframe_b=history[c.keyframe_b].name,
        T_a_b=c.T_a_b,
        T_frames=None
        if same
        else site.pose(c.keyframe_a) @ c.T_a_b @ site.pose(c.keyframe_b).inverse(),
        fits="matched" in c.checks,
        reason=c.reason,
        objections=objections(site, c.checks),
        checks=dict(c.checks),
        evidence=explain(site, history, c),
    )

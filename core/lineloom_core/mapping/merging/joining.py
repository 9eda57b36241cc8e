"""Joining two components: when a set of constraints convinces.

Steps of `join`: 1. leave out what says the same as something barred; 2. find the set of candidates
that agree pairwise (PCM) and have most evidence; 3. weigh what is had of it at once, and 4. if that
leaves hope, what takes long: whether its places are distinctive, and both maps, solved together,
held against each other; 5. where nothing contradicts it and it is hardly false, accept, join,
optimise; else let every candidate say what is lacking.
"""

from __future__ import annotations

from dataclasses import replace

from lineloom_core.checks import JOINED
from lineloom_core.geometry import Pose
from lineloom_core.join_odds import at_best, probability_false
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.refusals import refuse_barred
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.config import JoinConfig
from lineloom_core.mapping.merging.candidate_sets import (
    best_sets,
    candidates_between,
    solved_together,
)
from lineloom_core.mapping.merging.component_merged import ComponentMerged
from lineloom_core.mapping.merging.weighing import figures_at_once, figures_of_maps, lacking

_OF_SETS = {row.name for row in JOINED.rows}


def join(site: SiteMap, root: int, keyframe: int) -> ComponentMerged | None:
    """Join the component of `keyframe` with that of `root` if a set of candidates convinces."""
    other_root = site.component_root(keyframe)
    a_root, b_root = min(root, other_root), max(root, other_root)
    candidates = refuse_barred(site, candidates_between(site, a_root, b_root))
    chosen, rival = best_sets(site, candidates)
    if not chosen:
        return None
    config, figures = site.config.join, figures_at_once(site, chosen, rival)
    hoped = {**figures, "doubt": at_best(figures)}
    if JOINED.against(config, hoped):
        _wait(site, candidates, chosen, figures)
        return None
    T_A_B, trial = solved_together(site, a_root, b_root, chosen)
    figures |= figures_of_maps(site, chosen, trial.poses)
    figures["doubt"] = probability_false(figures)
    if JOINED.against(config, figures):
        _wait(site, candidates, chosen, figures)
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


def _wait(
    site: SiteMap, candidates: list[Constraint], chosen: list[Constraint], figures: dict[str, float]
) -> None:
    """Join nothing yet, and let every candidate say what is lacking; the set shows its figures."""
    figures["doubt"] = probability_false(figures)
    objection = _objection(site.config.join, figures)
    in_set = {c.id for c in chosen}
    for c in candidates:
        stored = site.constraints[c.id].moved_to("candidate", objection, site.now)
        own = {name: value for name, value in stored.checks.items() if name not in _OF_SETS}
        site.add_constraint(replace(stored, checks=own | (figures if c.id in in_set else {})))


def _objection(config: JoinConfig, figures: dict[str, float]) -> str:
    row = JOINED.against(config, figures)
    assert row is not None
    said = row.objection.format(figures[row.name])
    return f"{said}: {lacking(config.most_false, figures)}" if row.name == "doubt" else said


def _drop_others(site: SiteMap, candidates: list[Constraint], chosen: list[Constraint]) -> None:
    kept = {c.id for c in chosen}
    for c in candidates:
        if c.id not in kept:
            stored = site.constraints[c.id]
            site.add_constraint(
                stored.moved_to("rejected", "contradicts the set that was accepted", site.now)
            )

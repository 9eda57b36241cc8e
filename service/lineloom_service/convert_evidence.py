"""Between the mapper's answers to questions and the contract's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

from lineloom import wire
from lineloom_core.check import Limit
from lineloom_core.mapping.answers.evidence import Evidence, JoinTrial, WhatIf
from lineloom_core.mapping.answers.localisation import Localisation
from lineloom_core.mapping.answers.site_view import ConstraintView

from lineloom_service.convert import figures, matrix, to_constraint


def to_detail(constraint: ConstraintView, evidence: Evidence | None) -> wire.ConstraintDetail:
    """Return a constraint with its evidence, None where the mapper could not be asked."""
    basis = to_constraint(constraint).model_dump()
    if evidence is None:
        return wire.ConstraintDetail.model_validate(basis)
    best = evidence.runner_up
    return wire.ConstraintDetail(
        **basis,
        limits=_limits(evidence.limits),
        matched=_matched(evidence),
        conflicts=evidence.conflicts.tolist(),
        votes=evidence.votes,
        runner_up=None
        if best is None
        else wire.RunnerUp(x=best.x, y=best.y, theta=best.theta, evidence=best.evidence),
        margin=evidence.margin,
    )


def to_join_trial(found: JoinTrial) -> wire.JoinTrial:
    """Return what an operator's join would be."""
    T = found.T_frames
    return wire.JoinTrial(
        constraint=found.constraint,
        component_a=found.component_a,
        component_b=found.component_b,
        keyframe_a=found.keyframe_a,
        keyframe_b=found.keyframe_b,
        T_a_b=wire.PoseAnswer(x=found.T_a_b.x, y=found.T_a_b.y, theta=found.T_a_b.theta),
        T_components=None if T is None else wire.PoseAnswer(x=T.x, y=T.y, theta=T.theta),
        fits=found.fits,
        reason=found.reason,
        objections=list(found.objections),
        checks=figures(found.checks),
        limits=_limits(found.evidence.limits),
        matched=_matched(found.evidence),
        conflicts=found.evidence.conflicts.tolist(),
    )


def _matched(evidence: Evidence) -> list[wire.MatchedLines]:
    return [
        wire.MatchedLines(
            reference=list(m.reference),
            current=list(m.current),
            overlap=m.overlap,
            distance=m.distance,
            angle=m.angle,
        )
        for m in evidence.matched
    ]


def _limits(limits: Mapping[str, Limit]) -> dict[str, wire.CheckLimit]:
    return {name: wire.CheckLimit(**asdict(limit)) for name, limit in limits.items()}


def to_what_if(found: WhatIf, version: int) -> wire.WhatIf:
    """Return what an action would do."""
    return wire.WhatIf(
        constraint=found.constraint,
        action=found.action,
        version=version,
        components_before=_components(found.components_before),
        components_after=_components(found.components_after),
        robots=[
            wire.RobotMove(
                robot=move.robot,
                component_before=move.component_before,
                component_after=move.component_after,
                moved_m=move.moved,
                turned_rad=move.turned,
            )
            for move in found.robots
        ],
    )


def _components(members: Mapping[str, tuple[str, ...]]) -> list[wire.ComponentRobots]:
    return [wire.ComponentRobots(id=name, robots=list(robots)) for name, robots in members.items()]


def to_localization(site: str, found: Localisation) -> wire.LocalizeAnswer:
    """Return where a scan may have been taken."""
    return wire.LocalizeAnswer(
        site=site,
        verdict=found.verdict,
        reason=found.reason,
        scan=found.scan,
        hypotheses=[
            wire.LocalizeHypothesis(
                component=h.component,
                x=h.pose.x,
                y=h.pose.y,
                theta=h.pose.theta,
                covariance=matrix(h.covariance),
                score=h.score,
                checks=figures(h.checks),
                limits=_limits(h.limits),
            )
            for h in found.hypotheses
        ],
    )

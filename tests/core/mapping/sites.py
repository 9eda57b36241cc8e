"""Site maps laid by hand: keyframes exactly where the test wants them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from lineloom_core.features import ExtractionConfig
from lineloom_core.geometry import Pose
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.facts.drift import step_drift
from lineloom_core.mapping.facts.information import step_information
from lineloom_core.mapping.facts.keyframe import Keyframe, Step
from lineloom_core.places import Place
from lineloom_lab.simulation import SimulatedScan
from numpy.typing import NDArray


def lay_track(
    site: SiteMap,
    scans: Sequence[SimulatedScan],
    poses: Sequence[Pose] | None = None,
    *,
    robot: str = "r",
    begin: Pose | None = None,
) -> list[int]:
    """Make a track with a keyframe of every scan; return their ids.

    poses: T_track_laser of each, the true ones if None. begin: where the track begins in the
    component's frame.
    """
    begin = begin or Pose.identity()
    track = len(site.tracks)
    if poses is None:
        poses = [scans[0].true_pose.between(s.true_pose) for s in scans]
    first = len(site.keyframes)
    for number, (simulated, pose) in enumerate(zip(scans, poses, strict=True), start=first):
        step = None
        if number > first:
            T = poses[number - 1 - first].between(pose)
            information = step_information(np.diag([1e6, 1e6, 1e7]), (0.15, 0.05))
            step = Step(number - 1, T, information, step_drift(information, 1.0), {})
        site.append(
            Keyframe(
                id=number,
                robot=robot,
                track=track,
                scan=simulated.scan,
                T_track_laser=pose,
                step=step,
                version=number + 1,
                extraction=ExtractionConfig(),
            )
        )
    site.move_component(first, begin)
    return list(range(first, first + len(scans)))


def link(
    site: SiteMap,
    a: int,
    b: int,
    T_a_b: Pose,
    *,
    kind: str = "rendezvous",
    state: str = "candidate",
    evidence: float = 50.0,
    places: tuple[int, int] = (-1, -1),
    information: NDArray[np.float64] | None = None,
) -> Constraint:
    """Add a constraint between two keyframes."""
    made = Constraint(
        id=f"t{len(site.constraints)}",
        kind=kind,  # type: ignore[arg-type]
        state=state,  # type: ignore[arg-type]
        keyframe_a=a,
        keyframe_b=b,
        T_a_b=T_a_b,
        information=step_information(np.diag([1e6, 1e6, 1e7]), (0.15, 0.05))
        if information is None
        else information,
        reason="made by hand",
        checks={"margin": 0.8, "conflict_share": 0.01} if kind == "rendezvous" else {},
        place_a=places[0],
        place_b=places[1],
        evidence=evidence,
    )
    site.add_constraint(made)
    return made


def lay_places(site: SiteMap, keyframes: Sequence[int], size: int = 8) -> list[Place]:
    """Cut a track into places of `size` keyframes, half of them shared with the next place."""
    return [
        site.add_place(tuple(keyframes[begin : begin + size]))
        for begin in range(0, len(keyframes) - size + 1, size // 2)
    ]


def thinned(scans: Sequence[SimulatedScan], step: float = 0.4) -> list[SimulatedScan]:
    """Every scan that lies `step` metres or 20 degrees from the one kept before."""
    kept = [scans[0]]
    for s in itertools.islice(scans, 1, None):
        T = kept[-1].true_pose.between(s.true_pose)
        if np.hypot(T.x, T.y) >= step or abs(T.theta) >= np.radians(20.0):
            kept.append(s)
    return kept

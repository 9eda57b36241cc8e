"""Events of robots that fall silent or are heard again: nothing in the map has changed by it."""

from __future__ import annotations

from collections.abc import Mapping

from lineloom import wire
from lineloom_core.mapping.answers.site_view import SiteView

from lineloom_service.convert import silence, to_uncertain_pose


def silence_events(
    view: SiteView, turned: Mapping[str, float | None], at: float, *, settled: bool
) -> list[wire.AnyEvent]:
    """Return an event for each robot that has turned silent (for how long [s]) or not (None).

    settled: whether the view told last was: then that is told again, since the newest batch of a
    site says so of its map.
    """
    found: list[wire.AnyEvent] = []
    for name, seconds in turned.items():
        robot = view.robots.get(name)
        if robot is not None:
            quiet = [] if seconds is None else [silence(seconds)]
            found.append(
                wire.RobotEvent(
                    version=view.version,
                    at=at,
                    robot=name,
                    component=robot.component,
                    pose=to_uncertain_pose(robot),
                    state=robot.state if seconds is None else "silent",
                    keyframes=robot.keyframes,
                    health=[*robot.health, *quiet],
                )
            )
    if settled:
        found.append(
            wire.MapEvent(version=view.version, at=at, changed=[], removed=[], settled=True)
        )
    return found

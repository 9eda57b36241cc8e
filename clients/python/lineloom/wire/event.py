"""What happens to a site, as `GET …/events` tells it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, RootModel

from lineloom.wire.base import Answer
from lineloom.wire.constraint import ConstraintKind, ConstraintState
from lineloom.wire.evidence import ComponentRobots, RobotMove
from lineloom.wire.pose import UncertainPose
from lineloom.wire.robot import RobotState


class BaseEvent(Answer):
    """What every event says.

    version: the site's version that the event is of; a query after it answers with this one or a
    later one. at: when it was published, seconds since 1970 on the service's clock. id: names the
    listener's place after it; it comes in the stream's own field, not in the data.
    """

    id: str = Field(default="", exclude=True)
    version: int
    at: float


class ScanEvent(BaseEvent):
    """A robot's scans were processed. added: how many since its last event of this type.

    processed: all of them so far. session, seq, stamp: of the latest.
    """

    type: Literal["scan"] = "scan"
    robot: str
    added: int
    processed: int
    session: str | None = None
    seq: int | None = None
    stamp: float | None = None


class RobotEvent(BaseEvent):
    """A robot has moved, changed its state or its component; or was forgotten."""

    type: Literal["robot"] = "robot"
    robot: str
    component: str | None = None
    pose: UncertainPose | None = None
    state: RobotState
    keyframes: int = 0
    health: list[str] = Field(default_factory=list)
    forgotten: bool = False


class ComponentMergedEvent(BaseEvent):
    """A component was absorbed. robots: the survivor's. constraints: accepted at the same time."""

    type: Literal["component-merged"] = "component-merged"
    component: str
    merged_into: str
    robots: list[str]
    constraints: list[str]


class ComponentSplitEvent(BaseEvent):
    """A merge was undone: `component` is on its own (again), out of `split_from`."""

    type: Literal["component-split"] = "component-split"
    component: str
    split_from: str
    robots: list[str]


class ConstraintEvent(BaseEvent):
    """A constraint is new, or its state has changed. was: its state before, null where new.

    `removed`: it went with a robot that was forgotten.
    """

    type: Literal["constraint"] = "constraint"
    constraint: str
    kind: ConstraintKind
    state: ConstraintState | Literal["removed"]
    was: ConstraintState | None = None
    keyframe_a: str
    keyframe_b: str
    robot_a: str | None = None
    robot_b: str | None = None
    reason: str


class MapEvent(BaseEvent):
    """The line map has changed: ids of new or changed lines, and of those that are gone.

    complete: false where there are too many to be listed; then both lists are empty and
    `GET …/map?since=` has the changes. settled: nothing came for a while, so the map is now the
    optimum of all constraints; told even where no line has moved by it.
    """

    type: Literal["map"] = "map"
    changed: list[str]
    removed: list[str]
    complete: bool = True
    settled: bool = False


class ResetEvent(BaseEvent):
    """Events were missed that are no longer kept: load anew what you show. reason: why."""

    type: Literal["reset"] = "reset"
    reason: str


class RemadeEvent(BaseEvent):
    """The map was made anew from the first scan, and is shown instead of the one before.

    why: what the map before was made with was something else. A `reset` follows. Constraints are
    those that tie robots or close loops: accepted now and not before, and the other way round.
    complete: false where they are too many to be listed in full. robots: how far the latest pose
    of each moved; null where that cannot be compared. lines_changed: new or not what they were.
    """

    type: Literal["remade"] = "remade"
    why: str
    version_before: int
    components_before: list[ComponentRobots]
    components_after: list[ComponentRobots]
    constraints_gained: list[str]
    constraints_lost: list[str]
    complete: bool = True
    robots: list[RobotMove]
    lines_changed: int
    lines_removed: int


AnyEvent = Annotated[
    ScanEvent
    | RobotEvent
    | ComponentMergedEvent
    | ComponentSplitEvent
    | ConstraintEvent
    | MapEvent
    | RemadeEvent
    | ResetEvent,
    Field(discriminator="type"),
]
"""One event; `type` tells which."""


class Event(RootModel[AnyEvent]):
    """The `data` of one Server-Sent Event; its `event` field is `type` again."""

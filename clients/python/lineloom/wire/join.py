"""Telling that two places are the same, and what that would come to."""

from __future__ import annotations

from typing import Annotated

from pydantic import ConfigDict, Field

from lineloom.wire.base import Answer, Number, Request, Seq
from lineloom.wire.evidence import CheckLimit, MatchedLines
from lineloom.wire.pose import PoseAnswer

_ROBOT = Field(default=None, max_length=64, description="The robot; or name a place instead.")
_SESSION = Field(default="0", max_length=64, description="The session of the robot's scan.")
_SEQ = Field(default=None, description="The scan's number; left out, the robot's latest scan.")
_PLACE = Field(default=None, max_length=64, description="A place by its id: its anchor counts.")


class PoseRequest(Request):
    """x, y in metres, theta in radians counter-clockwise."""

    model_config = ConfigDict(strict=True, extra="forbid")

    x: Annotated[Number, Field(ge=-1e5, le=1e5, description="[m]")]
    y: Annotated[Number, Field(ge=-1e5, le=1e5, description="[m]")]
    theta: Annotated[Number, Field(ge=-100.0, le=100.0, description="[rad]")] = 0.0


class JoinRequest(Request):
    """Two scans, or two places, that are said to be near each other.

    T_a_b: where the lidar stood for b, seen from where it stood for a, roughly: within 1.5 m and
    17 degrees the matcher finds where they fit best. Left out, it looks for them without a pose.
    """

    model_config = ConfigDict(strict=True, extra="forbid")

    robot_a: Annotated[str | None, _ROBOT] = None
    session_a: Annotated[str, _SESSION] = "0"
    seq_a: Annotated[Seq | None, _SEQ] = None
    place_a: Annotated[str | None, _PLACE] = None
    robot_b: Annotated[str | None, _ROBOT] = None
    session_b: Annotated[str, _SESSION] = "0"
    seq_b: Annotated[Seq | None, _SEQ] = None
    place_b: Annotated[str | None, _PLACE] = None
    T_a_b: PoseRequest | None = Field(
        default=None, description="Pose of lidar b in the frame of lidar a, roughly."
    )


class JoinTrial(Answer):
    """What a join would be; nothing was changed. Coordinates in the frame of keyframe a."""

    constraint: str = Field(description="The id that the constraint would have.")
    component_a: str
    component_b: str
    keyframe_a: str
    keyframe_b: str
    T_a_b: PoseAnswer = Field(description="Keyframe b seen from keyframe a, as measured.")
    T_components: PoseAnswer | None = Field(
        description="The map frame of b's component in that of a's; null within one component."
    )
    fits: bool = Field(description="Whether the matcher could measure it; else as it was laid.")
    reason: str = Field(description="What speaks for it or against it, in words.")
    objections: list[str] = Field(description="What speaks against it; empty where nothing does.")
    checks: dict[str, float | None] = Field(description="Each check's figure by name.")
    limits: dict[str, CheckLimit] = Field(description="By check, what its figure is held to.")
    matched: list[MatchedLines] = Field(description="Lines taken for one wall.")
    conflicts: list[list[float]] = Field(description="Points of one in free space of the other.")

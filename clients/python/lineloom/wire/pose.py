"""A pose in an answer."""

from __future__ import annotations

from lineloom.wire.base import Answer, Covariance


class PoseAnswer(Answer):
    """x, y in metres, theta in radians counter-clockwise."""

    x: float
    y: float
    theta: float


class UncertainPose(PoseAnswer):
    """A pose with its 3x3 covariance over x, y, theta, where one is known."""

    covariance: Covariance | None = None

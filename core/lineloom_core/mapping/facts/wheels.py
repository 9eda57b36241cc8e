"""Whether a robot's odometry is to be believed: it earns that where scans can tell.

Every step of the odometry is held against the step that registration found, in the directions that
registration observed. Agreement earns credit slowly, contradiction takes it at once, and without
credit the odometry is not asked: a robot with wrong wheels is tracked as one without any. At first
it has the benefit of the doubt, for a robot may set out in a plain corridor.
"""

from __future__ import annotations

import math

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose, angle_difference

_MOST_CREDIT = 20
_FINE = 5  # what a contradiction costs: as many agreements
_SLACK = 0.25  # share of a step that wheels may be wrong by
_SLACK_M = 0.05
_SLACK_RAD = 0.04
_FASTEST = 3.0  # m/s
_FASTEST_TURN = 4.0  # rad/s


@storable("wheels", _credit=int)
class Wheels:
    """The credit of one robot's odometry."""

    def __init__(self) -> None:
        self._credit = 0

    @property
    def believed(self) -> bool:
        """Whether a step may be used where scans do not tell."""
        return self._credit >= 0

    def plausible(self, step: Pose, elapsed: float) -> bool:
        """Whether any robot can move so far in that time [s]; a jump costs credit."""
        time = max(elapsed, 0.2) + 0.2
        if math.hypot(step.x, step.y) < _FASTEST * time and abs(step.theta) < _FASTEST_TURN * time:
            return True
        self._lose()
        return False

    def compare(self, step: Pose, found: Pose, unseen: float | None) -> None:
        """Hold a step of the odometry against the registered one, both in the laser's axes.

        unseen: direction [rad] in these axes that registration did not observe, None if it did.
        """
        dx, dy = step.x - found.x, step.y - found.y
        if unseen is not None:
            off = abs(-math.sin(unseen) * dx + math.cos(unseen) * dy)
        else:
            off = math.hypot(dx, dy)
        turned = abs(angle_difference(step.theta, found.theta))
        way = max(math.hypot(step.x, step.y), math.hypot(found.x, found.y))
        turn = max(abs(step.theta), abs(found.theta))
        if off > _SLACK_M + _SLACK * way or turned > _SLACK_RAD + _SLACK * turn:
            self._lose()
        elif (unseen is None and way > 2.0 * _SLACK_M) or turn > 2.0 * _SLACK_RAD:
            self._credit = min(self._credit + 1, _MOST_CREDIT)

    def _lose(self) -> None:
        self._credit = max(self._credit - _FINE, -_MOST_CREDIT)

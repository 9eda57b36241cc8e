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
_PROVEN = 5  # agreements
_LATELY = 0.1  # share of a step in how far they are off
_SIGMAS = 2.0
_LEAP = 1.0  # m, rad: what any step may be like
_FASTER = 3.0  # times the usual that a step may be besides


@storable("wheels", _credit=int, _variance=tuple[float, float])
class Wheels:
    """The credit of one robot's odometry, and how far its steps are off."""

    def __init__(self) -> None:
        self._credit = 0
        self._variance = 0.0, 0.0  # m^2, rad^2

    @property
    def believed(self) -> bool:
        """Whether a step may be used where scans do not tell."""
        return self._credit >= 0

    @property
    def proven(self) -> bool:
        """Whether scans have borne it out time and again."""
        return self._credit >= _PROVEN

    @property
    def off(self) -> tuple[float, float]:
        """How far a step of it is off [m, rad], as far as scans can tell."""
        way, turn = (math.sqrt(max(v, 0.0)) for v in self._variance)
        return way, turn

    def plausible(self, step: Pose, usual: tuple[float, float], intervals: float) -> bool:
        """Whether a robot may move so far at once; a jump costs credit.

        usual: what a step is like [m, rad]. intervals: how many it has had time for.
        """
        way, turn = (_LEAP + _FASTER * intervals * u for u in usual)
        if math.hypot(step.x, step.y) < way and abs(step.theta) < turn:
            return True
        self._lose()
        return False

    def compare(
        self,
        step: Pose,
        found: Pose,
        unseen: float | None,
        sigma: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Hold a step of the odometry against the registered one, both in the laser's axes.

        unseen: direction [rad] in these axes that registration did not observe, None if it did.
        sigma: how well it knows the step [m, rad]: noisy scans are no witness.
        """
        dx, dy = step.x - found.x, step.y - found.y
        if unseen is not None:
            off = abs(-math.sin(unseen) * dx + math.cos(unseen) * dy)
        else:
            off = math.hypot(dx, dy)
        turned = abs(angle_difference(step.theta, found.theta))
        errors = zip((off, turned), sigma, self._variance, strict=True)
        way, turn = (v + _LATELY * (e * e - s * s - v) for e, s, v in errors)
        self._variance = way, turn
        way = max(math.hypot(step.x, step.y), math.hypot(found.x, found.y))
        turn = max(abs(step.theta), abs(found.theta))
        slack = _SLACK_M + _SIGMAS * sigma[0], _SLACK_RAD + _SIGMAS * sigma[1]
        if off > slack[0] + _SLACK * way or turned > slack[1] + _SLACK * turn:
            self._lose()
        elif (unseen is None and way > 2.0 * _SLACK_M) or turn > 2.0 * _SLACK_RAD:
            self._credit = min(self._credit + 1, _MOST_CREDIT)

    def _lose(self) -> None:
        self._credit = max(self._credit - _FINE, -_MOST_CREDIT)

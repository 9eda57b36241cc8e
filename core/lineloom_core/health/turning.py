"""A mirrored lidar, from its robot's wheels: scans and wheels turn opposite ways.

Likewise scans that turn by another angle than the wheels: one of the two is scaled.

A mirrored scan is as good a scan as any other: every single one, and a whole map of them, is
consistent in itself. It shows only against something that knows left from right. Without odometry
and before others have mapped the same place this is undecidable, and nothing is said.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from lineloom_core.codec import storable
from lineloom_core.health.finding import Finding
from lineloom_core.health.sample import Sample

_LEAST_STEP_RAD = math.radians(2.0)
_LEAST_TURN_RAD = 4.0
_OPPOSITE = -0.7
_FORGET = 0.995
_MOST_SCALE = 1.3


@storable("turning-check")
@dataclass
class TurningCheck:
    """Sums of |wheels' turn|, and of it with the sign of whether the scans turned likewise.

    scanned: sum of |scans' turn|.
    """

    turned: float = 0.0
    agreed: float = 0.0
    scanned: float = 0.0

    def examine(self, sample: Sample) -> None:
        """Look at the next step."""
        if sample.step is None or sample.odometry_step is None:
            return
        wheels, scans = sample.odometry_step.theta, sample.step.theta
        if abs(wheels) < _LEAST_STEP_RAD or abs(scans) < 0.3 * abs(wheels):
            return
        self.turned = _FORGET * self.turned + abs(wheels)
        self.agreed = _FORGET * self.agreed + math.copysign(abs(wheels), wheels * scans)
        self.scanned = _FORGET * self.scanned + abs(scans)

    def findings(self) -> list[Finding]:
        """What is wrong now. A warning: it may be the wheels that turn the wrong way."""
        if self.turned < _LEAST_TURN_RAD:
            return []
        if self.agreed > _OPPOSITE * self.turned:
            return self._scaled()
        return [
            Finding(
                "mirrored",
                "warning",
                f"over {math.degrees(self.turned):.0f} degrees of turning, scans turn against the "
                "odometry: the lidar hangs upside down, or sends its beams in reverse order; set "
                "or unset `inverted` in the robot's mount. If other robots' maps fit, the "
                "odometry's theta has the wrong sign",
            )
        ]

    def _scaled(self) -> list[Finding]:
        scale = self.scanned / self.turned
        if self.agreed < -_OPPOSITE * self.turned or 1.0 / _MOST_SCALE < scale < _MOST_SCALE:
            return []
        return [
            Finding(
                "turn-scale",
                "warning",
                f"scans turn {scale:.2f} times as far as the odometry says: angle_increment is "
                "wrong by that factor, or the odometry's theta is",
            )
        ]

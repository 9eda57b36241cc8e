"""Wheel odometry that drifts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from lineloom_core.geometry import Pose, wrap


@dataclass(frozen=True, slots=True)
class DriftingOdometry:
    """What a robot believes of its own motion: noise that grows with the way, and a bias.

    Noise is given per square root of the way, so that the drift after a drive does not depend on
    how often it is measured. forward_sigma [m / sqrt(m)], sideways_sigma [m / sqrt(m)],
    turn_sigma [rad / sqrt(rad)], heading_sigma [rad / sqrt(m)]. Biases: length_scale and turn_scale
    multiply what is measured, pull [rad / m] is the turn of a robot that drives straight ahead.
    """

    forward_sigma: float = 0.02
    sideways_sigma: float = 0.005
    turn_sigma: float = 0.02
    heading_sigma: float = 0.01
    length_scale: float = 1.01
    turn_scale: float = 1.01
    pull: float = 0.002

    def measure(self, truth: Iterable[Pose], rng: np.random.Generator) -> Iterator[Pose]:
        """Yield T_odom_base for each true T_world_base; the odom frame is the first base pose."""
        believed, before = Pose.identity(), None
        for pose in truth:
            if before is not None:
                believed = believed @ self._step(before.between(pose), rng)
            before = pose
            yield believed

    def _step(self, step: Pose, rng: np.random.Generator) -> Pose:
        length, turn = math.hypot(step.x, step.y), abs(step.theta)
        noise = rng.standard_normal(3)
        root = math.sqrt(length)
        heading = math.hypot(self.turn_sigma * math.sqrt(turn), self.heading_sigma * root)
        return Pose(
            self.length_scale * step.x + self.forward_sigma * root * float(noise[0]),
            self.length_scale * step.y + self.sideways_sigma * root * float(noise[1]),
            wrap(self.turn_scale * step.theta + self.pull * length + heading * float(noise[2])),
        )

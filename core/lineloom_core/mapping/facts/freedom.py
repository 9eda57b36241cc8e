"""A motion that a scan does not show: a slide along a plain corridor, a turn in a round room.

Between two walls nothing tells how far along one is; in a round tank nothing tells the heading, and
noise alone would choose it. So the scan is tried a little further along the motion that it knows
least: where hardly anything speaks against that, the motion is free, and whoever knows of it from
elsewhere (wheels, steady driving) is to say how far it went.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.graph import observe, without_twist
from lineloom_core.matching.spots import Spot, Spotter

_SLIDES = tuple((way,) for way in (-0.8, -0.4, 0.4, 0.8))  # m
_TURNS = (-0.3, -0.6), (0.3, 0.6)  # rad: near a wall, less moves nothing beyond the gate
_GATE = 0.15  # m
_COST = 1.0  # what costs less is free
_ROUND = 0.3  # share of the most that is known that must be known along every direction: no slide
_LEAST_KNOWN = 0.1  # share of it, of a turn about any point: no turn is free
_LEVER = 2.0  # m: that turns are weighed by at least, for one may stand in the middle
_FARTHEST_PIVOT = 10.0  # m: a turn about a point farther away is a slide
_SIGMAS = np.array([0.15, 0.15, 0.05])  # m, m, rad: how what is due is weighed


@dataclass(frozen=True, slots=True)
class Freedom:
    """A free motion of the laser. at: where it was found. twist: per unit of it, x and y [m] and
    theta [rad] in the map's axes; no theta for a slide.
    """

    at: Pose
    twist: tuple[float, float, float]

    @staticmethod
    def along(at: Pose, axis: float) -> Freedom:
        """A slide along a direction [rad]."""
        return Freedom(at, (math.cos(axis), math.sin(axis), 0.0))

    @property
    def axis(self) -> float | None:
        """Direction [rad] of a slide, None of a turn."""
        x, y, turn = self.twist
        return None if turn else math.atan2(y, x)

    def moved(self, way: float) -> Pose:
        """Where the laser is after so many units of it."""
        x, y, turn = self.twist
        at = self.at
        if not turn:
            return Pose(at.x + way * x, at.y + way * y, at.theta)
        to_pivot = np.array([-y / turn, x / turn])
        c, s = math.cos(way * turn), math.sin(way * turn)
        px, py = (to_pivot - np.array([[c, -s], [s, c]]) @ to_pivot).tolist()
        return Pose(at.x + px, at.y + py, at.theta + way * turn)

    def nearest(self, due: Pose, share: float = 1.0) -> Pose:
        """That share of the way to where it comes nearest to another pose."""
        turn = self.twist[2]
        first = angle_difference(due.theta, self.at.theta) / turn if turn else 0.0
        there = self.moved(first)
        onward = np.array(self.twist)
        if turn:
            onward[:2] = (self.moved(first + 1e-6).to_array() - there.to_array())[:2] / 1e-6
        off = due.to_array() - there.to_array()
        off[2] = angle_difference(due.theta, there.theta)
        weighed = onward / _SIGMAS
        return self.moved(share * (first + float(weighed @ (off / _SIGMAS) / (weighed @ weighed))))

    def unknown(self, information: NDArray[np.float64]) -> NDArray[np.float64]:
        """The information (3, 3) at `at`, in the map's axes, with nothing known of it."""
        return without_twist(information, np.array(self.twist))


def find_freedom(spotter: Spotter, best: Spot) -> Freedom | None:
    """What a scan could do unnoticed where it was found; None where it cannot move."""
    return _slide(spotter, best) or free_turn(spotter, best)


def _slide(spotter: Spotter, best: Spot) -> Freedom | None:
    seen = observe(best.found.information)
    if seen.lambda_min > _ROUND * seen.lambda_max:
        return None
    slide = Freedom.along(best.pose, seen.least_known)
    return slide if _is_free(spotter, best, slide, _SLIDES) else None


def free_turn(spotter: Spotter, best: Spot) -> Freedom | None:
    """The turn, about whatever point, that hardly anything speaks against."""
    twist = least_known_turn(best.found.information)
    if twist is None:
        return None
    turn = Freedom(best.pose, twist)
    return turn if _is_free(spotter, best, turn, _TURNS) else None


def _is_free(
    spotter: Spotter, best: Spot, freedom: Freedom, ways: tuple[tuple[float, ...], ...]
) -> bool:
    """Whether one of these runs of ways costs hardly anything wherever it is along it."""
    moved = [freedom.moved(way) for run in ways for way in run]
    there = iter(spotter.settle(moved, gate=_GATE, iterations=0, near=0.0))
    costs = [[next(there).misfit - best.misfit for _ in run] for run in ways]
    return any(max(run) < _COST for run in costs)


def least_known_turn(
    information: NDArray[np.float64], least_known: float = _LEAST_KNOWN
) -> tuple[float, float, float] | None:
    """The turn [m, m a rad, 1 rad] that information (3, 3) says little of, about a point nearby.

    None where it says more than `least_known` of it, or knows some other motion less.
    """
    straight = 0.5 * (information[0, 0] + information[1, 1])
    if straight <= 0.0:
        return None
    lever = max(math.sqrt(information[2, 2] / straight), _LEVER)
    scaled = np.array([1.0, 1.0, 1.0 / lever])
    known, motions = np.linalg.eigh(information * np.outer(scaled, scaled))
    x, y, turn = (motions[:, 0] * scaled).tolist()
    if known[0] > least_known * known[2] or math.hypot(x, y) > _FARTHEST_PIVOT * abs(turn):
        return None
    return x / turn, y / turn, 1.0

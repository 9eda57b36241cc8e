"""Two scans drawn over each other at one pose."""

from __future__ import annotations

import math

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.scan import Scan
from numpy.typing import NDArray

from lineloom_lab.experiments.plan import Bounds, Layer, Plan

REFERENCE_COLOUR = "#1d4ed8"
CURRENT_COLOUR = "#c1121f"
_REACH_M = 7.0
_DOT_M, _HEADING_M = 0.02, 0.8


def overlay(
    title: str,
    reference: Scan,
    current: Scan,
    T_ref_cur: Pose | None,
    reach_m: float = _REACH_M,
) -> Plan:
    """Return a panel with both scans, and where either laser stood and looked.

    Without a pose, the reference alone is drawn. reach_m: how far around the lasers is shown.
    """
    layers = [
        Layer("reference", _dots(reference.points()), REFERENCE_COLOUR, 3.0),
        Layer("", (_arrow(Pose.identity()),), REFERENCE_COLOUR, 4.0),
    ]
    if T_ref_cur is not None:
        seen = _dots(T_ref_cur.transform(current.points()))
        layers.insert(1, Layer("current", seen, CURRENT_COLOUR, 3.0, 0.8))
        layers.append(Layer("", (_arrow(T_ref_cur),), CURRENT_COLOUR, 4.0))
    return Plan(title, tuple(layers), _around(T_ref_cur or Pose.identity(), reach_m))


def _dots(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return each point as a stroke a few centimetres long: layers are lines."""
    half = np.array([_DOT_M, 0.0])
    return tuple(np.array([p - half, p + half]) for p in points)


def _arrow(pose: Pose) -> NDArray[np.float64]:
    """Return where a laser stands and looks, as a polyline."""
    tip = np.array([_HEADING_M, 0.0])
    barbs = [(0.65 * _HEADING_M, side * 0.2 * _HEADING_M) for side in (1.0, -1.0)]
    return pose.transform(np.array([(0.0, 0.0), tip, barbs[0], tip, barbs[1]]))


def _around(pose: Pose, reach_m: float) -> Bounds:
    """Return the part of the plane that shows both lasers and what is near them."""
    reach = reach_m + 0.25 * math.hypot(pose.x, pose.y)
    x, y = 0.5 * pose.x, 0.5 * pose.y
    return x - 1.3 * reach, y - reach, x + 1.3 * reach, y + reach

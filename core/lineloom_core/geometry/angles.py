"""Angles in radians, always wrapped to (-pi, pi]."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray


def wrap(angle: float) -> float:
    """Return `angle` [rad] wrapped to (-pi, pi]."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


def wrap_array(angles: ArrayLike) -> NDArray[np.float64]:
    """Return every angle [rad] wrapped to (-pi, pi], same shape."""
    a = np.asarray(angles, dtype=np.float64)
    wrapped: NDArray[np.float64] = -((np.pi - a) % (2.0 * np.pi) - np.pi)
    return wrapped


def angle_difference(a: float, b: float) -> float:
    """Return the signed difference a - b [rad], wrapped to (-pi, pi]."""
    return wrap(a - b)


def circular_mean(angles: ArrayLike, weights: ArrayLike | None = None) -> float:
    """Return the direction of the weighted sum of unit vectors [rad].

    Raises ValueError where the vectors cancel and no mean direction exists.
    """
    a = np.asarray(angles, dtype=np.float64)
    w = np.ones_like(a) if weights is None else np.asarray(weights, dtype=np.float64)
    s, c = float(np.sum(w * np.sin(a))), float(np.sum(w * np.cos(a)))
    if math.hypot(s, c) <= 1e-12 * float(np.sum(np.abs(w))):
        raise ValueError("the circular mean is undefined: the directions cancel")
    return math.atan2(s, c)

"""Which directions a measured relative pose really fixes.

Two parallel walls say nothing about the way along them, a round room nothing about its rotation.
The information matrix knows; this file asks it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

WEAK_BELOW = 300.0
"""Translational information [1/m^2] below which a direction is weak: sigma of 6 cm (design §7)."""

WEAK_ROTATION_BELOW = 300.0
"""Rotational information [1/rad^2] below which the angle is weak: sigma above 3.3 degrees."""

_NOTHING = 1e-9  # information that is zero but for rounding


@dataclass(frozen=True)
class Observability:
    """What an information matrix constrains, in the axes in which it is given.

    translation: (2, 2) [1/m^2], the information on x and y when the angle is unknown (Schur
    complement). lambda_min, lambda_max: its eigenvalues. least_known: angle in [0, pi) [rad] of
    the direction known least; weak_direction: the same, None where all are known well enough.
    weak_translation: how many of the two directions are weak. rotation: information on the angle
    when the translation is unknown [1/rad^2]. weak_rotation: too little of it.
    """

    translation: NDArray[np.float64]
    lambda_min: float
    lambda_max: float
    least_known: float
    weak_direction: float | None
    weak_translation: int
    rotation: float
    weak_rotation: bool

    @property
    def full(self) -> bool:
        """Whether all three degrees of freedom are fixed."""
        return self.weak_translation == 0 and not self.weak_rotation


def observe(
    information: NDArray[np.float64],
    weak_below: float = WEAK_BELOW,
    weak_rotation_below: float = WEAK_ROTATION_BELOW,
) -> Observability:
    """Judge a (3, 3) information matrix, order x, y, theta. Raises ValueError for another shape."""
    if information.shape != (3, 3):
        raise ValueError("information must be 3x3")
    (xx, xy, xt), (_, yy, yt), (_, _, tt) = information.tolist()
    rotation = tt
    for known, x, y in _axes(xx, xy, yy):
        if known > _NOTHING:
            rotation -= (x * xt + y * yt) ** 2 / known
    if tt > _NOTHING:
        xx, xy, yy = xx - xt * xt / tt, xy - xt * yt / tt, yy - yt * yt / tt
    (least, x, y), (most, _, _) = _axes(xx, xy, yy)
    direction = math.atan2(y, x) % math.pi
    direction = 0.0 if direction >= math.pi else direction
    weak = (least < weak_below) + (most < weak_below)
    return Observability(
        translation=np.array([[xx, xy], [xy, yy]]),
        lambda_min=max(least, 0.0),
        lambda_max=max(most, 0.0),
        least_known=direction,
        weak_direction=direction if weak else None,
        weak_translation=weak,
        rotation=max(rotation, 0.0),
        weak_rotation=rotation < weak_rotation_below,
    )


def _axes(xx: float, xy: float, yy: float) -> tuple[tuple[float, float, float], ...]:
    """Eigenvalues and unit eigenvectors (value, x, y) of a symmetric 2x2 matrix, the least first.

    By the closed form: this is asked several times a scan, and a library's solver takes longer to
    call than all of it.
    """
    middle, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
    radius = math.hypot(half, xy)
    along = 0.5 * math.atan2(xy, half)
    c, s = math.cos(along), math.sin(along)
    return (middle - radius, -s, c), (middle + radius, c, s)


def project_out_weak(
    information: NDArray[np.float64],
    weak_below: float = WEAK_BELOW,
    weak_rotation_below: float = WEAK_ROTATION_BELOW,
) -> NDArray[np.float64]:
    """Return the information with what it only seems to know taken out, shape (3, 3).

    A weak direction is marginalised, as if its variance were infinite: it constrains nothing, and
    what it was correlated with keeps just what holds whatever the slide. The result is positive
    semidefinite and singular along the weak direction.
    """
    judged = observe(information, weak_below, weak_rotation_below)
    result = 0.5 * (information + information.T)
    for k in range(judged.weak_translation):
        result = without_direction(result, judged.least_known + k * 0.5 * math.pi)
    if judged.weak_rotation:
        result = _without(result, np.eye(3)[2])
    return result


def without_direction(information: NDArray[np.float64], direction: float) -> NDArray[np.float64]:
    """Return the information (3, 3) with nothing known along a direction [rad], others kept."""
    return _without(information, np.array([math.cos(direction), math.sin(direction), 0.0]))


def without_twist(
    information: NDArray[np.float64], twist: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the information (3, 3) with nothing known of a motion (3,) of any length."""
    return _without(information, twist / np.linalg.norm(twist))


def _without(information: NDArray[np.float64], u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Marginalise the coordinate along the unit vector u: I - I u u^T I / (u^T I u)."""
    Iu = information @ u
    along = float(u @ Iu)
    if along <= _NOTHING:
        return information  # positive semidefinite: I u is zero as well
    reduced = information - np.outer(Iu, Iu) / along
    result: NDArray[np.float64] = 0.5 * (reduced + reduced.T)
    return result

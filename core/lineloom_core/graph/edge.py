"""An edge of the pose graph: one relative pose and how sure it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose, se2

EdgeKind = Literal["sequential", "loop", "rendezvous"]


@dataclass(frozen=True, eq=False, slots=True)
class Edge:
    """A measured relative pose T_a_b of two nodes.

    information: (3, 3), symmetric, positive semidefinite, in the tangent space at b (order x, y,
    theta, in the axes of b), as gtsam's BetweenFactorPose2 takes it. A zero eigenvalue means: this
    direction was not observed. robust: give in when the rest of the graph disagrees; false for
    steps of one robot's own trajectory, which nothing else can vouch for.

    Raises ValueError for an edge onto itself or an information that is none.
    """

    id: str
    kind: EdgeKind
    node_a: int
    node_b: int
    T_a_b: Pose
    information: NDArray[np.float64]
    robust: bool

    def __post_init__(self) -> None:
        if self.node_a == self.node_b:
            raise ValueError(f"edge {self.id}: joins node {self.node_a} to itself")
        I = self.information  # noqa: E741
        if I.shape != (3, 3) or not np.all(np.isfinite(I)):
            raise ValueError(f"edge {self.id}: information must be 3x3 and finite")
        if np.max(np.abs(I - I.T)) > 1e-6 * max(1.0, float(np.max(np.abs(I)))):
            raise ValueError(f"edge {self.id}: information must be symmetric")


def tangent_errors(edges: Sequence[Edge], poses: Mapping[int, Pose]) -> NDArray[np.float64]:
    """Return Log(T_a_b_measured^-1 T_a_b_estimated) of every edge, shape (m, 3)."""
    T_m_a = se2.stack(poses[e.node_a] for e in edges)
    T_m_b = se2.stack(poses[e.node_b] for e in edges)
    measured = se2.stack(e.T_a_b for e in edges)
    return se2.log(se2.between(measured, se2.between(T_m_a, T_m_b)))


def chi_squared(edges: Sequence[Edge], poses: Mapping[int, Pose]) -> NDArray[np.float64]:
    """Return the squared whitened error of every edge, shape (m,), robust kernels left aside.

    Under the edge's own noise it is chi-squared with three degrees of freedom (fewer where the
    information is singular).
    """
    if not edges:
        return np.zeros(0)
    errors = tangent_errors(edges, poses)
    information = np.stack([e.information for e in edges])
    squared = np.einsum("ni,nij,nj->n", errors, information, errors)
    chi2: NDArray[np.float64] = np.maximum(squared, 0.0)
    return chi2


def square_roots(information: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return R with R^T R = information, both of shape (m, 3, 3).

    By eigenvalues, not by Cholesky: a corridor's information is singular along the corridor, and
    is as good an edge as any across it.
    """
    values, vectors = np.linalg.eigh(information)
    roots: NDArray[np.float64] = np.sqrt(np.maximum(values, 0.0))[:, :, None] * np.swapaxes(
        vectors, 1, 2
    )
    return roots

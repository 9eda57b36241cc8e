"""An edge of the pose graph: one relative pose and how sure it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose

EdgeKind = Literal["sequential", "loop", "rendezvous", "operator"]


@dataclass(frozen=True, eq=False, slots=True)
class Edge:
    """A measured relative pose T_a_b of two nodes.

    information: (3, 3), symmetric, positive semidefinite, in the tangent space at b (order x, y,
    theta, in the axes of b), as gtsam's BetweenFactorPose2 takes it. A zero eigenvalue means: this
    direction was not observed. robust: give in when the rest of the graph disagrees; false for
    steps of one robot's own trajectory, which nothing else can vouch for. drift: (3, 3)
    there, by which drift is judged, where that is not what weighs the edge.

    Raises ValueError for an edge onto itself or an information that is none.
    """

    id: str
    kind: EdgeKind
    node_a: int
    node_b: int
    T_a_b: Pose
    information: NDArray[np.float64]
    robust: bool
    drift: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        if self.node_a == self.node_b:
            raise ValueError(f"edge {self.id}: joins node {self.node_a} to itself")
        I = self.information  # noqa: E741
        if I.shape != (3, 3) or not np.all(np.isfinite(I)):
            raise ValueError(f"edge {self.id}: information must be 3x3 and finite")
        if np.max(np.abs(I - I.T)) > 1e-6 * max(1.0, float(np.max(np.abs(I)))):
            raise ValueError(f"edge {self.id}: information must be symmetric")

    @property
    def drift_information(self) -> NDArray[np.float64]:
        """What drift is judged by, (3, 3)."""
        return self.information if self.drift is None else self.drift


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

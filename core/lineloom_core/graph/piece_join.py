"""The frame in which a piece of graph joins another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose, se2
from lineloom_core.graph.consistency import CHI2_99
from lineloom_core.graph.edge import Edge
from lineloom_core.graph.factors import CAUCHY_K

_REFINEMENTS = 10


def rigid_join(
    piece_a: Mapping[int, Pose], piece_b: Mapping[int, Pose], edges: Sequence[Edge]
) -> Pose:
    """Return T_A_B that carries piece b into the frame of piece a so that the edges fit best.

    Each edge must lead from one piece to the other, either way round. Starts from the edge whose
    own answer the others contradict least (beyond 99 % of chi-squared all is equally wrong), then
    refines over all edges under a Cauchy kernel, the pieces staying rigid.

    Raises ValueError without edges, or for an edge that does not lead across.
    """
    if not edges:
        raise ValueError("no edge joins the two pieces")
    P, Z, Q, W = _across(piece_a, piece_b, sorted(edges, key=lambda e: (e.node_a, e.node_b, e.id)))
    proposals = se2.compose(se2.compose(P, Z), se2.inverse(Q))
    misfits = [float(np.minimum(_chi2(P, Z, Q, W, T), CHI2_99).sum()) for T in proposals]
    T = proposals[int(np.argmin(misfits))]
    for _ in range(_REFINEMENTS):
        # error = Log(Z^-1 P^-1 T Q); moving T by Exp(xi) on the right moves it by Ad(Q^-1) xi.
        error = se2.log(se2.between(Z, se2.compose(se2.between(P, T), Q)))
        J = se2.adjoint(se2.inverse(Q))
        w = CAUCHY_K**2 / (CAUCHY_K**2 + _chi2(P, Z, Q, W, T))
        J_T_W = np.swapaxes(J, 1, 2) @ (W * w[:, None, None])
        H = (J_T_W @ J).sum(axis=0)
        g = (J_T_W @ error[:, :, None]).sum(axis=0)[:, 0]
        step = -np.linalg.lstsq(H, g, rcond=1e-12)[0]  # corridors alone leave H singular
        T = se2.compose(T, step)
    return Pose.from_array(T)


def _across(
    piece_a: Mapping[int, Pose], piece_b: Mapping[int, Pose], edges: Sequence[Edge]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return poses in a, measurements a to b, poses in b, informations at b: all edges one way."""
    P, Z, Q, W = [], [], [], []
    for edge in edges:
        if edge.node_a in piece_a and edge.node_b in piece_b:
            P.append(piece_a[edge.node_a])
            Q.append(piece_b[edge.node_b])
            Z.append(edge.T_a_b)
            W.append(edge.information)
        elif edge.node_b in piece_a and edge.node_a in piece_b:
            P.append(piece_a[edge.node_b])
            Q.append(piece_b[edge.node_a])
            Z.append(edge.T_a_b.inverse())
            # Turned round, a tangent at b is -Ad(T_a_b) of itself at a; information goes with the
            # inverse of that on either side.
            A = edge.T_a_b.inverse().adjoint()
            W.append(A.T @ edge.information @ A)
        else:
            raise ValueError(f"edge {edge.id} does not lead from one piece to the other")
    return se2.stack(P), se2.stack(Z), se2.stack(Q), np.stack(W)


def _chi2(
    P: NDArray[np.float64],
    Z: NDArray[np.float64],
    Q: NDArray[np.float64],
    W: NDArray[np.float64],
    T: NDArray[np.float64],
) -> NDArray[np.float64]:
    error = se2.log(se2.between(Z, se2.compose(se2.between(P, T), Q)))
    squared: NDArray[np.float64] = np.einsum("ni,nij,nj->n", error, W, error)
    return squared

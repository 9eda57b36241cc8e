"""Least squares on the pose graph. The only file that knows gtsam.

Gauss-Newton on the exact normal equations comes first (`relax`): a keyframe's loop moves a
graph that has settled before by little. Where it does not get there, gtsam's Levenberg-Marquardt
takes over from the same start. Choices, and what they were measured against (600 to 1500 nodes in
a building-like world, 12 to 200 loops, 0 to 30 % of them wrong by 0.5 or 4 m, four seeds each):

* Robust kernel: Cauchy with k = 3 whitened units. Least error or within a hair of it in every
  row, in 7 to 9 iterations. Huber keeps a pull from gross errors (rmse up to 2.5 times as high);
  DCS with phi = 1, Geman-McClure and Welsch let go of right loops when the start is poor (rmse
  1 to 2 m where Cauchy has 0.2 m), and tight kernels (k = 1) need three to four times as long.
* Ordering in gtsam: METIS. COLAMD makes the elimination tree of a chain as deep as the chain is
  long, and gtsam walks it recursively: 20,000 nodes overflow a 1 MB stack, 100,000 the usual 8 MB.
  With METIS both pass. Its seed is a constant, so the ordering is the same in every process.
* The gtsam wheel is built without TBB: one thread, the same sums in the same order, the same bits.
* Components are solved one by one, one node of each held: they cannot touch each other's result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import gtsam
import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.graph.edge import Edge, chi_squared, square_roots
from lineloom_core.graph.normal_equations import CAUCHY_K
from lineloom_core.graph.piece import Piece
from lineloom_core.graph.relax import relax
from lineloom_core.timing import timed

_ANCHOR_SIGMA = 1e-5  # m, rad: fixes the gauge without spoiling the condition of the system
_TOLERANCE = 1e-7
_MAX_ITERATIONS = 60


@dataclass(frozen=True)
class Solution:
    """The optimised poses and how well each edge agrees with them.

    poses: by node id, every node given. chi2: squared whitened error by edge id, without robust
    kernel. weights: what the robust kernel left of the edge, 1 = all (always 1 for edges that are
    not robust).
    """

    poses: dict[int, Pose]
    chi2: dict[str, float]
    weights: dict[str, float]


def optimize(
    nodes: Mapping[int, Pose], edges: Sequence[Edge], anchors: Sequence[int] = ()
) -> Solution:
    """Return the poses that agree best with the edges, starting from those given.

    Robust edges under a Cauchy kernel. `anchors` keep their poses exactly; a component without one
    is held at its smallest node. A node without edges keeps its pose. The result depends on the
    values given, not on the order of `nodes` or `edges`, bit for bit.

    Raises KeyError for an edge or anchor whose node is missing, ValueError for two anchors in one
    component.
    """
    ordered = sorted(edges, key=lambda e: (e.node_a, e.node_b, e.id))
    whole = Piece.of(nodes, ordered)
    held = {whole.row(anchor): anchor for anchor in anchors}
    poses = dict(nodes)
    for rows in whole.connected():
        here = [row for row in rows.tolist() if row in held]
        if len(here) > 1:
            raise ValueError(f"anchors {[held[row] for row in here]} are in one component")
        piece = whole.part(rows)
        anchor = int(piece.ids[0]) if not here else held[here[0]]
        solved = settle(piece, piece.row(anchor)).tolist()
        poses.update(zip(piece.ids.tolist(), (Pose(*row) for row in solved), strict=True))
    chi2 = chi_squared(ordered, poses)
    by_id = {edge.id: float(c) for edge, c in zip(ordered, chi2, strict=True)}
    return Solution(
        poses=poses,
        chi2={edge.id: by_id[edge.id] for edge in edges},
        weights={edge.id: _weight(edge, by_id[edge.id]) for edge in edges},
    )


@timed("optimise")
def settle(piece: Piece, held: int) -> NDArray[np.float64]:
    """Return the poses (n, 3) of a connected piece that agree best with its edges.

    Starts from the piece's own; the node in row `held` keeps its pose exactly. The same values in
    the same order give the same bits.
    """
    if not len(piece.ends):
        return piece.poses
    poses = relax(piece, held)
    return levenberg_marquardt(piece, held) if poses is None else poses


def levenberg_marquardt(
    piece: Piece,
    held: int,
    *,
    tolerance: float = _TOLERANCE,
) -> NDArray[np.float64]:
    """Return what `settle` does, by gtsam. tolerance: of the cost, relative and absolute."""
    values = gtsam.Values()
    for i, (x, y, theta) in enumerate(piece.poses.tolist()):
        values.insert(i, gtsam.Pose2(x, y, theta))
    graph = _factor_graph(piece)
    prior = gtsam.noiseModel.Isotropic.Sigma(3, _ANCHOR_SIGMA)
    graph.add(gtsam.PriorFactorPose2(held, gtsam.Pose2(*piece.poses[held].tolist()), prior))
    parameters = _parameters(tolerance)
    optimizer = gtsam.LevenbergMarquardtOptimizer(graph, values, parameters)
    solved: NDArray[np.float64] = gtsam.utilities.extractPose2(optimizer.optimize())
    solved[:, 2] = wrap_array(solved[:, 2])
    solved[held] = piece.poses[held]  # the prior holds it to rounding; make it exact
    return solved


def _weight(edge: Edge, chi2: float) -> float:
    return CAUCHY_K**2 / (CAUCHY_K**2 + chi2) if edge.robust else 1.0


def _factor_graph(piece: Piece) -> gtsam.NonlinearFactorGraph:
    roots = square_roots(piece.information)
    kernel = gtsam.noiseModel.mEstimator.Cauchy.Create(CAUCHY_K)
    graph = gtsam.NonlinearFactorGraph()
    ends, measured, robust = piece.ends.tolist(), piece.measured.tolist(), piece.robust.tolist()
    for (a, b), T_a_b, root, yields in zip(ends, measured, roots, robust, strict=True):
        # smart=False: gtsam must not rewrite the root as sigmas, that divides by the zeros of a
        # corridor's information.
        noise: gtsam.noiseModel.Base = gtsam.noiseModel.Gaussian.SqrtInformation(root, False)
        if yields:
            noise = gtsam.noiseModel.Robust.Create(kernel, noise)
        graph.add(gtsam.BetweenFactorPose2(a, b, gtsam.Pose2(*T_a_b), noise))
    return graph


def _parameters(tolerance: float) -> gtsam.LevenbergMarquardtParams:
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setOrderingType("METIS")
    parameters.setMaxIterations(_MAX_ITERATIONS)
    parameters.setRelativeErrorTol(tolerance)
    parameters.setAbsoluteErrorTol(tolerance)
    return parameters

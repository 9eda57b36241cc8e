"""gtsam's ISAM2 over one component of a pose graph.

After Kaess et al. 2012: nodes and edges enter and leave, and only what they touch is eliminated
anew. The same growths in the same order give the same bits, in any process: that is what restoring
a snapshot rests on, for an ISAM2 cannot be stored itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import gtsam
import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import se2
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.graph.deep_stack import with_depth
from lineloom_core.graph.factors import anchor, factors_of, poses_of, values_of
from lineloom_core.graph.growth import Growth

Purpose = Literal["poses", "drift"]
"""What a tree is for: poses, edges weighed as robust ones; or drift, by `drift_information`."""

_RELINEARISE = 0.01  # m, rad: a pose that moves by more is linearised anew
_WILDFIRE = 1e-4  # m, rad: changes below that are not handed on
_FAR = 0.1
"""m, rad: where a pose has moved by more, all are linearised anew at once."""
_MOST_ROUNDS = 10


class UnsettledError(RuntimeError):
    """Poses do not come to rest from where they are, or the edges leave a node free to move."""


class BayesTree:
    """One component: its node `held` stays where it is.

    ids: (n,) its nodes, ascending. poses: (n, 3) their estimates; of a tree for drift, as entered.
    """

    def __init__(self, purpose: Purpose, held: int, start: Growth) -> None:
        self._purpose, self._held = purpose, held
        self._pose = start.poses[int(np.flatnonzero(start.ids == held)[0])]
        try:
            self._begin("CHOLESKY", start)
        except UnsettledError:
            # What ties the far end of a very long chain to the anchor is lost to rounding there.
            self._begin("QR", start)

    def _begin(self, factorization: Literal["CHOLESKY", "QR"], start: Growth) -> None:
        self._tree = gtsam.ISAM2(_parameters(self._purpose, factorization))
        self.ids, self.poses = np.zeros(0, np.int64), np.zeros((0, 3))
        self.grow(start)

    def grow(self, growth: Growth) -> None:
        """Take a growth. Raises UnsettledError, after which the tree is not to be used any more."""
        graph = gtsam.NonlinearFactorGraph()
        if not len(self.ids):
            graph.add(anchor(self._held, self._pose))
        for_poses = self._purpose == "poses"
        information = growth.information if for_poses else growth.drift_information
        robust = growth.robust if for_poses else np.zeros_like(growth.robust)
        graph.push_back(factors_of(growth.ends, growth.measured, information, robust))
        self._enter(growth)
        with_depth(len(self.ids), lambda: self._update(graph, growth))

    def _enter(self, growth: Growth) -> None:
        ids = np.concatenate([self.ids, growth.ids])
        poses = np.concatenate([self.poses, growth.poses])
        order = np.argsort(ids, kind="stable")
        order = order[~np.isin(ids[order], growth.gone)]
        self.ids, self.poses = ids[order], poses[order]

    def _update(self, graph: gtsam.NonlinearFactorGraph, growth: Growth) -> None:
        # Slots are not used again: an edge's is its number, after that of the anchor.
        removed = (growth.removed + 1).tolist()
        try:
            self._tree.update(graph, values_of(growth.ids, growth.poses), removed)
            if self._purpose == "poses":
                self._come_to_rest()
        except RuntimeError as error:
            raise UnsettledError(str(error).strip().partition("\n")[0]) from error

    def _come_to_rest(self) -> None:
        for _ in range(_MOST_ROUNDS):
            before, self.poses = self.poses, poses_of(self._tree.calculateEstimate())
            moved = self.poses - before
            moved[:, 2] = wrap_array(moved[:, 2])
            if np.abs(moved).max() < _FAR:
                return
            self._tree.update()
        raise UnsettledError("poses do not come to rest")

    def relative_covariances(self, nodes: Sequence[int]) -> NDArray[np.float64]:
        """Return the covariances of T_a_b between all of some nodes, (n, n, 3, 3) [a, b], at b.

        With T_a_b = T_a^-1 T_b, the tangents relate by xi_ab = xi_b - Ad(T_b_a) xi_a. Asked for at
        once, for two take nearly as long as sixty. Raises KeyError for an unknown node.
        """
        self._known(nodes)
        n = len(nodes)
        whole, poses = with_depth(len(self.ids), lambda: self._joint(list(nodes)))
        blocks = whole.reshape(n, 3, n, 3).swapaxes(1, 2)
        own = blocks[np.arange(n), np.arange(n)]
        A = se2.adjoint(se2.between(poses[None, :], poses[:, None]))  # [a, b]: Ad(T_b_a)
        A_T = np.swapaxes(A, 2, 3)
        cross = A @ blocks
        C = own[None, :] + A @ own[:, None] @ A_T - cross - np.swapaxes(cross, 2, 3)
        C[np.arange(n), np.arange(n)] = 0.0
        return np.asarray(0.5 * (C + np.swapaxes(C, 2, 3)))

    def _joint(self, nodes: list[int]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        at = self._tree.getLinearizationPoint()
        poses = [at.atPose2(node) for node in nodes]
        whole = self._tree.jointMarginalCovariance(nodes).fullMatrix()
        return whole, np.array([(p.x(), p.y(), p.theta()) for p in poses])

    def _known(self, nodes: Sequence[int]) -> None:
        for node in nodes:
            if not self._tree.valueExists(node):
                raise KeyError(f"node {node} is not in the tree")


def _parameters(purpose: Purpose, factorization: str) -> gtsam.ISAM2Params:
    parameters, method = gtsam.ISAM2Params(), gtsam.ISAM2GaussNewtonParams()
    method.setWildfireThreshold(_WILDFIRE)
    parameters.setOptimizationParams(method)
    parameters.setRelinearizeThreshold(_RELINEARISE)
    parameters.relinearizeSkip = 1
    parameters.setFactorization(factorization)
    # Drift is judged where the poses were when they entered: they move by little until an epoch
    # ends, and nothing is to be eliminated anew for that.
    parameters.enableRelinearization = purpose == "poses"
    return parameters

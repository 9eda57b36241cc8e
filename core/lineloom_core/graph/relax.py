"""Gauss-Newton from poses that are nearly right: how a graph that has grown a little settles.

Exact: all poses move until none moves by more than 1 um any more. Stateless: the result follows
from the piece alone, bit for bit, however the graph came to be as it is. Once steps are down to a
millimetre, the matrix stays as it is for as long as they go on shrinking well.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lineloom_core.graph.normal_equations import NormalEquations
from lineloom_core.graph.piece import Piece

_SETTLED = 1e-6  # m, rad
_MOST_STEPS = 40
_NEAR = 1e-3  # m, rad
_SHRINKS_WELL = 0.3
_ROUNDING = 1e-9


def relax(piece: Piece, held: int) -> NDArray[np.float64] | None:
    """Return the poses (n, 3) that agree best with the edges, the node in row `held` staying.

    None where Gauss-Newton does not get there: the cost rises, a node is free to move, or it takes
    too long. That is a case for damping.
    """
    equations, poses = NormalEquations(piece, held), piece.poses.copy()
    cost, before, renew = np.inf, np.inf, True
    for _ in range(_MOST_STEPS):
        now = equations.cost_at(poses, renew=renew)
        if now > cost + _ROUNDING * (1.0 + cost) or (renew and not equations.factorise()):
            return None
        longest = equations.step(poses)
        if longest < _SETTLED:
            return poses
        renew = longest > min(_NEAR, _SHRINKS_WELL * before)
        cost, before = now, longest
    return None

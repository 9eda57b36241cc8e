"""The optimum of a whole component at once, as exact as it gets: what a map rests at.

gtsam's Gauss-Newton, from poses that the Bayes tree has brought near; where that does not get
there, Levenberg-Marquardt from the same start. Ordering: METIS. COLAMD makes the elimination tree
of a chain as deep as the chain is long. METIS's seed is a constant, so the ordering is the same in
every process.
"""

from __future__ import annotations

from typing import TypeVar

import gtsam
import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry.angles import wrap_array
from lineloom_core.graph.deep_stack import with_depth
from lineloom_core.graph.factors import anchor, factors_of, poses_of, values_of
from lineloom_core.graph.growth import Growth
from lineloom_core.timing import timed

_TOLERANCE = 1e-12  # of the cost, relative and absolute
_AT_REST = 1e-9  # m, rad: rounding
_MOST_STEPS = 40
_MOST_DAMPED = 200
_Parameters = TypeVar("_Parameters", gtsam.GaussNewtonParams, gtsam.LevenbergMarquardtParams)


@timed("settle")
def settle(component: Growth, held: int) -> tuple[NDArray[np.float64], gtsam.NonlinearFactorGraph]:
    """Return the poses (n, 3) of a connected component, by ascending node, that fit its edges best.

    Starts from its own; the node `held` keeps its pose exactly, and where all rest there already
    all do. The same values in the same order give the same bits. With gtsam's graph of it.
    """
    order = np.argsort(component.ids, kind="stable")
    begin = component.poses[order]
    graph = gtsam.NonlinearFactorGraph()
    if not len(component.ends):
        return begin, graph
    row = int(np.searchsorted(component.ids[order], held))
    graph.add(anchor(held, begin[row]))
    edges = component.ends, component.measured, component.information, component.robust
    graph.push_back(factors_of(*edges))
    values = values_of(component.ids, component.poses)
    solved = with_depth(len(begin), lambda: poses_of(_optimum(graph, values)))
    solved[row] = begin[row]  # the prior holds it to rounding; make it exact
    moved = solved - begin
    moved[:, 2] = wrap_array(moved[:, 2])
    return (begin if np.abs(moved).max() < _AT_REST else solved), graph


def _optimum(graph: gtsam.NonlinearFactorGraph, start: gtsam.Values) -> gtsam.Values:
    before = graph.error(start)
    plain = _limited(gtsam.GaussNewtonParams(), _MOST_STEPS)
    try:
        optimizer = gtsam.GaussNewtonOptimizer(graph, start, plain)
        found = optimizer.optimize()
        if optimizer.iterations() < _MOST_STEPS and graph.error(found) <= before * (1.0 + 1e-9):
            return found
    except RuntimeError:
        pass  # a node is free to move: damping holds it
    damped = _limited(gtsam.LevenbergMarquardtParams(), _MOST_DAMPED)
    return gtsam.LevenbergMarquardtOptimizer(graph, start, damped).optimize()


def _limited(parameters: _Parameters, steps: int) -> _Parameters:
    parameters.setOrderingType("METIS")
    parameters.setMaxIterations(steps)
    parameters.setRelativeErrorTol(_TOLERANCE)
    parameters.setAbsoluteErrorTol(_TOLERANCE)
    return parameters

"""Pairwise-consistent sets of candidate constraints.

After Mangelson, Dominic, Eustice and Vasudevan 2018 (PCM): two constraints between two rigid
pieces close a cycle; if both are right, the cycle's error is noise. False matches seldom agree
with each other, so the largest set in which every pair agrees is the one to believe.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import se2

CHI2_99 = 11.345
"""99 % quantile of chi-squared with 3 degrees of freedom."""

RelativeCovariance = Callable[[int, int], NDArray[np.float64]]
"""(i, j) -> covariance (3, 3) of T_i_j in the tangent at j, i and j numbers of constraints."""

_NODE_BUDGET = 20_000  # of the exact search: some 50 ms, then greedy has to do
_EXACT_UP_TO = 64
_GREEDY_STARTS = 64


def cycle_errors(
    T_A_a: NDArray[np.float64],
    T_B_b: NDArray[np.float64],
    T_a_b: NDArray[np.float64],
    covariance: NDArray[np.float64],
    drift_a: RelativeCovariance | NDArray[np.float64] | None = None,
    drift_b: RelativeCovariance | NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return the squared Mahalanobis cycle error of every pair of constraints, shape (n, n).

    T_A_a, T_B_b: (n, 3), poses of the constraints' ends in the frames of pieces A and B (the same
    frame for loops within one graph). T_a_b: (n, 3), the constraints. covariance: (n, 3, 3) of
    each constraint, in the tangent at b. drift_a, drift_b: covariance of the relative pose of end
    i and end j within its piece, as a function of (i, j) or an array (n, n, 3, 3) [i, j], in the
    tangent at end j; None: the piece is rigid and exact.

    The cycle is a_i -> b_i -> b_j -> a_j -> a_i; all four covariances are carried to its end. They
    are taken as independent: shared history makes the test somewhat stricter than it says.
    The result is symmetric with a zero diagonal.
    """
    n = T_A_a.shape[0]
    d2 = np.zeros((n, n))
    i, j = np.triu_indices(n, k=1)
    if i.size == 0:
        return d2
    T_bi_bj = se2.between(T_B_b[i], T_B_b[j])
    T_aj_ai = se2.between(T_A_a[j], T_A_a[i])
    T_bj_ai = se2.compose(se2.inverse(T_a_b[j]), T_aj_ai)
    cycle = se2.compose(se2.compose(T_a_b[i], T_bi_bj), T_bj_ai)
    total = se2.transport(covariance[i], se2.inverse(se2.compose(T_bi_bj, T_bj_ai)))
    at_bj = covariance[j] + _drift(drift_b, i, j)  # the inverse of constraint j starts at b_j
    total = total + se2.transport(at_bj, se2.inverse(T_bj_ai)) + _drift(drift_a, j, i)
    error = se2.log(cycle)
    # The tiny ridge keeps exact inputs (all covariances zero) solvable: equal stays equal.
    solved = np.linalg.solve(total + 1e-12 * np.eye(3), error[:, :, None])[:, :, 0]
    d2[i, j] = np.einsum("ni,ni->n", error, solved)
    d2[j, i] = d2[i, j]
    return d2


def pairwise_consistent(
    T_A_a: NDArray[np.float64],
    T_B_b: NDArray[np.float64],
    T_a_b: NDArray[np.float64],
    covariance: NDArray[np.float64],
    drift_a: RelativeCovariance | NDArray[np.float64] | None = None,
    drift_b: RelativeCovariance | NDArray[np.float64] | None = None,
    chi2_max: float = CHI2_99,
) -> NDArray[np.bool_]:
    """Return which constraints agree, shape (n, n), symmetric, true on the diagonal.

    Arguments as in `cycle_errors`. chi2_max: greatest squared cycle error that passes.
    """
    consistent: NDArray[np.bool_] = (
        cycle_errors(T_A_a, T_B_b, T_a_b, covariance, drift_a, drift_b) < chi2_max
    )
    return consistent


def largest_consistent_set(
    consistent: NDArray[np.bool_], exact_up_to: int = _EXACT_UP_TO
) -> tuple[int, ...]:
    """Return the largest set of mutually consistent constraints, as sorted numbers.

    Exact up to `exact_up_to` constraints, as long as the search stays within its budget; greedy
    beyond. Of several largest sets the exact search takes the lexicographically first: put the
    best-scored constraints first. Deterministic in either case.
    """
    n = consistent.shape[0]
    greedy = _greedy_clique(consistent)
    if n > exact_up_to:
        return greedy
    found = _exact_clique(consistent)
    return greedy if found is None or len(found) < len(greedy) else found


def consistent_sets(
    consistent: NDArray[np.bool_], least: int = 2, exact_up_to: int = _EXACT_UP_TO
) -> tuple[tuple[int, ...], ...]:
    """Return disjoint consistent sets, largest first, each of at least `least` constraints.

    Takes the largest set away and looks again: the second set is the rival that a merge has to
    beat.
    """
    rest = np.arange(consistent.shape[0])
    sets: list[tuple[int, ...]] = []
    while rest.size:
        inner = largest_consistent_set(consistent[np.ix_(rest, rest)], exact_up_to)
        if len(inner) < least:
            break
        sets.append(tuple(int(v) for v in rest[list(inner)]))
        rest = np.delete(rest, list(inner))
    return tuple(sets)


def _drift(
    source: RelativeCovariance | NDArray[np.float64] | None,
    first: NDArray[np.int64],
    second: NDArray[np.int64],
) -> NDArray[np.float64]:
    if source is None:
        return np.zeros((first.size, 3, 3))
    if callable(source):
        return np.stack([source(int(i), int(j)) for i, j in zip(first, second, strict=True)])
    chosen: NDArray[np.float64] = source[first, second]
    return chosen


def _exact_clique(consistent: NDArray[np.bool_]) -> tuple[int, ...] | None:
    """Branch and bound over bit sets, lowest number first; None when the budget runs out.

    Depth first, including before leaving out, in ascending order: the first clique of its size is
    the lexicographically first. Cut where even a greedy colouring of the open candidates (an upper
    bound of any clique among them) cannot beat the best.
    """
    n = consistent.shape[0]
    neighbours = [
        sum(1 << j for j in range(n) if j != i and bool(consistent[i, j])) for i in range(n)
    ]
    best: tuple[int, ...] = ()
    budget = _NODE_BUDGET
    stack: list[tuple[tuple[int, ...], int]] = [((), (1 << n) - 1)]
    while stack:
        chosen, open_set = stack.pop()
        if len(chosen) > len(best):
            best = chosen
        if open_set == 0 or len(chosen) + _colours(open_set, neighbours) <= len(best):
            continue
        budget -= 1
        if budget < 0:
            return None
        lowest = (open_set & -open_set).bit_length() - 1
        stack.append((chosen, open_set & ~(1 << lowest)))  # later: without it
        stack.append(((*chosen, lowest), open_set & neighbours[lowest]))
    return best


def _colours(open_set: int, neighbours: list[int]) -> int:
    """Return the number of colours a greedy colouring of the open vertices takes."""
    count = 0
    while open_set:
        count += 1
        same = open_set
        while same:
            lowest = same & -same
            open_set &= ~lowest
            same &= ~(lowest | neighbours[lowest.bit_length() - 1])
    return count


def _greedy_clique(consistent: NDArray[np.bool_]) -> tuple[int, ...]:
    """Grow from each of the best connected constraints, always by the one that keeps most open."""
    links = consistent & ~np.eye(consistent.shape[0], dtype=np.bool_)
    best: tuple[int, ...] = ()
    for start in np.argsort(-links.sum(axis=1), kind="stable")[:_GREEDY_STARTS]:
        chosen = [int(start)]
        open_set = np.flatnonzero(links[start])
        while open_set.size:
            kept = links[np.ix_(open_set, open_set)].sum(axis=1)
            taken = open_set[int(np.argmax(kept))]
            chosen.append(int(taken))
            open_set = open_set[links[taken, open_set]]
        if len(chosen) > len(best):
            best = tuple(sorted(chosen))
    return best

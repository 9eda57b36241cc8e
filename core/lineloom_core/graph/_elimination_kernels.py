"""Numba kernels of sparse Cholesky on 3x3 blocks: order, factor, substitute, invert.

Slow twins: tests/core/graph/dense_twins.py. Columns are numbered in the order of elimination.
Column j of the factor has its diagonal block in diagonal[j] and the blocks below it in
below[p], p in [starts[j], starts[j + 1]), at the rows rows[p], which ascend.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.kernels import kernel


@kernel
def grown(a, need):  # type: ignore[no-untyped-def]
    """The array, or twice as long a copy where it is shorter than `need`."""
    if need <= a.shape[0]:
        return a
    longer = np.empty(max(need, 2 * a.shape[0]), a.dtype)
    longer[: a.shape[0]] = a
    return longer


@kernel
def neighbour_lists(count, ends):  # type: ignore[no-untyped-def]
    """Every node's neighbours, each once: pool, and where each list begins, its size and room."""
    room = np.zeros(count, np.int64)
    for e in range(ends.shape[0]):
        room[ends[e, 0]] += 1
        room[ends[e, 1]] += 1
    begin = np.zeros(count, np.int64)
    total = 0
    for v in range(count):
        begin[v] = total
        total += room[v]
    pool = np.empty(4 * total + 16, np.int64)
    size = np.zeros(count, np.int64)
    for e in range(ends.shape[0]):
        for k in range(2):
            v, w = ends[e, k], ends[e, 1 - k]
            pool[begin[v] + size[v]] = w
            size[v] += 1
    seen = np.full(count, -1, np.int64)
    for v in range(count):
        kept = 0
        for p in range(begin[v], begin[v] + size[v]):
            w = pool[p]
            if seen[w] != v:
                seen[w] = v
                pool[begin[v] + kept] = w
                kept += 1
        size[v] = kept
    return pool, begin, size, room, total


@kernel
def move_bucket(head, after, before, v, old, new):  # type: ignore[no-untyped-def]
    """Move a node between the lists of nodes of one degree; -1: from or to none."""
    if old >= 0:
        if before[v] >= 0:
            after[before[v]] = after[v]
        else:
            head[old] = after[v]
        if after[v] >= 0:
            before[after[v]] = before[v]
    if new >= 0:
        after[v] = head[new]
        before[v] = -1
        if head[new] >= 0:
            before[head[new]] = v
        head[new] = v


@kernel
def minimum_degree(count, ends):  # type: ignore[no-untyped-def]
    """Symbolic elimination of a graph without loops: order, starts, rows.

    Greedy: always a node with the fewest neighbours left, which become neighbours of each other.
    Chains fold up first, without any fill; what is left is the graph of their ends. Of several such
    nodes the one that got there last, so the order follows from that of `ends` alone.
    """
    pool, begin, size, room, used = neighbour_lists(count, ends)
    head = np.full(count + 1, -1, np.int64)
    after, before = np.full(count, -1, np.int64), np.full(count, -1, np.int64)
    for v in range(count - 1, -1, -1):
        move_bucket(head, after, before, v, -1, size[v])
    mark = np.full(count, -1, np.int64)
    order, starts = np.empty(count, np.int64), np.zeros(count + 1, np.int64)
    out = np.empty(2 * used + 16, np.int64)
    degree = stamp = filled = 0
    for step in range(count):
        while head[degree] < 0:
            degree += 1
        v = head[degree]
        move_bucket(head, after, before, v, degree, -1)
        order[step] = v
        out = grown(out, filled + size[v])
        out[filled : filled + size[v]] = pool[begin[v] : begin[v] + size[v]]
        clique_end = filled + size[v]
        for p in range(filled, clique_end):
            u = out[p]
            stamp += 1
            mark[u] = stamp
            kept = 0
            for q in range(begin[u], begin[u] + size[u]):
                w = pool[q]
                mark[w] = stamp
                if w != v:
                    pool[begin[u] + kept] = w
                    kept += 1
            fresh = 0
            for q in range(filled, clique_end):
                if mark[out[q]] != stamp:
                    fresh += 1
            if kept + fresh > room[u]:
                room[u] = 2 * (kept + fresh)
                pool = grown(pool, used + room[u])
                pool[used : used + kept] = pool[begin[u] : begin[u] + kept]
                begin[u] = used
                used += room[u]
            for q in range(filled, clique_end):
                if mark[out[q]] != stamp:
                    pool[begin[u] + kept] = out[q]
                    kept += 1
            if kept != size[u]:
                move_bucket(head, after, before, u, size[u], kept)
                size[u] = kept
            degree = min(degree, kept)
        filled = clique_end
        starts[step + 1] = filled
    return order, starts, numbered(order, starts, out)


@kernel
def numbered(order, starts, nodes):  # type: ignore[no-untyped-def]
    """The columns' nodes as row numbers, ascending within each column."""
    count = order.shape[0]
    rank = np.empty(count, np.int64)
    for step in range(count):
        rank[order[step]] = step
    rows = np.empty(starts[count], np.int64)
    for step in range(count):
        first = starts[step]
        for p in range(first, starts[step + 1]):
            r, q = rank[nodes[p]], p
            while q > first and rows[q - 1] > r:
                rows[q] = rows[q - 1]
                q -= 1
            rows[q] = r
    return rows


@kernel
def slots_of(ends, starts, rows):  # type: ignore[no-untyped-def]
    """Where each pair of columns has its block in `below`; -1 where a column is none (-1)."""
    slots = np.full(ends.shape[0], -1, np.int64)
    for e in range(ends.shape[0]):
        low, high = min(ends[e, 0], ends[e, 1]), max(ends[e, 0], ends[e, 1])
        if low >= 0:
            p = starts[low]
            while rows[p] != high:
                p += 1
            slots[e] = p
    return slots


@kernel
def root3(d, least):  # type: ignore[no-untyped-def]
    """Cholesky of a 3x3 block in place; false where a pivot is not above its `least`."""
    for r in range(3):
        for c in range(r):
            for k in range(c):
                d[r, c] -= d[r, k] * d[c, k]
            d[r, c] /= d[c, c]
            d[r, r] -= d[r, c] * d[r, c]
        if not d[r, r] > least[r]:
            return False
        d[r, r] = math.sqrt(d[r, r])
    return True


@kernel
def factorise(diagonal, below, starts, rows, least):  # type: ignore[no-untyped-def]
    """Turn the lower half of a symmetric matrix into its Cholesky factor in place.

    least: (n, 3), what pivots must exceed. Returns the first column that did not, -1 if all did.
    """
    for j in range(diagonal.shape[0]):
        d = diagonal[j]
        if not root3(d, least[j]):
            return j
        first, last = starts[j], starts[j + 1]
        l10, l20, l21 = d[1, 0], d[2, 0], d[2, 1]
        i0, i1, i2 = 1.0 / d[0, 0], 1.0 / d[1, 1], 1.0 / d[2, 2]
        for p in range(first, last):
            B = below[p]
            for r in range(3):
                B[r, 0] *= i0
                B[r, 1] = (B[r, 1] - B[r, 0] * l10) * i1
                B[r, 2] = (B[r, 2] - B[r, 0] * l20 - B[r, 1] * l21) * i2
        for p in range(first, last):
            u, A = rows[p], below[p]
            subtract_product(diagonal[u], A, A.T)
            t = starts[u]
            for q in range(p + 1, last):
                while rows[t] != rows[q]:
                    t += 1
                subtract_product(below[t], below[q], A.T)
    return -1


@kernel
def subtract_product(C, A, B):  # type: ignore[no-untyped-def]
    """C -= A B of 3x3 blocks, any of which may be a transposed view."""
    b00, b01, b02 = B[0, 0], B[0, 1], B[0, 2]
    b10, b11, b12 = B[1, 0], B[1, 1], B[1, 2]
    b20, b21, b22 = B[2, 0], B[2, 1], B[2, 2]
    for r in range(3):
        a0, a1, a2 = A[r, 0], A[r, 1], A[r, 2]
        C[r, 0] -= a0 * b00 + a1 * b10 + a2 * b20
        C[r, 1] -= a0 * b01 + a1 * b11 + a2 * b21
        C[r, 2] -= a0 * b02 + a1 * b12 + a2 * b22


@kernel
def substitute(diagonal, below, starts, rows, x, begin):  # type: ignore[no-untyped-def]
    """Solve in place, x (n, 3): right sides by columns; nothing but zeros before `begin`."""
    count = diagonal.shape[0]
    for j in range(begin, count):
        d = diagonal[j]
        x[j, 0] = x[j, 0] / d[0, 0]
        x[j, 1] = (x[j, 1] - d[1, 0] * x[j, 0]) / d[1, 1]
        x[j, 2] = (x[j, 2] - d[2, 0] * x[j, 0] - d[2, 1] * x[j, 1]) / d[2, 2]
        x0, x1, x2 = x[j, 0], x[j, 1], x[j, 2]
        for p in range(starts[j], starts[j + 1]):
            B, u = below[p], rows[p]
            for r in range(3):
                x[u, r] -= B[r, 0] * x0 + B[r, 1] * x1 + B[r, 2] * x2
    for j in range(count - 1, -1, -1):
        x0, x1, x2 = x[j, 0], x[j, 1], x[j, 2]
        for p in range(starts[j], starts[j + 1]):
            B, u = below[p], rows[p]
            for r in range(3):
                x0 -= B[r, 0] * x[u, r]
                x1 -= B[r, 1] * x[u, r]
                x2 -= B[r, 2] * x[u, r]
        d = diagonal[j]
        x[j, 2] = x2 / d[2, 2]
        x[j, 1] = (x1 - d[2, 1] * x[j, 2]) / d[1, 1]
        x[j, 0] = (x0 - d[1, 0] * x[j, 1] - d[2, 0] * x[j, 2]) / d[0, 0]


@kernel
def divide_right(S, d):  # type: ignore[no-untyped-def]
    """S <- S d^-1 with the lower triangular d."""
    for r in range(3):
        S[r, 2] /= d[2, 2]
        S[r, 1] = (S[r, 1] - S[r, 2] * d[2, 1]) / d[1, 1]
        S[r, 0] = (S[r, 0] - S[r, 1] * d[1, 0] - S[r, 2] * d[2, 0]) / d[0, 0]


@kernel
def diagonal_of_inverse(diagonal, below, starts, rows):  # type: ignore[no-untyped-def]
    """Diagonal blocks of the inverse, (n, 3, 3), from the factor.

    After Takahashi, Fagan and Chin 1973: from the last column to the first, only blocks where the
    factor has some; Z L = L^-T, whose lower half is its diagonal.
    """
    Z, out = np.zeros(below.shape), np.zeros(diagonal.shape)
    S = np.empty((3, 3))
    for j in range(diagonal.shape[0] - 1, -1, -1):
        first, last = starts[j], starts[j + 1]
        for p in range(first, last):  # Z[u, j] = -(sum over w of Z[u, w] L[w, j]) L[j, j]^-1
            u = rows[p]
            subtract_product(Z[p], out[u], below[p])
            t = starts[u]
            for q in range(p + 1, last):
                while rows[t] != rows[q]:
                    t += 1
                subtract_product(Z[p], Z[t].T, below[q])
                subtract_product(Z[q], Z[t], below[p])
        d = diagonal[j]
        invert_turned(d, S)
        for p in range(first, last):
            divide_right(Z[p], d)
            subtract_product(S, Z[p].T, below[p])
        divide_right(S, d)
        for r in range(3):
            for c in range(3):
                out[j, r, c] = 0.5 * (S[r, c] + S[c, r])
    return out


@kernel
def invert_turned(d, out):  # type: ignore[no-untyped-def]
    """out = d^-T, upper triangular, of the lower triangular d."""
    out[:] = 0.0
    out[0, 0], out[1, 1], out[2, 2] = 1.0 / d[0, 0], 1.0 / d[1, 1], 1.0 / d[2, 2]
    out[0, 1] = -d[1, 0] * out[0, 0] * out[1, 1]
    out[1, 2] = -d[2, 1] * out[1, 1] * out[2, 2]
    out[0, 2] = -(d[2, 0] * out[0, 0] + d[2, 1] * out[0, 1]) * out[2, 2]

"""The matching table: lists of distinguishability scores that may become invalid (§5.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.matching.thesis.config import Windows
from lineloom_core.matching.thesis.consistency import ConsistencyTables
from lineloom_core.matching.thesis.distinguishability import (
    count,
    distinguishability,
    matching_relations,
)
from lineloom_core.matching.thesis.edges import NONE
from lineloom_core.matching.thesis.relations import RelationSet

NO_CELL = -1


@dataclass(eq=False)
class MatchingTable:
    """A |L_r| x |L_c| matrix of lists of scoreIDs, and the scores they point to (Fig. 5.1).

    shape: (|L_r|, |L_c|). score: (n,) by scoreID. is_valid: (n,). cells: (n, 4) the cells
    (row * |L_c| + column) in whose lists each scoreID stands, each once, NO_CELL beyond.
    merged: (|L_r|, |L_c|) sums of the valid scores of each list, kept up to date (Table 5.1).
    ids, list_start: the lists, cell after cell; the list of cell q is
    ids[list_start[q]:list_start[q + 1]].
    """

    shape: tuple[int, int]
    score: NDArray[np.float64]
    is_valid: NDArray[np.bool_]
    cells: NDArray[np.int64]
    merged: NDArray[np.float64]
    valid_count: NDArray[np.int64]
    ids: NDArray[np.int64]
    list_start: NDArray[np.int64]

    @staticmethod
    def of(
        shape: tuple[int, int], score: NDArray[np.float64], cells: NDArray[np.int64]
    ) -> MatchingTable:
        """File n scores, all valid, into the lists of their cells (n, p), p <= 4."""
        size = shape[0] * shape[1]
        row, nth = np.nonzero(cells != NO_CELL)
        cell = cells[row, nth]
        order = np.argsort(cell, kind="stable")
        length = np.bincount(cell, minlength=size).astype(np.int64)
        merged = np.bincount(cell, weights=score[row], minlength=size).astype(np.float64)
        return MatchingTable(
            shape=shape,
            score=score,
            is_valid=np.ones(len(score), bool),
            cells=cells,
            merged=merged.reshape(shape),
            valid_count=length.reshape(shape),
            ids=row[order].astype(np.int64),
            list_start=np.concatenate([[0], np.cumsum(length)]).astype(np.int64),
        )

    def copy(self) -> MatchingTable:
        """Return a table whose scores can be invalidated independently."""
        return MatchingTable(
            self.shape,
            self.score,
            self.is_valid.copy(),
            self.cells,
            self.merged.copy(),
            self.valid_count.copy(),
            self.ids,
            self.list_start,
        )

    def list_at(self, i: int, j: int) -> NDArray[np.int64]:
        """The list of scoreIDs at matchingTable(i, j), valid or not."""
        cell = i * self.shape[1] + j
        return self.ids[self.list_start[cell] : self.list_start[cell + 1]]

    def invalidate(self, cells: NDArray[np.bool_]) -> None:
        """Mark all scores in the lists of `cells`, (|L_r|, |L_c|) bool, as invalid.

        They become invalid in all other lists as well (Fig. 5.1(b)); merged scores follow. Where
        no valid score is left the merged score is 0 exactly.
        """
        hit = np.flatnonzero(cells & (self.valid_count > 0))
        if len(hit) == 0:
            return
        lists = [self.ids[self.list_start[q] : self.list_start[q + 1]] for q in hit.tolist()]
        ids = np.unique(np.concatenate(lists))
        ids = ids[self.is_valid[ids]]
        self.is_valid[ids] = False
        row, nth = np.nonzero(self.cells[ids] != NO_CELL)
        cell = self.cells[ids][row, nth]
        size = self.merged.size
        gone = np.bincount(cell, weights=self.score[ids][row], minlength=size)
        self.valid_count -= np.bincount(cell, minlength=size).reshape(self.shape)
        self.merged -= gone.reshape(self.shape)
        self.merged[self.valid_count == 0] = 0.0

    def find_maximum_score(self, matching_pairs: list[tuple[int, int]]) -> tuple[int, int, float]:
        """Algorithm 6: (row, column, merged score) of the greatest that is no match yet.

        The first one in the order of rows where several are equal; (0, 0, 0.0) where none is left.
        """
        candidates = self.merged.copy()
        for k, m in matching_pairs:
            candidates[k, m] = 0.0
        if candidates.size == 0:
            return 0, 0, 0.0
        row, column = divmod(int(np.argmax(candidates)), self.shape[1])
        return row, column, float(candidates[row, column])

    def mark_invalid_scores(self, k: int, m: int) -> None:
        """Algorithm 7: now that l_k and l_m match, nothing else in row k or column m can."""
        cells = np.zeros(self.shape, bool)
        cells[k, :] = cells[:, m] = True
        cells[k, m] = False
        self.invalidate(cells)

    def mark_invalid_scores_by_order(
        self, k: int, m: int, row_rank: NDArray[np.int64], column_rank: NDArray[np.int64]
    ) -> None:
        """Algorithm 10, both calls (§5.7): matches that l_k and l_m forbid if order is kept.

        row_rank, column_rank: (|L_r|,), (|L_c|,) places in the order of extraction; the line
        numbers themselves unless a full turn begins elsewhere.
        """
        before, after = row_rank[:, None] <= row_rank[k], row_rank[:, None] >= row_rank[k]
        right, left = column_rank >= column_rank[m], column_rank <= column_rank[m]
        cells = (before & right) | (after & left)
        cells[k, m] = False
        self.invalidate(cells)


def compute_scores(
    G_c: RelationSet,
    G_r: RelationSet,
    counts_c: tuple[NDArray[np.int64], ...],
    tables: ConsistencyTables,
    windows: Windows,
) -> MatchingTable:
    """Algorithm 4, ComputeScores: the matching table of L_r against L_c.

    counts_c: Count(g_c, G_c, T_{c x c}) by kind, which depends on S_c alone. tables: T_{r x c}.
    Departures: every match (g_c, g_r) has a scoreID of its own, so there are more than |G_c|; a
    cell holds a scoreID once, even where two edges of a relation share a line.
    """
    shape = (tables.lines.shape[0], tables.lines.shape[1])
    matches = matching_relations(G_c, G_r, tables, windows)
    counts_r = count(G_c, matches)
    scores, cells = [np.empty(0)], [np.empty((0, 4), np.int64)]
    for n, (i, j) in enumerate(matches):
        c, r = G_c.kinds[n], G_r.kinds[n]
        scores.append(distinguishability(counts_c[n], counts_r[n])[i])
        cells.append(_cells_of(r.lines[j], c.lines[i], shape[1]))
    return MatchingTable.of(shape, np.concatenate(scores), np.concatenate(cells))


def _cells_of(rows: NDArray[np.int64], columns: NDArray[np.int64], width: int) -> NDArray[np.int64]:
    """Cells (q, 4) of corresponding lines (q, p), p <= 4, each once; NO_CELL beyond."""
    cells = np.full((len(rows), 4), NO_CELL, np.int64)
    known = (rows != NONE) & (columns != NONE)
    p = rows.shape[1]
    cells[:, :p] = np.where(known, rows * width + columns, NO_CELL)
    for a in range(1, p):
        repeated = (cells[:, a : a + 1] == cells[:, :a]).any(axis=1)
        cells[repeated, a] = NO_CELL
    return cells

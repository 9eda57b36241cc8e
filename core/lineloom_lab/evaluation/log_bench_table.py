"""The tables of the benchmark of logs: how figures are set."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from lineloom_lab.evaluation.log_bench_pool import Pool


def table(cells: Sequence[Sequence[str]], names: int) -> str:
    """Set rows, the header first, as a table whose first `names` columns are text.

    Columns in which nothing stands are left out.
    """
    told = [k for k in range(len(cells[0])) if k < names or any(line[k] for line in cells[1:])]
    cells = [[line[k] for k in told] for line in cells]
    rule = ["---"] * names + ["---:"] * (len(cells[0]) - names)
    lines = [cells[0], rule, *cells[1:]]
    widths = [max(len(line[k]) for line in lines) for k in range(len(rule))]
    return "\n".join(
        "| " + " | ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)) + " |"
        for line in lines
    )


def percent(share: float | None) -> str:
    """Return a share in percent, nothing for None."""
    return "" if share is None else f"{100.0 * share:.1f}"


def metres(value: float | None) -> str:
    """Return a length to the millimetre, nothing for None."""
    return "" if value is None else f"{value:.3f}"


POOL_COLUMNS: dict[str, Callable[[Pool], str]] = {
    "one map": lambda pool: f"{pool.whole} of {pool.logs}",
    "in largest %": lambda pool: percent(pool.share_in_largest),
    "unplaced %": lambda pool: percent(pool.share_unplaced),
    "ATE m": lambda pool: metres(pool.ate_rmse),
    "wheels m": lambda pool: metres(pool.wheels_rmse),
    "worse": lambda pool: "" if pool.wheels_rmse is None else f"{pool.worse_than_wheels}",
    "agree %": lambda pool: percent(pool.share_agreeing),
    "wrong %": lambda pool: percent(pool.share_wrong),
    "relations %": lambda pool: percent(pool.share_relations_wrong),
    "steps right %": lambda pool: percent(pool.share_steps_right),
    "same %": lambda pool: percent(pool.share_same),
    "wrong steps": lambda pool: f"{pool.steps_wrong}",
    "breaks": lambda pool: f"{pool.breaks}",
    "CPU ms": lambda pool: f"{pool.cpu_ms:.2f}",
}
"""What a table says of several runs, by the column's name."""

"""One figure, its goal, and a baseline measured beside it in the same run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import median
from time import process_time
from typing import Literal, TypeVar

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the table.

    better: whether a lower or a higher figure is better. goal: None where there is none. baseline:
    what `baseline_figure`, in the same unit, was measured on. note: what was left out, and why.
    """

    name: str
    figure: float
    unit: str
    better: Literal["lower", "higher"]
    goal: float | None
    baseline: str
    baseline_figure: float
    note: str = ""

    @classmethod
    def of_times(
        cls,
        name: str,
        seconds: float,
        goal_ms: float | None,
        baseline: str,
        baseline_seconds: float,
        note: str = "",
    ) -> Row:
        """A time, shown in milliseconds."""
        return cls(
            name, 1e3 * seconds, "ms", "lower", goal_ms, baseline, 1e3 * baseline_seconds, note
        )

    @property
    def ratio(self) -> float:
        """How many times better than the baseline."""
        if self.better == "lower":
            return self.baseline_figure / self.figure
        return self.figure / self.baseline_figure

    @property
    def reached(self) -> bool | None:
        """Whether the goal is reached; None where there is none."""
        if self.goal is None:
            return None
        return self.figure <= self.goal if self.better == "lower" else self.figure >= self.goal


def median_seconds(
    work: Callable[[Item], object], items: Sequence[Item], *, repeats: int = 1
) -> float:
    """Median CPU time [s] of `work` over the items, each run `repeats` times in a row.

    CPU time, so that others on the machine count for as little as possible. One item runs before
    the clock does: nothing is compiled or loaded within.
    """
    work(items[0])
    return median(_seconds(work, item, repeats) for item in items)


def _seconds(work: Callable[[Item], object], item: Item, repeats: int) -> float:
    begin = process_time()
    for _ in range(repeats):
        work(item)
    return (process_time() - begin) / repeats


def table(rows: Iterable[Row]) -> str:
    """The rows as text in columns."""
    head = ("what", "figure", "goal", "", "baseline in the same run", "figure", "ratio")
    cells = [head, *(_cells(row) for row in rows)]
    widths = [max(len(line[k]) for line in cells) for k in range(len(head))]
    right = {1, 2, 5, 6}
    lines = [
        "  ".join(
            text.rjust(width) if k in right else text.ljust(width)
            for k, (text, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in cells
    ]
    lines.insert(1, "-" * max(len(line) for line in lines))
    return "\n".join(lines)


def _cells(row: Row) -> tuple[str, ...]:
    sign = "≤" if row.better == "lower" else "≥"
    goal = "" if row.goal is None else f"{sign} {row.goal:g}"
    verdict = {None: "", True: "yes", False: "NO"}[row.reached]
    return (
        row.name,
        f"{row.figure:.3g} {row.unit}",
        goal,
        verdict,
        row.baseline,
        f"{row.baseline_figure:.3g} {row.unit}",
        f"{row.ratio:.3g} x",
    )

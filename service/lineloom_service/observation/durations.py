"""Histograms of how long things took. They can be added up, and travel between processes."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field

from lineloom_core.codec import storable

BOUNDS: tuple[float, ...] = tuple(
    factor * 10.0**power for power in range(-4, 2) for factor in (1, 2, 5)
)
"""Upper ends of the buckets [s]; one more is without end."""


@storable("histogram")
@dataclass(slots=True)
class Histogram:
    """counts: how many fell into each bucket. total: their sum [s]."""

    counts: list[int] = field(default_factory=lambda: [0] * (len(BOUNDS) + 1))
    total: float = 0.0

    def observe(self, seconds: float) -> None:
        """Count one."""
        self.counts[bisect_left(BOUNDS, seconds)] += 1
        self.total += seconds

    def add(self, other: Histogram) -> None:
        """Count all of another."""
        self.counts = [a + b for a, b in zip(self.counts, other.counts, strict=True)]
        self.total += other.total

    def buckets(self) -> list[tuple[str, float]]:
        """Return the counts as Prometheus has them: how many took at most so long."""
        rows: list[tuple[str, float]] = []
        below = 0
        for bound, count in zip((*BOUNDS, float("inf")), self.counts, strict=True):
            below += count
            rows.append((f"{bound:g}".replace("inf", "+Inf"), float(below)))
        return rows


@storable("durations")
@dataclass(slots=True)
class Durations:
    """A histogram for every stage."""

    stages: dict[str, Histogram] = field(default_factory=dict)

    def observe(self, stage: str, seconds: float) -> None:
        """Count one run of a stage."""
        self.stages.setdefault(stage, Histogram()).observe(seconds)

    def add(self, other: Durations) -> None:
        """Count all of another."""
        for stage, histogram in other.stages.items():
            self.stages.setdefault(stage, Histogram()).add(histogram)

    def take(self) -> Durations:
        """Return what was counted so far, and begin anew."""
        taken, self.stages = Durations(self.stages), {}
        return taken

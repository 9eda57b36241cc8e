"""Which fleets the benchmark of merging runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lineloom_lab.evaluation.merge_bench_buildings import building_classes

FLEET_SIZES = (2, 3, 4, 6, 8)
_QUICK_SIZES = (2, 4)


@dataclass(frozen=True, slots=True)
class MergeCase:
    """One fleet in one building. floor_plans: folder of real plans, where there is one."""

    building: str
    robots: int
    seed: int
    duration_s: float = 75.0
    floor_plans: Path | None = None

    @property
    def name(self) -> str:
        """A name for files."""
        return f"{self.building.replace(',', '').replace(' ', '-')}-{self.robots}-{self.seed}"


def full_cases(seed: int, rounds: int, floor_plans: Path | None) -> list[MergeCase]:
    """Every class with fleets of every size, `rounds` buildings each; the large ones come first."""
    classes = building_classes(floor_plans)
    return [
        MergeCase(kind.name, robots, 1000 * seed + 10 * turn + robots, floor_plans=floor_plans)
        for robots in reversed(FLEET_SIZES)
        for turn in range(rounds)
        for kind in classes
    ]


def quick_cases(seed: int, floor_plans: Path | None) -> list[MergeCase]:
    """Every class once with a fleet of four and one of two, driving for a minute."""
    classes = building_classes(floor_plans)
    return [
        MergeCase(kind.name, robots, 1000 * seed + robots, duration_s=60.0, floor_plans=floor_plans)
        for robots in reversed(_QUICK_SIZES)
        for kind in classes
    ]

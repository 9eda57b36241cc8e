"""Which runs the benchmark of logs makes of each log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from lineloom_lab.evaluation.log_bench_clocks import CLOCK_NAMES, TRUE_CLOCK

PARTS, STRIDES = (1, 3), (1, 2, 4, 8)


@dataclass(frozen=True, slots=True)
class Setting:
    """How a log is replayed.

    parts: every recording is cut into so many robots. stride: every so-and-so-manieth scan is
    taken, so that the others never were. clock: see `log_bench_clocks`.
    """

    parts: int = 1
    stride: int = 1
    clock: str = TRUE_CLOCK
    odometry: bool = False

    @property
    def name(self) -> str:
        """In words, for tables and files."""
        robots = "one robot" if self.parts == 1 else f"cut in {self.parts}"
        wheels = ", odometry" if self.odometry else ""
        return f"{robots}, stride {self.stride}, clock {self.clock}{wheels}"


def quick_settings() -> list[Setting]:
    """As one robot and cut in three: what is looked at first."""
    return [Setting(parts) for parts in PARTS]


def full_settings() -> list[Setting]:
    """Every stride with every cut under the true clock; every other clock with all scans."""
    cut = [Setting(parts, stride) for parts in PARTS for stride in STRIDES]
    return cut + [Setting(clock=clock) for clock in CLOCK_NAMES if clock != TRUE_CLOCK]


def combined_settings(
    parts: Sequence[int], strides: Sequence[int], clocks: Sequence[str]
) -> list[Setting]:
    """Every combination; of what is left empty, the plain one. Raises ValueError for nonsense."""
    unknown = [clock for clock in clocks if clock not in CLOCK_NAMES]
    if unknown:
        raise ValueError(f"no clock is named {unknown[0]!r}; there are {', '.join(CLOCK_NAMES)}")
    if min((*parts, *strides), default=1) < 1:
        raise ValueError("parts and strides are counted from 1")
    return [
        Setting(p, s, c)
        for p in parts or (1,)
        for s in strides or (1,)
        for c in clocks or (TRUE_CLOCK,)
    ]


def with_odometry(settings: Sequence[Setting]) -> list[Setting]:
    """Return the same settings with the odometry that a log brings."""
    return [replace(setting, odometry=True) for setting in settings]

"""How an experiment is run: the seed, the size, who takes part, and where real data lies."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from lineloom_lab.experiments.contestant import Contestant, default_contestant, thesis_contestant

MatcherChoice = Literal["default", "thesis", "both"]
MATCHER_CHOICES: tuple[MatcherChoice, ...] = ("default", "thesis", "both")


@dataclass(frozen=True, slots=True)
class Settings:
    """What a run depends on; the same settings give the same answers (times aside).

    seed: of the sensor's noise and of what is sampled. quick: a reduced run, a few seconds.
    matcher: who takes part. data: folder of real data (`../shared/data`), None for none.
    Raises ValueError for a matcher that is no choice.
    """

    seed: int = 0
    quick: bool = False
    matcher: MatcherChoice = "both"
    data: Path | None = None

    def __post_init__(self) -> None:
        if self.matcher not in MATCHER_CHOICES:
            raise ValueError(f"matcher must be one of {', '.join(MATCHER_CHOICES)}")

    def contestants(
        self, *, order_extension: bool = False, reach: float = 10.0
    ) -> tuple[Contestant, ...]:
        """Return who takes part, the thesis's matcher first.

        order_extension: run it with §5.7. reach: how far the default matcher looks [m].
        """
        both = (
            thesis_contestant(order_extension=order_extension),
            default_contestant(reach=reach),
        )
        return tuple(c for c in both if self.matcher in ("both", c.key))

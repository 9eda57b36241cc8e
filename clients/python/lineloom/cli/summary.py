"""What a play has come to."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from rich.table import Table

from lineloom.cli.console import err, note, out
from lineloom.cli.player import Played
from lineloom.wire import Site


@dataclass(frozen=True)
class Summary:
    """Figures of one play. driven_s: seconds of recording, summed over the robots played."""

    site: str
    robots: int
    components: list[list[str]]
    constraints: dict[str, dict[str, int]]
    sent: int
    accepted: int
    duplicates: int
    rejected: int
    driven_s: float
    elapsed_s: float

    @staticmethod
    def of(
        site: Site, played: Played, *, robots: int, driven_s: float, elapsed_s: float
    ) -> Summary:
        """Put the figures together."""
        return Summary(
            site=site.site,
            robots=robots,
            components=[component.robots for component in site.components],
            constraints=site.constraints,
            sent=played.sent,
            accepted=played.accepted,
            duplicates=played.duplicates,
            rejected=len(played.rejected),
            driven_s=driven_s,
            elapsed_s=elapsed_s,
        )

    @property
    def scans_per_s(self) -> float:
        """New scans per second, from the first POST until the map was idle."""
        return self.accepted / self.elapsed_s if self.elapsed_s > 0.0 else 0.0

    @property
    def times_real_time(self) -> float:
        """How much faster than driving; scans that were there before do not count."""
        if self.elapsed_s <= 0.0 or self.sent == 0:
            return 0.0
        return self.driven_s * self.accepted / self.sent / self.elapsed_s

    def to_json(self) -> dict[str, Any]:
        """Return the figures for scripts."""
        rates = {
            "scans_per_s": round(self.scans_per_s, 1),
            "times_real_time": round(self.times_real_time, 1),
        }
        return asdict(self) | rates

    def show(self) -> None:
        """Print the figures for people."""
        table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
        table.add_row("site", self.site)
        table.add_row("robots played", str(self.robots))
        together = "; ".join(", ".join(robots) for robots in self.components)
        table.add_row("components", f"{len(self.components)}: {together}")
        for kind, states in sorted(self.constraints.items()):
            counts = ", ".join(f"{count} {state}" for state, count in sorted(states.items()))
            table.add_row(f"{kind} constraints", counts)
        table.add_row("scans", f"{self.accepted} new of {self.sent} sent")
        table.add_row(
            "speed", f"{self.scans_per_s:.0f} scans/s, {self.times_real_time:.0f} x real time"
        )
        out.print(table)


def complain(played: Played) -> None:
    """Say on stderr what did not go in as it should."""
    for refusal in played.rejected[:5]:
        err.print(f"refused: {refusal}", markup=False, soft_wrap=True)
    if len(played.rejected) > 5:
        note(f"… and {len(played.rejected) - 5} more refused")
    if played.duplicates:
        note(
            f"{played.duplicates} scans were on the site before (same session and seq) and were "
            "left alone; use another --site or --robot to map them anew"
        )

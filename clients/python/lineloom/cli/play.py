"""From scheduled scans to a summary: what `replay` and `simulate` have in common."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from lineloom.cli.console import print_json
from lineloom.cli.failure import CommandError
from lineloom.cli.patience import patient, require_ready
from lineloom.cli.player import Player
from lineloom.cli.schedule import Due
from lineloom.cli.summary import Summary, complain
from lineloom.cli.watch import Watch
from lineloom.client import Client
from lineloom.wire import MountSettings


@dataclass(frozen=True)
class Stage:
    """Where and how to play: the options of the command line."""

    site: str
    url: str | None
    token: str | None
    batch: int
    speed: float | None
    timeout: float

    def play(
        self,
        scans: Iterable[Due],
        *,
        total: int,
        robots: int,
        driven_s: float,
        mounts: Mapping[str, MountSettings] | None = None,
    ) -> Summary:
        """Send mounts and scans, wait until they are in the map, and sum up."""
        with Client(self.url, token=self.token, retry=patient()) as client:
            require_ready(client)
            for robot, mount in (mounts or {}).items():
                client.set_mount(self.site, robot, mount)
            begin = time.monotonic()
            with Watch(client, self.site, total) as watch:
                player = Player(
                    client, self.site, batch=self.batch, speed=self.speed, on_sent=watch.on_sent
                )
                played = player.play(scans)
                complain(played)
                if played.accepted + played.duplicates == 0:
                    raise CommandError(f"the service refused all {played.sent} scans")
                site = client.wait_until_idle(self.site, self.timeout, on_poll=watch.on_site)
        elapsed = time.monotonic() - begin
        return Summary.of(site, played, robots=robots, driven_s=driven_s, elapsed_s=elapsed)


def report(summary: Summary, *, json: bool) -> None:
    """Print the summary for scripts or for people."""
    if json:
        print_json(summary.to_json())
    else:
        summary.show()

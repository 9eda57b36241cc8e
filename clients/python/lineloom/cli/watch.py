"""Progress on the terminal: scans sent, scans in the map, components and merges."""

from __future__ import annotations

import time
from types import TracebackType

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
from typing_extensions import Self

from lineloom.cli.console import err, note
from lineloom.cli.player import Played
from lineloom.client import Client
from lineloom.errors import NotFoundError
from lineloom.wire import Site

_POLL_S = 0.5
_LINE_S = 5.0


class Watch:
    """Two bars on stderr, and a line for every merge. Asks the service twice a second at most.

    Where stderr is no terminal, as under CI, a line every few seconds stands for the bars.
    """

    def __init__(self, client: Client, site: str, total: int) -> None:
        self._client = client
        self._site = site
        self._total = total
        self._already = 0
        self._sent_count = 0
        self._asked_at = 0.0
        self._began_at = self._told_at = time.monotonic()
        self._merged: set[str] = set()
        self._progress = Progress(
            # All of it fits a terminal of 80 columns.
            TextColumn("{task.description:6}"),
            BarColumn(bar_width=8),
            MofNCompleteColumn(),
            TextColumn("{task.fields[state]}"),
            console=err,
            disable=not err.is_terminal,
        )
        self._sent = self._progress.add_task("sent", total=total, state="")
        self._mapped = self._progress.add_task("mapped", total=total, state="")

    def __enter__(self) -> Self:
        # What was there before is not this play's doing.
        try:
            before = self._client.site(self._site)
        except NotFoundError:
            pass
        else:
            self._already = before.scans.processed + before.scans.skipped
            self._merged |= before.merged_into.keys()
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._progress.stop()

    def on_sent(self, played: Played) -> None:
        """Show what was sent, and now and then what the map made of it."""
        self._sent_count = played.sent
        self._progress.update(self._sent, completed=played.sent)
        if time.monotonic() - self._asked_at < _POLL_S:
            return
        try:
            self.on_site(self._client.site(self._site))
        except NotFoundError:
            # The site comes into being with its first scan; it may have refused that one.
            self._asked_at = time.monotonic()

    def on_site(self, site: Site) -> None:
        """Show the state of the map."""
        self._asked_at = time.monotonic()
        done = max(0, site.scans.processed + site.scans.skipped - self._already)
        state = self._state(site, done)
        self._progress.update(self._mapped, completed=done, state=state)
        self._tell_merges(site, done)
        if not err.is_terminal and time.monotonic() - self._told_at >= _LINE_S:
            self._told_at = time.monotonic()
            note(f"sent {self._sent_count} of {self._total}, mapped {done}, {state}")

    def _state(self, site: Site, done: int) -> str:
        """Say how fast it goes and what has come of it, in one line."""
        rate = done / max(time.monotonic() - self._began_at, 1e-3)
        parts = len(site.components)
        loops = sum(
            states.get("accepted", 0)
            for kind, states in site.constraints.items()
            if kind != "sequential"
        )
        return (
            f"{rate:.0f} scans/s, {parts} component{'' if parts == 1 else 's'}, "
            f"{loops} constraint{'' if loops == 1 else 's'}, {site.scans.pending} pending"
        )

    def _tell_merges(self, site: Site, done: int) -> None:
        for absorbed, survivor in site.merged_into.items():
            if absorbed in self._merged:
                continue
            self._merged.add(absorbed)
            robots = next((c.robots for c in site.components if c.id == survivor), [])
            note(
                f"component {absorbed} joined {survivor}: {', '.join(robots)} (after {done} scans)"
            )

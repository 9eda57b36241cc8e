"""`lineloom watch`: a site on the terminal, live."""

from __future__ import annotations

import time
from collections import deque
from typing import Annotated

import typer
from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from lineloom.cli import options
from lineloom.cli.console import out
from lineloom.cli.failure import CommandError, Exit
from lineloom.client import Client
from lineloom.errors import AccessDeniedError, LineloomError, NotFoundError
from lineloom.retry import RetryPolicy
from lineloom.wire import Robot, Site

_RATE_OVER_S = 10.0


def watch(
    interval: Annotated[
        float, typer.Option(min=0.2, metavar="SECONDS", help="How often the service is asked.")
    ] = 1.0,
    once: Annotated[bool, typer.Option("--once", help="Print it once, and end.")] = False,
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
) -> None:
    """Show a site live: robots, scans a second, lag, components and health, until Ctrl-C.

    \b
    Example:
      lineloom watch --site floor-2
    """
    if not once and not out.is_terminal:
        raise CommandError(
            "this needs a terminal: use --once, or `lineloom events --follow`", Exit.USAGE
        )
    rates = Rates()
    with Client(url, token=token, retry=RetryPolicy(attempts=1), timeout=5.0) as client:
        if once:
            out.print(_picture(client, site, rates))
            return
        try:
            _go_on(client, site, rates, interval)
        except KeyboardInterrupt:
            return


class Rates:
    """Scans a second of each robot that the map has taken in, over the last seconds."""

    def __init__(self) -> None:
        self._seen: dict[str, deque[tuple[float, int]]] = {}

    def note(self, robot: str, processed: int, now: float) -> float | None:
        """Take a count at a time [s]; return the rate [1/s], None until there are two."""
        seen = self._seen.setdefault(robot, deque())
        seen.append((now, processed))
        while len(seen) > 2 and seen[1][0] < now - _RATE_OVER_S:
            seen.popleft()
        (first_at, first), (last_at, last) = seen[0], seen[-1]
        return (last - first) / (last_at - first_at) if last_at > first_at else None


def _go_on(client: Client, site: str, rates: Rates, interval: float) -> None:
    with Live(Text("asking …"), console=out, screen=True, auto_refresh=False) as live:
        while True:
            try:
                live.update(_picture(client, site, rates), refresh=True)
            except AccessDeniedError:
                raise
            except LineloomError as error:
                # It may come back: an operator leaves this open for days.
                live.update(Text(str(error), style="bold red"), refresh=True)
            time.sleep(interval)


def _picture(client: Client, site: str, rates: Rates) -> Group:
    try:
        state, robots = client.site(site), client.robots(site).robots
    except NotFoundError as error:
        names = ", ".join(known.site for known in client.sites().sites) or "none yet"
        raise CommandError(f"{error}. Sites: {names}") from None
    return picture(state, robots, rates, time.monotonic())


def picture(site: Site, robots: list[Robot], rates: Rates, now: float) -> Group:
    """Return what is shown of a site. now: seconds on a clock that only goes forward."""
    lag = "idle" if site.idle else f"{site.scans.pending} scans behind"
    head = f"{site.site}  version {site.version}  {site.scans.processed} scans in the map  {lag}"
    parts: list[Text | Table] = [Text(head, style="bold")]
    if site.trouble is not None:
        parts.append(Text(f"not mapped just now: {site.trouble}", style="bold red"))
    for component in site.components:
        robots_of = ", ".join(component.robots)
        parts.append(Text(f"{component.id}  {component.keyframes} keyframes  {robots_of}"))
    parts.append(_robots(robots, rates, now))
    for kind, states in sorted(site.constraints.items()):
        counts = ", ".join(f"{count} {state}" for state, count in sorted(states.items()))
        parts.append(Text(f"{kind}: {counts}", style="dim"))
    return Group(*parts)


def _robots(robots: list[Robot], rates: Rates, now: float) -> Table:
    table = Table("robot", "state", "scans/s", "lag", "heard", "component", "health", box=None)
    for robot in robots:
        rate = rates.note(robot.robot, robot.scans.processed, now)
        well = robot.state in ("tracking", "starting") and not robot.health
        table.add_row(
            robot.robot,
            robot.state,
            "" if rate is None else f"{rate:.1f}",
            str(robot.scans.pending),
            "" if robot.silent_for_s is None else f"{robot.silent_for_s:.0f} s ago",
            robot.component or "",
            "; ".join(robot.health) or "well",
            style=None if well else "red",
        )
    return table

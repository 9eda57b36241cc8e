"""`lineloom status`: how the service and its sites are doing."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.table import Table

from lineloom.cli import options
from lineloom.cli.complete import site_names
from lineloom.cli.console import out, print_json
from lineloom.cli.patience import quick
from lineloom.cli.robot_table import robot_table
from lineloom.client import Client
from lineloom.wire import Robot, Site


def status(
    site: Annotated[
        str | None,
        typer.Option(
            envvar="LINELOOM_SITE",
            metavar="NAME",
            help="Show this site's robots; else all sites.",
            autocompletion=site_names,
        ),
    ] = None,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Show the sites, or one site's components and robots.

    \b
    Example:
      lineloom status --site floor-2
    """
    with Client(url, token=token, retry=quick()) as client:
        if site is None:
            sites = client.sites().sites
            if json:
                print_json([entry.model_dump(mode="json") for entry in sites])
            else:
                _show_sites(client.session.url, sites)
            return
        state = client.site(site)
        robots = client.robots(site).robots
    if json:
        listed = [robot.model_dump(mode="json") for robot in robots]
        print_json(state.model_dump(mode="json") | {"robots": listed})
    else:
        _show_site(state, robots)


def _show_sites(url: str, sites: list[Site]) -> None:
    if not sites:
        out.print(f"{url} has no sites yet: send scans, e.g. with `lineloom replay`", markup=False)
        return
    table = Table("site", "robots", "components", "scans", "pending", "version", box=None)
    for site in sites:
        table.add_row(
            site.site,
            str(len(site.robots)),
            str(len(site.components)),
            str(site.scans.accepted),
            "idle" if site.idle else str(site.scans.pending),
            str(site.version),
        )
    out.print(table)


def _show_site(site: Site, robots: list[Robot]) -> None:
    pending = "idle" if site.idle else f"{site.scans.pending} pending"
    out.print(
        f"{site.site}: version {site.version}, {site.scans.accepted} scans, {pending}",
        markup=False,
    )
    if site.trouble is not None:
        out.print(f"not mapped just now: {site.trouble}", markup=False)
    if (made := site.remaking) is not None:
        text = f"made anew, beside this map, at entry {made.position} of {made.of}: {made.why}"
        out.print(text, markup=False)
    for kind, states in sorted(site.constraints.items()):
        counts = ", ".join(f"{count} {state}" for state, count in sorted(states.items()))
        out.print(f"{kind} constraints: {counts}", markup=False)
    out.print(robot_table(robots))

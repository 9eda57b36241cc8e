"""`lineloom delete`: a site or a robot, for good."""

from __future__ import annotations

from typing import Annotated

import typer

from lineloom.cli import options
from lineloom.cli.complete import robot_names, site_names
from lineloom.cli.console import note
from lineloom.cli.patience import quick
from lineloom.client import Client


def delete(
    # No default and no variable: what is destroyed is named on the command line.
    site: Annotated[
        str, typer.Argument(metavar="SITE", help="Which site.", autocompletion=site_names)
    ],
    robot: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Only this robot of the site; else all of it.",
            autocompletion=robot_names,
        ),
    ] = None,
    yes: options.Yes = False,
    url: options.Url = None,
    token: options.Token = None,
) -> None:
    """Forget a site with its map and scans, or one robot and what it alone has seen.

    There is no way back. Asks first, unless --yes.

    \b
    Example:
      lineloom delete floor-2 --robot r1
    """
    what = f"site {site}" if robot is None else f"robot {robot} of site {site}"
    with Client(url, token=token, retry=quick()) as client:
        if robot is None:
            known = client.site(site)
            told = f"{len(known.robots)} robots, {known.scans.accepted} scans"
        else:
            told = f"{client.robot(site, robot).scans.accepted} scans"
        if not yes:
            typer.confirm(f"Delete {what} ({told}) for good?", abort=True, err=True)
        if robot is None:
            client.delete_site(site)
        else:
            client.delete_robot(site, robot)
    note(f"{what} is deleted: {told}")

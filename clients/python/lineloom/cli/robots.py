"""`lineloom robots`, `mount` and `transform`: the robots of a site."""

from __future__ import annotations

import math
from typing import Annotated

import typer

from lineloom.cli import options
from lineloom.cli.complete import robot_names
from lineloom.cli.console import out, print_json
from lineloom.cli.patience import quick
from lineloom.cli.robot_table import robot_table
from lineloom.client import Client
from lineloom.wire import MountSettings


def robots(
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Show the robots of a site: where they are, and what is wrong with them.

    \b
    Example:
      lineloom robots --site floor-2
    """
    with Client(url, token=token, retry=quick()) as client:
        found = client.robots(site).robots
    if json:
        print_json([robot.model_dump(mode="json") for robot in found])
    else:
        out.print(robot_table(found))


def mount(
    robot: options.Robot,
    x: Annotated[float, typer.Option(metavar="METRES", help="Ahead of the base.")] = 0.0,
    y: Annotated[float, typer.Option(metavar="METRES", help="Left of the base.")] = 0.0,
    theta: Annotated[
        float, typer.Option(metavar="RADIANS", help="Turned counter-clockwise.")
    ] = 0.0,
    inverted: Annotated[bool, typer.Option("--inverted", help="Mounted upside down.")] = False,
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Say how the lidar sits on a robot; holds for the scans that follow.

    \b
    Example:
      lineloom mount r1 --x 0.12 --theta 3.1416 --inverted --site floor-2
    """
    settings = MountSettings(x=x, y=y, theta=theta, inverted=inverted)
    with Client(url, token=token, retry=quick()) as client:
        found = client.set_mount(site, robot, settings)
    if json:
        print_json(found.model_dump(mode="json"))
        return
    upside = ", upside down" if inverted else ""
    out.print(f"{robot}: lidar at x {x:g} m, y {y:g} m, theta {theta:g} rad{upside}", markup=False)


def transform(
    robot_a: Annotated[
        str,
        typer.Argument(metavar="A", help="The robot to look from.", autocompletion=robot_names),
    ],
    robot_b: Annotated[
        str,
        typer.Argument(metavar="B", help="The robot that is sought.", autocompletion=robot_names),
    ],
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Say where robot B is, seen from robot A. Exit code 4 while they are not in one map.

    \b
    Example:
      lineloom transform r1 r2 --site floor-2
    """
    with Client(url, token=token, retry=quick()) as client:
        found = client.transform(site, robot_a, robot_b)
    if json:
        print_json(found.model_dump(mode="json"))
        return
    T = found.T_a_b
    turned = math.degrees(T.theta)
    out.print(
        f"{robot_b} in {robot_a}: x {T.x:.3f} m, y {T.y:.3f} m, theta {turned:.2f} deg",
        markup=False,
    )
    out.print(f"held together by {len(found.constraints)} constraints")

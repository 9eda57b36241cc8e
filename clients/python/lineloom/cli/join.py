"""`lineloom join`: somebody who stands there says that two places are the same."""

from __future__ import annotations

import math
from typing import Annotated, Any

import typer

from lineloom.cli import options
from lineloom.cli.complete import robot_names
from lineloom.cli.console import out, print_json
from lineloom.cli.failure import CommandError, Exit
from lineloom.cli.patience import quick
from lineloom.client import Client
from lineloom.wire import JoinRequest, JoinTrial, PoseRequest

_SCAN = "NAME, NAME:SEQ, or place:ID; a robot's latest scan where no SEQ is said."


def join(
    a: Annotated[
        str, typer.Argument(metavar="A", help=f"One: {_SCAN}", autocompletion=robot_names)
    ],
    b: Annotated[
        str, typer.Argument(metavar="B", help=f"The other: {_SCAN}", autocompletion=robot_names)
    ],
    pose: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,THETA",
            help="Lidar B seen from lidar A, roughly [m, m, rad]; else the matcher looks for it.",
        ),
    ] = None,
    what_if: Annotated[
        bool, typer.Option("--what-if", help="Say what it would come to, and do nothing.")
    ] = False,
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Say that two robots' scans, or two places, are near each other: joins their maps.

    The matcher measures how they lie. `lineloom constraints retract` undoes it.

    \b
    Example:
      lineloom join r1 r2:120 --what-if --site floor-2
    """
    fields = _named(a, "a") | _named(b, "b")
    request = JoinRequest(**fields, T_a_b=None if pose is None else _pose(pose))
    with Client(url, token=token, retry=quick()) as client:
        if what_if:
            trial = client.try_join(site, request)
            if json:
                print_json(trial.model_dump(mode="json"))
            else:
                _foretell(trial)
            return
        made = client.join(site, request)
    if json:
        print_json(made.model_dump(mode="json"))
    else:
        out.print(f"{made.id}: {made.state}: {made.reason}", markup=False, soft_wrap=True)


def _named(text: str, side: str) -> dict[str, Any]:
    name, colon, seq = text.partition(":")
    if name == "place" and seq:
        return {f"place_{side}": seq}
    if not colon:
        return {f"robot_{side}": name}
    if not seq.isdecimal():
        raise CommandError(f"{text}: SEQ is a whole number, as in r1:120", Exit.USAGE)
    return {f"robot_{side}": name, f"seq_{side}": int(seq)}


def _pose(text: str) -> PoseRequest:
    try:
        x, y, theta = (float(part) for part in text.split(","))
    except ValueError:
        raise CommandError(f"--pose {text}: give three numbers, X,Y,THETA", Exit.USAGE) from None
    return PoseRequest(x=x, y=y, theta=theta)


def _foretell(trial: JoinTrial) -> None:
    out.print(trial.reason, markup=False, soft_wrap=True)
    T = trial.T_a_b
    turned = math.degrees(T.theta)
    out.print(f"b in a: x {T.x:.3f} m, y {T.y:.3f} m, theta {turned:.2f} deg")
    for objection in trial.objections:
        out.print(f"against it: {objection}", markup=False, soft_wrap=True)

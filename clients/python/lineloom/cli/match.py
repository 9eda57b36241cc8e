"""`lineloom match`: how two scans lie to each other."""

from __future__ import annotations

import math
from typing import Annotated

import typer

from lineloom.cli import options
from lineloom.cli.console import out, print_json
from lineloom.cli.failure import Exit
from lineloom.cli.local_match import match_locally
from lineloom.cli.patience import quick
from lineloom.cli.scan_files import read_one
from lineloom.client import Client
from lineloom.wire import MatchAnswer


def match(
    reference: Annotated[
        str, typer.Argument(metavar="A", help="The scan to look from: FILE or FILE:LINE.")
    ],
    current: Annotated[
        str, typer.Argument(metavar="B", help="The scan whose place is asked: FILE or FILE:LINE.")
    ],
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Find the pose of scan B in the frame of scan A, without a guess.

    Files are JSON (one scan), JSON lines or CARMEN logs; FILE:12 takes the scan on line 12. Asks
    the service named by --url or LINELOOM_URL; without one, matches on this machine where the
    core is installed.

    \b
    Example:
      lineloom match rooms.jsonl:1 rooms.jsonl:40
    """
    pair = read_one(reference).scan, read_one(current).scan
    answer = None if url else match_locally(*pair)
    if answer is None:
        with Client(url, token=token, retry=quick()) as client:
            answer = client.match(*pair)
    if json:
        print_json(answer.model_dump(mode="json"))
    else:
        _show(answer)
    if answer.verdict not in ("match", "weak"):
        raise typer.Exit(int(Exit.NEGATIVE))


def _show(answer: MatchAnswer) -> None:
    out.print(f"{answer.verdict} (score {answer.score:.2f}): {answer.reason}", markup=False)
    pose = answer.T_reference_current
    if pose is not None:
        out.print(
            f"B in A: x {pose.x:.3f} m, y {pose.y:.3f} m, theta {math.degrees(pose.theta):.2f} deg"
        )
    if answer.weak_direction is not None:
        out.print(f"unknown along {math.degrees(answer.weak_direction):.1f} deg in A's frame")
    for other in answer.alternatives:
        out.print(
            f"or: x {other.x:.3f} m, y {other.y:.3f} m, "
            f"theta {math.degrees(other.theta):.2f} deg (score {other.score:.2f})"
        )

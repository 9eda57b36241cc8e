"""`lineloom trajectory`: where a robot has been."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from lineloom.cli import options
from lineloom.cli.deliver import deliver
from lineloom.cli.map import Align, Frame, FrameOption
from lineloom.cli.patience import quick
from lineloom.cli.word import Word
from lineloom.client import Client


class Format(Word):
    """What the service writes."""

    JSON = "json"
    TUM = "tum"
    CSV = "csv"


def trajectory(
    robot: options.Robot,
    format: Annotated[
        Format, typer.Option("--format", "-f", help="What kind of file to make.")
    ] = Format.TUM,
    output: options.Output = None,
    site: options.Site = options.DEFAULT_SITE,
    align: Align = False,
    frame: FrameOption = Frame.MAP,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Fetch the pose of every scan of a robot, as the map has them now.

    tum is what evo and others read. --json is --format json.

    \b
    Example:
      lineloom trajectory r1 --site floor-2 --format tum --output r1.tum
    """
    with Client(url, token=token, retry=quick()) as client:
        if json or format is Format.JSON:
            found = client.trajectory(site, robot, align=align, frame=frame.value)
            text = found.model_dump_json()
        else:
            kind: Literal["tum", "csv"] = "tum" if format is Format.TUM else "csv"
            text = client.trajectory_text(site, robot, kind, align=align, frame=frame.value)
    deliver(text.encode(), output)

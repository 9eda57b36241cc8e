"""`lineloom floorplan`: the building's plan, and the map's place in it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from lineloom.cli import options
from lineloom.cli.console import out, print_json
from lineloom.cli.deliver import deliver, refuse_terminal
from lineloom.cli.failure import CommandError, Exit
from lineloom.cli.patience import quick
from lineloom.cli.word import Word
from lineloom.client import Client
from lineloom.wire import FloorPlanAnswer

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)

MEDIA_TYPES = {
    ".geojson": "application/geo+json",
    ".json": "application/geo+json",
    ".dxf": "image/vnd.dxf",
    ".txt": "text/plain",
    ".csv": "text/plain",
}


class Format(Word):
    """What the service writes."""

    JSON = "json"
    SVG = "svg"
    PNG = "png"


@app.callback()
def floorplan() -> None:
    """Find the map's place in a floor plan, and what differs between the two.

    \b
    Example:
      lineloom floorplan put building.dxf --site floor-2
      lineloom map --site floor-2 --frame plan --format dxf --output placed.dxf
    """


@app.command("put")
def put(
    plan: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="GeoJSON (.geojson), DXF (.dxf), or x1, y1, x2, y2 a line (.txt)."
        ),
    ],
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Send a floor plan, and say where in it the map lies. Exit code 4 where it has no place.

    \b
    Example:
      lineloom floorplan put building.dxf --site floor-2
    """
    media_type = MEDIA_TYPES.get(plan.suffix.lower())
    if media_type is None:
        known = ", ".join(MEDIA_TYPES)
        raise CommandError(f"{plan}: a floor plan ends in one of {known}", Exit.USAGE)
    content = plan.read_bytes()
    with Client(url, token=token, retry=quick(), timeout=120.0) as client:
        _report(client.put_floorplan(site, content, media_type), json=json)


@app.command("show")
def show(
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Say where in the floor plan the map lies. Exit code 4 where it has no place.

    \b
    Example:
      lineloom floorplan show --site floor-2 --json
    """
    with Client(url, token=token, retry=quick(), timeout=120.0) as client:
        _report(client.floorplan(site), json=json)


@app.command("differences")
def differences(
    format: Annotated[
        Format, typer.Option("--format", "-f", help="What kind of file to make.")
    ] = Format.SVG,
    output: options.Output = None,
    component: Annotated[
        str | None, typer.Option(metavar="ID", help="Which component; the one with a place.")
    ] = None,
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Fetch walls of the plan that are missing and walls that it does not have.

    --json is --format json.

    \b
    Example:
      lineloom floorplan differences --format png --output differences.png
    """
    chosen = Format.JSON if json else format
    refuse_terminal(output, binary=chosen is Format.PNG, example="differences.png")
    with Client(url, token=token, retry=quick(), timeout=120.0) as client:
        if chosen is Format.JSON:
            content = client.floorplan_differences(site, component).model_dump_json().encode()
        elif chosen is Format.SVG:
            content = client.floorplan_drawing(site, "svg", component)
        else:
            content = client.floorplan_drawing(site, "png", component)
    deliver(content, output)


@app.command("delete")
def delete(
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
) -> None:
    """Forget the floor plan.

    \b
    Example:
      lineloom floorplan delete --site floor-2
    """
    with Client(url, token=token, retry=quick()) as client:
        client.delete_floorplan(site)


def _report(answer: FloorPlanAnswer, *, json: bool) -> None:
    if json:
        print_json(answer.model_dump(mode="json"))
    else:
        out.print(f"floor plan: {answer.lines} lines, {answer.extent:.1f} m", markup=False)
        for place in answer.components:
            out.print(f"{place.component}: {place.verdict}: {place.reason}", markup=False)
            pose = place.T_plan_map
            if pose is not None:
                turn = math.degrees(pose.theta)
                out.print(f"  at x {pose.x:.3f} m, y {pose.y:.3f} m, turned by {turn:.2f} deg")
    if not any(place.verdict == "registered" for place in answer.components):
        raise typer.Exit(int(Exit.NEGATIVE))

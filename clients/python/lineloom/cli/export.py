"""`lineloom export`: files of a map that never change."""

from __future__ import annotations

import hashlib
from datetime import datetime, timezone
from typing import Annotated

import typer
from rich.table import Table

from lineloom.calls import MapOptions
from lineloom.cli import options
from lineloom.cli.console import out, print_json
from lineloom.cli.deliver import deliver, refuse_terminal
from lineloom.cli.failure import CommandError
from lineloom.cli.map import (
    Align,
    BBox,
    Component,
    Format,
    FormatOption,
    Frame,
    FrameOption,
    Resolution,
    read_box,
)
from lineloom.cli.patience import quick
from lineloom.client import Client
from lineloom.wire import MAP_FORMATS, Export

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)

_NAV2 = Format("nav2")

Id = Annotated[str, typer.Argument(metavar="ID", help="Which export, as the list has it.")]


@app.callback()
def export() -> None:
    """Keep maps as files that never change, each at an address of its own with its hash.

    What VDA 5050's action downloadMap needs is told with each.

    \b
    Example:
      lineloom export create --format nav2 --component c0
      lineloom export list --json
    """


@app.command("create")
def create(
    format: FormatOption = _NAV2,
    site: options.Site = options.DEFAULT_SITE,
    component: Component = None,
    bbox: BBox = None,
    align: Align = False,
    frame: FrameOption = Frame.MAP,
    resolution: Resolution = None,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Write the map as it is now into a file that stays.

    \b
    Example:
      lineloom export create --site floor-2 --format dxf --align
    """
    wanted = MapOptions(component, read_box(bbox), align, frame.value, resolution)
    with Client(url, token=token, retry=quick()) as client:
        made = client.export(site, format.value, wanted)
    if json:
        print_json(made.model_dump(mode="json"))
        return
    for name, value in (
        ("id", made.id),
        ("link", made.url),
        ("sha256", made.sha256),
        ("mapId", made.map.mapId),
        ("mapVersion", made.map.mapVersion),
    ):
        out.print(f"{name:11}{value}", markup=False, soft_wrap=True)


@app.command("list")
def list_(
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Show the exports of a site, oldest first.

    \b
    Example:
      lineloom export list --site floor-2
    """
    with Client(url, token=token, retry=quick()) as client:
        exports = client.exports(site).exports
    if json:
        print_json([entry.model_dump(mode="json") for entry in exports])
    elif not exports:
        out.print(f"{site} has no exports: make one with `lineloom export create`", markup=False)
    else:
        out.print(_table(exports))


@app.command("get")
def get(
    export_id: Id,
    output: options.Output = None,
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
) -> None:
    """Fetch an export, and check its hash.

    \b
    Example:
      lineloom export get nav2-900-c59a3a51e023f0ef --output map.zip
    """
    with Client(url, token=token, retry=quick()) as client:
        known = {entry.id: entry for entry in client.exports(site).exports}
        if export_id not in known:
            raise CommandError(f"{site} has no export {export_id}: see `lineloom export list`")
        kind = MAP_FORMATS[known[export_id].format]
        refuse_terminal(output, binary=kind.binary, example=f"map.{kind.suffix}")
        content = client.export_file(site, export_id)
    if hashlib.sha256(content).hexdigest() != known[export_id].sha256:
        raise CommandError(f"{export_id}: the bytes that came are not those of its hash; try again")
    deliver(content, output)


@app.command("delete")
def delete(
    export_id: Id,
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
) -> None:
    """Remove an export that nobody uses any more.

    \b
    Example:
      lineloom export delete nav2-900-c59a3a51e023f0ef
    """
    with Client(url, token=token, retry=quick()) as client:
        client.delete_export(site, export_id)


def _table(exports: list[Export]) -> Table:
    table = Table("id", "component", "version", "bytes", "created", box=None)
    for entry in exports:
        created = datetime.fromtimestamp(entry.created, timezone.utc).strftime("%Y-%m-%d %H:%M:%SZ")
        table.add_row(
            entry.id, entry.component or "all", str(entry.version), str(entry.size), created
        )
    return table

"""The program `lineloom`: gathers the commands and turns errors into one line."""

from __future__ import annotations

import importlib.metadata
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from lineloom.cli import (
    bench,
    bridge,
    config,
    constraints,
    dashboard,
    db,
    delete,
    demo,
    doctor,
    events,
    experiment,
    export,
    floorplan,
    graph,
    join,
    localize,
    match,
    replay,
    robots,
    serve,
    simulate,
    status,
    token,
    trajectory,
)
from lineloom.cli import map as map_command
from lineloom.cli.console import note
from lineloom.cli.failure import EXIT_CODES, explained


class Commands(TyperGroup):
    """Runs a command; what went wrong is said in one line, without a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Run, and exit with the code that fits the error."""
        try:
            return super().invoke(ctx)
        except Exception as error:
            told = explained(error)
            if told is None:
                # Typer's own (usage, exit), or a bug of ours, whose traceback is wanted.
                raise
            note(f"lineloom: {told}")
            raise typer.Exit(int(told.code)) from None


app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"lineloom {importlib.metadata.version('lineloom-client')}")
        raise typer.Exit


_ABOUT = f"""Many robots, one line map: send laser scans, ask for the map.

\b
First steps:
  lineloom demo
  lineloom serve
  lineloom replay run.clf --split 3
  lineloom map --format svg --output map.svg

\b
{EXIT_CODES}
"""


@app.callback(help=_ABOUT)
def about(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Say the version."),
    ] = False,
) -> None:
    """Take the options before the command."""


app.command("serve")(serve.serve)
app.command("demo")(demo.demo)
app.command("replay")(replay.replay)
app.command("simulate")(simulate.simulate)
app.command("map")(map_command.map_)
app.command("trajectory")(trajectory.trajectory)
app.command("graph")(graph.graph)
app.command("match")(match.match)
app.command("bridge")(bridge.bridge)
app.command("localize")(localize.localize)
app.command("status")(status.status)
app.command("watch")(dashboard.watch)
app.command("events")(events.events)
app.command("robots")(robots.robots)
app.command("mount")(robots.mount)
app.command("transform")(robots.transform)
app.command("join")(join.join)
app.command("delete")(delete.delete)
app.command("doctor")(doctor.doctor)
app.command("experiment")(experiment.experiment)
app.add_typer(bench.app, name="bench")
app.add_typer(config.app, name="config")
app.add_typer(constraints.app, name="constraints")
app.add_typer(db.app, name="db")
app.add_typer(export.app, name="export")
app.add_typer(floorplan.app, name="floorplan")
app.add_typer(token.app, name="token")


def main() -> None:
    """Run the program."""
    app(prog_name="lineloom")

"""`lineloom replay`: recorded logs, played as robots."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Annotated

import typer

from lineloom.cli import options
from lineloom.cli.console import note
from lineloom.cli.failure import CommandError, Exit
from lineloom.cli.play import Stage, report
from lineloom.cli.scan_files import read_scans
from lineloom.cli.schedule import Stream, robot_name, split, together
from lineloom.scan_like import to_wire
from lineloom.wire import Scan


def replay(
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="LOG…", help="CARMEN logs (.log, .clf) and JSON lines (.jsonl)."),
    ],
    split_into: Annotated[
        int,
        typer.Option(
            "--split", min=1, max=100, metavar="N", help="Play each log as N robots, cut by time."
        ),
    ] = 1,
    site: options.Site = options.DEFAULT_SITE,
    robot: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Name of the robot; else the log's own, or its file's."),
    ] = None,
    no_odometry: Annotated[
        bool, typer.Option("--no-odometry", help="Leave out odometry: scans alone.")
    ] = False,
    speed: options.Speed = None,
    batch: options.Batch = 50,
    timeout: options.Timeout = options.DEFAULT_TIMEOUT,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Play recorded logs to the service, wait until they are in the map, and sum up.

    Several logs, and the parts of a split one, play at the same time, as robots that set out
    together; their stamps stay as recorded. Playing a log again changes nothing: the service
    knows its scans.

    \b
    Example:
      lineloom replay mit-csail.clf --split 3 --no-odometry --site csail
    """
    streams = load(logs, split_into=split_into, robot=robot, odometry=not no_odometry)
    stage = Stage(site, url, token, batch, speed, timeout)
    summary = stage.play(
        together(streams),
        total=sum(len(stream.scans) for stream in streams),
        robots=len(streams),
        driven_s=sum(stream.duration for stream in streams),
    )
    report(summary, json=json)
    if not json:
        note(f"See it: lineloom map --site {site} --format svg --output map.svg")


def load(
    logs: list[Path], *, split_into: int = 1, robot: str | None = None, odometry: bool = True
) -> list[Stream]:
    """Read logs into one stream per robot, or end the command with what is wrong."""
    streams: list[Stream] = []
    for index, path in enumerate(logs):
        own = robot if robot is None or len(logs) == 1 else f"{robot}-{index + 1}"
        for stream in _streams(path, own, odometry=odometry):
            streams += split(stream, split_into)
    names = [stream.robot for stream in streams]
    doubled = sorted({name for name in names if names.count(name) > 1})
    if doubled:
        raise CommandError(
            f"two logs are named {doubled[0]}: name the robots with --robot", Exit.USAGE
        )
    return streams


def _streams(path: Path, robot: str | None, *, odometry: bool) -> list[Stream]:
    scans: dict[str, list[Scan]] = {}
    session = _session(path)
    own = robot or robot_name(path.stem)
    several = False
    for found in read_scans(path):
        scan = to_wire(found.scan)
        if scan.session == "0":
            scan = to_wire(scan, session=session)
        if not odometry:
            scan = scan.model_copy(update={"odometry": None})
        several = several or found.robot is not None
        scans.setdefault(found.robot or own, []).append(scan)
    if not scans:
        raise CommandError(f"{path} holds no scans: is it a CARMEN log or JSON lines?")
    if robot is not None and several:
        # The log's own names would be lost: they become endings.
        return [Stream(f"{robot}-{name}", list(part)) for name, part in scans.items()]
    return [Stream(name, part) for name, part in scans.items()]


def _session(path: Path) -> str:
    """Return a session that is the log's own: again the same, and never another log's."""
    with path.open("rb") as content:
        return f"log-{hashlib.file_digest(content, 'blake2b').hexdigest()[:12]}"

"""`lineloom replay`: recorded logs, played as robots."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lineloom.cli import options
from lineloom.cli.console import note
from lineloom.cli.play import Stage, report
from lineloom.cli.recordings import BagChoice, load
from lineloom.cli.schedule import together

Logs = Annotated[
    list[Path],
    typer.Argument(
        metavar="LOG…",
        help="CARMEN logs (.log, .clf, also .gz), ROS bags (.bag, .mcap, .db3 or a folder), "
        "tinySLAM (.dat) and DP-SLAM logs, JSON lines (.jsonl), numpy (.npz) and what "
        "`rostopic echo -p` wrote (.csv).",
    ),
]
SplitInto = Annotated[
    int,
    typer.Option(
        "--split", min=1, max=100, metavar="N", help="Play each log as N robots, cut by time."
    ),
]
Robot = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Name of the robot; else the log's own, or its file's."),
]
NoOdometry = Annotated[bool, typer.Option("--no-odometry", help="Leave out odometry: scans alone.")]
Topic = Annotated[
    list[str] | None,
    typer.Option(
        metavar="TOPIC",
        help="Laser topic of a bag, once per robot; all laser topics if left out.",
    ),
]
BaseFrame = Annotated[
    str | None,
    typer.Option(
        metavar="FRAME", help="The robot's frame in a bag's transforms; else base_link, if any."
    ),
]
OdomFrame = Annotated[
    str, typer.Option(metavar="FRAME", help="The odometry's frame in a bag's transforms.")
]
OdomTopic = Annotated[
    str | None,
    typer.Option(metavar="TOPIC", help="Odometry of a bag; else that of the scans' own namespace."),
]


def replay(
    logs: Logs,
    split_into: SplitInto = 1,
    site: options.Site = options.DEFAULT_SITE,
    robot: Robot = None,
    no_odometry: NoOdometry = False,
    topic: Topic = None,
    base_frame: BaseFrame = None,
    odom_frame: OdomFrame = "odom",
    odom_topic: OdomTopic = None,
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
      lineloom replay fleet.mcap --topic /r1/scan --topic /r2/scan
    """
    bags = BagChoice(tuple(topic or ()), base_frame, odom_frame, odom_topic)
    streams = load(logs, split_into=split_into, robot=robot, odometry=not no_odometry, bags=bags)
    stage = Stage(site, url, token, batch, speed, timeout)
    summary = stage.play(
        together(streams),
        total=sum(len(stream.scans) for stream in streams),
        robots=len(streams),
        driven_s=sum(stream.duration for stream in streams),
        mounts={s.robot: s.mount for s in streams if s.mount is not None},
    )
    report(summary, json=json)
    if not json:
        note(f"See it: lineloom map --site {site} --format svg --output map.svg")

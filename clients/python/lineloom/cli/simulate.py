"""`lineloom simulate`: robots in a made-up world, to a service or to a file."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lineloom.cli import options
from lineloom.cli.console import note
from lineloom.cli.failure import CommandError, Exit
from lineloom.cli.play import Stage, report
from lineloom.cli.schedule import Due
from lineloom.cli.word import Word
from lineloom.scan_like import to_wire

if TYPE_CHECKING:
    from lineloom_lab.simulation import Fleet, Lidar


class LidarName(Word):
    """The lidars at hand."""

    SICK = "sick-lms200"
    FULL = "scanner-360"


WorldName = Annotated[
    str,
    typer.Option(
        metavar="WORLD",
        help="corridors, long-corridor, office, rectangle, rooms, or a floor plan's file.",
    ),
]
WorldSeed = Annotated[
    int, typer.Option(min=0, metavar="N", help="Which of the made-up worlds of that kind.")
]
LidarChoice = Annotated[LidarName, typer.Option(help="What the robots see with.")]
Robots = Annotated[int, typer.Option(min=1, max=100, metavar="N", help="How many robots.")]
Seed = Annotated[int, typer.Option(min=0, metavar="N", help="Seed of starts, ways and noise.")]
Duration = Annotated[
    float, typer.Option(min=1.0, metavar="SECONDS", help="How long each robot drives.")
]
Odometry = Annotated[
    bool, typer.Option("--odometry", help="Give the robots wheel odometry, which drifts.")
]
People = Annotated[
    int, typer.Option(min=0, max=100, metavar="N", help="How many people walk about.")
]
Output = Annotated[
    Path | None,
    typer.Option(
        "--output", "-o", metavar="FILE", help="Write JSON lines with true poses; send nothing."
    ),
]


def simulate(
    world: WorldName = "office",
    world_seed: WorldSeed = 0,
    lidar: LidarChoice = LidarName.FULL,
    robots: Robots = 3,
    seed: Seed = 0,
    duration: Duration = 240.0,
    odometry: Odometry = False,
    people: People = 0,
    output: Output = None,
    site: options.Site = options.DEFAULT_SITE,
    speed: options.Speed = None,
    batch: options.Batch = 50,
    timeout: options.Timeout = options.DEFAULT_TIMEOUT,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Drive simulated robots through a world and send their scans, or write them to a file.

    The same options give the same scans. The robots' starts and clocks are unknown to the
    service; a file holds the true poses, too.

    \b
    Example:
      lineloom simulate --world rooms --robots 2 --duration 60 --output rooms.jsonl
      lineloom replay rooms.jsonl --site rooms
    """
    fleet = build_fleet(
        world,
        world_seed=world_seed,
        lidar=lidar,
        robots=robots,
        seed=seed,
        duration_s=duration,
        odometry=odometry,
        people=people,
    )
    if output is not None:
        _write(fleet, output)
        return
    session = f"sim-{world_seed}-{seed}-{int(time.time())}"
    stage = Stage(site, url, token, batch, speed, timeout)
    summary = stage.play(
        due(fleet, session), total=scan_count(fleet), robots=robots, driven_s=robots * duration
    )
    report(summary, json=json)


def build_fleet(
    world: str,
    *,
    world_seed: int,
    lidar: LidarName,
    robots: int,
    seed: int,
    duration_s: float,
    odometry: bool = False,
    people: int = 0,
) -> Fleet:
    """Make the fleet, or end the command with what is wrong."""
    try:
        from lineloom_lab.simulation import (
            DriftingOdometry,
            Fleet,
            World,
            world_named,
            world_names,
        )
    except ImportError:
        raise CommandError(
            "the simulator is part of the core: `pip install lineloom-client[server]`"
        ) from None
    built_in = world in world_names() or not Path(world).exists()
    try:
        floor = world_named(world, world_seed) if built_in else World.from_text(world)
        return Fleet.touring(
            floor,
            robots=robots,
            seed=seed,
            duration_s=duration_s,
            lidar=_lidar(lidar),
            odometry=DriftingOdometry() if odometry else None,
            people=people,
        )
    except ValueError as error:
        raise CommandError(str(error), Exit.USAGE) from None


def scan_count(fleet: Fleet) -> int:
    """Return how many scans the fleet will make."""
    return sum(len(robot.scan_times_s) for robot in fleet.robots)


def due(fleet: Fleet, session: str) -> Iterator[Due]:
    """Yield the fleet's scans as a player takes them."""
    for simulated in fleet.scans():
        scan = to_wire(simulated.scan, session=session)
        yield Due(simulated.time_s, simulated.robot, scan)


def _lidar(name: LidarName) -> Lidar:
    from lineloom_lab.simulation import scanner_360, sick_lms200

    return sick_lms200() if name is LidarName.SICK else scanner_360()


def _write(fleet: Fleet, output: Path) -> None:
    from lineloom_core.io.jsonl import ScanRecord, write_jsonl

    output.parent.mkdir(parents=True, exist_ok=True)
    records = (
        ScanRecord(simulated.scan, simulated.robot, simulated.true_pose)
        for simulated in fleet.scans()
    )
    count = write_jsonl(output, records)
    note(f"{output}: {count} scans of {len(fleet.robots)} robots")

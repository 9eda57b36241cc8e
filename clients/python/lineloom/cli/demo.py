"""`lineloom demo`: the whole of Lineloom in one command."""

from __future__ import annotations

import shutil
import signal
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from lineloom.cli import options
from lineloom.cli.child_service import ChildService
from lineloom.cli.console import note, out, print_json, waiting
from lineloom.cli.failure import Exit
from lineloom.cli.patience import patient
from lineloom.cli.player import Played, Player
from lineloom.cli.schedule import Due
from lineloom.cli.simulate import LidarChoice, LidarName, build_fleet, scan_count
from lineloom.cli.truth import PairError, Truth, common_component, not_merged, table
from lineloom.cli.watch import Watch
from lineloom.client import Client
from lineloom.scan_like import to_wire

if TYPE_CHECKING:
    from lineloom_lab.simulation import Fleet

SITE = "demo"
_FIRST_START_S = 900.0
"""A stranger's machine may be slow and busy: what counts is that the service still lives."""


def demo(
    robots: Annotated[
        int, typer.Option(min=2, max=20, metavar="N", help="How many robots drive.")
    ] = 3,
    duration: Annotated[
        float, typer.Option(min=10.0, metavar="SECONDS", help="How long each robot drives.")
    ] = 240.0,
    seed: Annotated[
        int, typer.Option(min=0, metavar="N", help="Another floor, other ways: another seed.")
    ] = 0,
    lidar: LidarChoice = LidarName.FULL,
    out_dir: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Where map.svg and map.png go.")
    ] = Path("out"),
    data_dir: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Keep the service's data here; else nothing is kept."),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(
            min=1, max=65535, metavar="PORT", help="Port of the service; else a free one."
        ),
    ] = None,
    stay: Annotated[
        bool, typer.Option("--stay", help="Leave the service up at the end, until Ctrl-C.")
    ] = False,
    timeout: options.Timeout = options.DEFAULT_TIMEOUT,
    json: options.Json = False,
) -> None:
    """Start a service, drive simulated robots through an office, and merge what they saw.

    The robots start in places that nobody tells the service, with clocks of their own and
    without odometry. At the end their maps are one, its true error is printed, and the map is in
    out/map.svg and out/map.png. Exit code 4 where the robots did not come together.

    \b
    Example:
      lineloom demo --robots 3 --stay
    """
    fleet = build_fleet(
        "office", world_seed=seed, lidar=lidar, robots=robots, seed=seed, duration_s=duration
    )
    with _data(data_dir) as folder, _stopped_by_signals(), ChildService(folder, port) as service:
        note(f"service: starting on {service.url}, data in {folder}")
        with waiting("The service starts") as tell:
            service.wait_until_ready(_FIRST_START_S, tell)
        with Client(service.url, retry=patient()) as client:
            truth = Truth()
            played = _drive(client, fleet, truth, timeout)
            _save_maps(client, out_dir)
            errors = _judge(client, truth)
        _report(service.url, out_dir, played, errors, json=json)
        if stay:
            note(f"The service stays up: try {service.url}/v1/sites/{SITE} — Ctrl-C stops it.")
            _wait(service)
        else:
            note("The service is stopped now; `lineloom demo --stay` leaves it up for queries.")


def _drive(client: Client, fleet: Fleet, truth: Truth, timeout: float) -> Played:
    total = scan_count(fleet)
    note(f"{len(fleet.robots)} robots set out, start poses unknown: {total} scans to come")
    with Watch(client, SITE, total) as watch:
        player = Player(client, SITE, batch=25, on_sent=watch.on_sent)
        played = player.play(_scans(fleet, truth))
        client.wait_until_idle(SITE, timeout, on_poll=watch.on_site)
    return played


def _scans(fleet: Fleet, truth: Truth) -> Iterator[Due]:
    for simulated in fleet.scans():
        pose = simulated.true_pose
        truth.note(simulated.robot, simulated.scan.seq, (pose.x, pose.y, pose.theta))
        yield Due(simulated.time_s, simulated.robot, to_wire(simulated.scan))


def _save_maps(client: Client, out_dir: Path) -> None:
    out_dir.mkdir(parents=True, exist_ok=True)
    (out_dir / "map.svg").write_bytes(client.map_file(SITE, "svg"))
    (out_dir / "map.png").write_bytes(client.map_file(SITE, "png"))


def _judge(client: Client, truth: Truth) -> list[PairError]:
    robots = client.robots(SITE).robots
    component = common_component(robots)
    if component is None:
        groups: dict[str | None, list[str]] = {}
        for robot in robots:
            groups.setdefault(robot.component, []).append(robot.robot)
        raise not_merged(groups)
    return truth.errors(client, SITE, component)


def _report(
    url: str, out_dir: Path, played: Played, errors: list[PairError], *, json: bool
) -> None:
    if json:
        files = [str(out_dir / "map.svg"), str(out_dir / "map.png")]
        pairs = [asdict(error) for error in errors]
        print_json({"url": url, "scans": played.accepted, "errors": pairs, "files": files})
        return
    out.print(f"All robots are in one map, from {played.accepted} scans. Its true error:")
    out.print(table(errors))
    out.print(f"The map: {out_dir / 'map.svg'}, {out_dir / 'map.png'}", markup=False)
    out.print(f"The service: {url}", markup=False)


def _wait(service: ChildService) -> None:
    try:
        service.wait()
    except KeyboardInterrupt:
        note("stopping")


@contextmanager
def _data(data_dir: Path | None) -> Iterator[Path]:
    if data_dir is not None:
        yield data_dir
        return
    folder = Path(tempfile.mkdtemp(prefix="lineloom-demo-"))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _stopped_by_signals() -> Iterator[None]:
    """Let SIGTERM unwind the `with` blocks, so that the service is not left behind."""

    def stop(number: int, frame: object) -> NoReturn:
        raise typer.Exit(int(Exit.FAILED))

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)

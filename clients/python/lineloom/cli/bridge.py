"""`lineloom bridge`: a ROS 2 robot's bridge where no ROS is installed."""

from __future__ import annotations

import signal
import threading
from typing import Annotated, Any

import typer

from lineloom.bridge.settings import SettingError, read_settings
from lineloom.cli.console import note
from lineloom.cli.failure import CommandError, Exit
from lineloom.cli.options import DEFAULT_SITE, Site, Token, Url


def bridge(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="The robot's name on the site.")],
    dds: Annotated[bool, typer.Option("--dds", help="On DDS, ROS 2's usual wire.")] = False,
    zenoh: Annotated[bool, typer.Option("--zenoh", help="On Zenoh, as rmw_zenoh has it.")] = False,
    namespace: Annotated[str, typer.Option(help="Namespace of the robot's topics.")] = "",
    shared_tf: Annotated[
        bool, typer.Option("--shared-tf", help="TF on /tf, whatever the namespace.")
    ] = False,
    odometry: Annotated[str, typer.Option(help="tf, topic (odom) or none.")] = "tf",
    map_frame: Annotated[str, typer.Option(help="May have {component} in it.")] = "map",
    odom_frame: Annotated[str, typer.Option(help="Odometry's frame.")] = "odom",
    base_frame: Annotated[str, typer.Option(help="The base's frame.")] = "base_link",
    frame_prefix: Annotated[str, typer.Option(help="Before odometry's and base's frame.")] = "",
    queue: Annotated[str, typer.Option(help="File of scans not yet delivered.")] = "",
    url: Url = None,
    token: Token = None,
    site: Site = DEFAULT_SITE,
) -> None:
    """Bridge a ROS 2 robot: scans in, transforms and map out; no ROS needed here.

    The domain is ROS_DOMAIN_ID's.

    \b
    Example:
      lineloom bridge r1 --dds --namespace r1 --site floor-2
    """
    if dds == zenoh:
        raise CommandError("say --dds or --zenoh", Exit.USAGE)
    try:
        settings = read_settings(
            {
                "url": url or "",
                "token": token or "",
                "site": site,
                "robot": robot,
                "queue": queue,
                "odometry": odometry,
                "map_frame": map_frame,
                "odom_frame": odom_frame,
                "base_frame": base_frame,
                "frame_prefix": frame_prefix,
            }
        )
    except SettingError as error:
        raise CommandError(str(error), Exit.USAGE) from None
    run, wire = _wire("dds" if dds else "zenoh")
    stopping = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopping.set())
    note(f"bridging {robot} on {'DDS' if dds else 'Zenoh'}")
    run(wire, settings, namespace, stopping.is_set, shared_tf=shared_tf)


def _wire(name: str) -> tuple[Any, Any]:
    """Return what runs a bridge, and the wire that it runs on."""
    try:
        from lineloom.bridge.wire import run

        if name == "dds":
            from lineloom.bridge.dds import DdsWire

            return run, DdsWire()
        from lineloom.bridge.zenoh import ZenohWire
    except ImportError:
        install = f"`pip install lineloom-client[{name}]`"
        raise CommandError(f"--{name} needs {install}") from None
    try:
        return run, ZenohWire()
    except Exception as error:
        raise CommandError(f"no Zenoh router: {error}") from None

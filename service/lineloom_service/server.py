"""`lineloom serve`: the app behind uvicorn, until told to stop."""

from __future__ import annotations

import asyncio
import ipaddress
import logging
import sys

import uvicorn
import uvloop

from lineloom_service.app import create_app
from lineloom_service.service import Service
from lineloom_service.settings import Settings
from lineloom_service.store.records import StoreError

_SHUTDOWN_S = 5


def run(settings: Settings) -> None:
    """Serve until SIGINT or SIGTERM. Exits with a message where it cannot even start."""
    logging.basicConfig(
        level=settings.log_level.upper(),
        format="%(asctime)s %(levelname)s %(name)s: %(message)s",
        stream=sys.stderr,
    )
    # Every request to stderr costs more than the request.
    for noisy in ("alembic", "uvicorn.access"):
        logging.getLogger(noisy).setLevel(logging.WARNING)
    if not settings.open and not _is_loopback(settings.host):
        sys.exit(
            f"lineloom: {settings.host} is reachable from outside and nothing protects the "
            "service; listen on 127.0.0.1, or say that this is meant (LINELOOM_OPEN=true)"
        )
    try:
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            runner.run(_serve(settings))
    except StoreError as error:
        sys.exit(f"lineloom: {error}")
    except KeyboardInterrupt:
        # uvicorn raises the signal again once it has stopped in good order.
        pass


async def _serve(settings: Settings) -> None:
    service = Service(settings)
    await service.start()
    try:
        config = uvicorn.Config(
            create_app(service=service),
            host=settings.host,
            port=settings.port,
            log_config=None,
            proxy_headers=False,
            access_log=settings.log_level == "debug",
            timeout_graceful_shutdown=_SHUTDOWN_S,
        )
        await uvicorn.Server(config).serve()
    finally:
        await service.stop()


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False

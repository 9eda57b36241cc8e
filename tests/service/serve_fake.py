"""What a server process with the fake mapper runs."""

from __future__ import annotations

import asyncio
import os
import time
from pathlib import Path

from lineloom_core.matching import LineMatcher
from lineloom_service import server
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.observation import log
from lineloom_service.service import Service
from lineloom_service.settings import Settings


def serve(directory: Path, port: int) -> None:
    """Serve until told to stop, then end the process."""
    settings = Settings(
        data_dir=directory,
        database_url=os.environ.get("SERVER_DATABASE_URL"),
        gap_window_s=0.2,
        snapshot_every=100,
        port=port,
    )
    mapper = os.environ.get("SERVER_MAPPER", "fake_mapper:FakeMapper")
    engine = LocalEngine(1, publish_every_s=0.1, mapper=mapper, warm_up=None)
    log.configure("warning", "text")
    if "SERVER_COMPILES" in os.environ:  # for an hour, as far as anybody can tell
        LineMatcher.match = lambda *_: time.sleep(3600.0)  # type: ignore[assignment]
    service = Service(settings, engine=engine)
    if "SERVER_HANGS" in os.environ:  # as on a database that does not answer
        server._CLOSE_S = 1
        service.store.close = lambda: asyncio.sleep(3600.0)  # type: ignore[method-assign]
    server.run_service(service)

"""Mapping outside the API process: workers that host mappers, and who feeds them."""

from lineloom_service.engine.conductor import Conductor
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.engine.protocol import (
    Engine,
    MapperFailedError,
    RestoreFailedError,
    ViewListener,
    WorkerDiedError,
)
from lineloom_service.engine.site_runner import Published

__all__ = [
    "Conductor",
    "Engine",
    "LocalEngine",
    "MapperFailedError",
    "Published",
    "RestoreFailedError",
    "ViewListener",
    "WorkerDiedError",
]

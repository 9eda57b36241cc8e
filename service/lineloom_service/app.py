"""The ASGI application."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import FastAPI

from lineloom_service import __version__, errors, openapi
from lineloom_service.routes import ROUTERS
from lineloom_service.service import Service
from lineloom_service.settings import Settings


def create_app(settings: Settings | None = None, *, service: Service | None = None) -> FastAPI:
    """Return the app. It starts and stops a service of its own, unless one is given."""
    own = Service(settings or Settings()) if service is None else None

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        if own is not None:
            await own.start()
        try:
            yield
        finally:
            if own is not None:
                await own.stop()

    app = FastAPI(
        title="Lineloom",
        version=__version__,
        lifespan=lifespan,
        responses=openapi.PROBLEM_ANSWER,
        # A redirect would lose the body of a POST in many clients: one address, one spelling.
        redirect_slashes=False,
    )
    app.state.service = service or own
    for router in ROUTERS:
        app.include_router(router)
    errors.install(app)
    openapi.install(app)
    return app

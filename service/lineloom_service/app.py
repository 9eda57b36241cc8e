"""The ASGI application."""

from __future__ import annotations

from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager

from fastapi import Depends, FastAPI
from fastapi.middleware.cors import CORSMiddleware

from lineloom_service import __version__, errors, openapi
from lineloom_service.body_budget import BodyAdmission
from lineloom_service.dependencies import admitted
from lineloom_service.observation.requests import RequestObserver
from lineloom_service.pacing import IngestPacing
from lineloom_service.routes import OPEN_ROUTERS, ROUTERS, allowed_methods, docs, viewer
from lineloom_service.security.headers import SecurityHeaders
from lineloom_service.security.quotas import QuotaEnd
from lineloom_service.service import Service
from lineloom_service.settings import Settings


def create_app(settings: Settings | None = None, *, service: Service | None = None) -> FastAPI:
    """Return the app. It starts and stops a service of its own, unless one is given."""
    own = Service(settings or Settings()) if service is None else None
    served = service or own
    assert served is not None

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
        # FastAPI's own pages load their scripts from elsewhere.
        docs_url=None,
        redoc_url=None,
    )
    app.state.service = served
    for router in ROUTERS:
        app.include_router(router, dependencies=[Depends(admitted)])
    for router in OPEN_ROUTERS:
        app.include_router(router)
    docs.mount(app)
    viewer.mount(app)
    if served.settings.allow_origins:
        _allow_origins(app, served.settings.allow_origins)
    app.add_middleware(BodyAdmission, budget=served.bodies)
    app.add_middleware(QuotaEnd)
    app.add_middleware(IngestPacing, pacer=served.pacer)
    # The last one added is the outermost.
    app.add_middleware(RequestObserver, metrics=served.metrics)
    app.add_middleware(SecurityHeaders)
    errors.install(app, allowed_methods)
    openapi.install(app)
    return app


def _allow_origins(app: FastAPI, origins: Sequence[str]) -> None:
    """Let pages from these origins call the service with a token; cookies there are none."""
    app.add_middleware(
        CORSMiddleware,
        allow_origins=list(origins),
        allow_methods=["GET", "POST", "PUT", "DELETE"],
        allow_headers=[
            "Authorization",
            "Content-Encoding",
            "Content-Type",
            "If-None-Match",
            "Last-Event-ID",
        ],
        expose_headers=["ETag", "Retry-After", "WWW-Authenticate", "X-Request-ID"],
    )

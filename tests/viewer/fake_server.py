"""Serves the viewer's real files over a fake site; can want a token, and can be away."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import threading
import time
from collections.abc import AsyncIterator, Iterator
from typing import Any

import uvicorn
from fastapi import APIRouter, FastAPI, Request, Response
from fastapi.responses import JSONResponse, StreamingResponse
from lineloom.wire import MAP_FORMATS, MapFormatList
from lineloom_service.routes import viewer
from lineloom_service.security.headers import SecurityHeaders

from tests.viewer.fake_site import SITE, FakeSite, evidence

TOKEN = "let-me-in"
_SITE = f"/v1/sites/{SITE}"


class FakeServer:
    """What the tests turn: the site, whether there is one, and who may see it."""

    def __init__(self, site: FakeSite | None = None) -> None:
        self.site = site or FakeSite()
        self.exists = True
        self.wants_token = False
        self.streams = True
        self.slow_s = 0.0
        """How long the answer to what a join would be takes."""
        self.posted: list[tuple[str, Any]] = []
        self.url = ""
        self._news: list[dict[str, Any]] = []
        self._port = 0
        self._server: uvicorn.Server | None = None
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Listen: on a free port, and again on the same after `stop`."""
        listener = socket.socket()
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(("127.0.0.1", self._port))
        self._port = listener.getsockname()[1]
        self.url = f"http://127.0.0.1:{self._port}"
        config = uvicorn.Config(self._app(), log_level="error", timeout_graceful_shutdown=1)
        server = self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        self._thread.start()
        while not server.started:
            time.sleep(0.01)

    def stop(self) -> None:
        """Be away."""
        if self._server is not None and self._thread is not None:
            self._server.should_exit = True
            self._thread.join()
        self._server = None

    def _app(self) -> FastAPI:
        app = FastAPI()

        @app.middleware("http")
        async def guard(request: Request, call_next: Any) -> Response:
            api = request.url.path.startswith("/v1")
            if api and self.wants_token and not self._allowed(request):
                return _problem(401, "no token was given, or it is not valid")
            if request.url.path.startswith(_SITE) and not self.exists:
                return _problem(404, "no site 'fake'; it is created by its first scan")
            response: Response = await call_next(request)
            return response

        app.add_middleware(SecurityHeaders)
        app.include_router(viewer.router)
        viewer.mount(app)
        app.include_router(self._queries())
        app.include_router(self._actions())
        return app

    def _allowed(self, request: Request) -> bool:
        return request.headers.get("Authorization") == f"Bearer {TOKEN}"

    def _queries(self) -> APIRouter:
        router, site = APIRouter(), self.site

        @router.get("/v1/sites")
        def sites() -> Any:
            return {"sites": [site.site()] if self.exists else []}

        @router.get("/v1/map-formats")
        def map_formats() -> Any:
            return MapFormatList(formats=dict(MAP_FORMATS))

        @router.get(f"{_SITE}/map")
        def line_map(request: Request, since: int | None = None) -> Response:
            return self._versioned(request, site.map() if since is None else site.changes(since))

        @router.get(f"{_SITE}/constraints")
        def constraints(request: Request, kind: str) -> Response:
            found = [c for c in site.constraints if c["kind"] == kind]
            page = {"version": site.version, "constraints": found, "next_cursor": None}
            return self._versioned(request, page)

        @router.get(f"{_SITE}/graph")
        def graph(request: Request) -> Response:
            return self._versioned(request, site.graph())

        @router.get(f"{_SITE}/constraints/{{identity}}")
        def constraint(identity: str) -> Any:
            return evidence(next(c for c in site.constraints if c["id"] == identity))

        @router.get(f"{_SITE}/robots/{{robot}}/trajectory")
        def trajectory(robot: str) -> Any:
            return site.trajectory(robot)

        @router.get(f"{_SITE}/events")
        async def events() -> Response:
            if not self.streams:
                return _problem(404, "no such address")
            news = self._events(site.version, site.told())  # of before the page knows it is open
            return StreamingResponse(news, media_type="text/event-stream")

        @router.get(f"{_SITE}/floorplan")
        def floorplan() -> Any:
            if site.plan is None:
                return _problem(404, "site 'fake' has no floor plan; PUT one")
            return site.floorplan(site.plan)

        router.add_api_route(f"{_SITE}/floorplan/differences", site.differences)
        router.add_api_route(_SITE, site.site)
        router.add_api_route(f"{_SITE}/robots", site.robots)
        return router

    def _versioned(self, request: Request, content: Any) -> Response:
        """Answer, or say that the page has it already."""
        etag = f'"{self.site.version}"'
        if request.headers.get("If-None-Match") == etag:
            return Response(status_code=304, headers={"ETag": etag})
        return JSONResponse(content, headers={"ETag": etag})

    def _actions(self) -> APIRouter:
        router = APIRouter()

        @router.post(f"{_SITE}/constraints/what-if")
        async def try_join(request: Request) -> Any:
            self.posted.append(("what-if", await request.json()))
            if self.slow_s:
                await asyncio.sleep(self.slow_s)
            return self.site.try_join()

        @router.post(f"{_SITE}/constraints")
        async def join(request: Request) -> Any:
            said = await request.json()
            self.posted.append(("join", said))
            return JSONResponse(self.site.say(said), 201)

        @router.post(f"{_SITE}/constraints/{{identity}}/{{action}}")
        async def act(identity: str, action: str) -> Any:
            if action == "what-if":
                state = next(c for c in self.site.constraints if c["id"] == identity)["state"]
                return self.site.what_if(identity, "restore" if state == "retracted" else "retract")
            return self.site.act(identity, action)

        @router.post(f"{_SITE}/localize")
        async def localize(request: Request) -> Any:
            self.posted.append(("localize", await request.json()))
            place: dict[str, Any] = {
                "x": 3.0,
                "y": 2.0,
                "theta": 0.3,
                "covariance": None,
                "checks": {},
            }
            hypotheses = [
                {"component": "c0", **place, "score": 0.9},
                {"component": "c1", **place, "score": 0.2},
            ]
            return {"verdict": "unique", "reason": "", "scan": 0, "hypotheses": hypotheses}

        return router

    async def _events(self, told: int, before: dict[str, dict[str, Any]]) -> AsyncIterator[str]:
        """For every new version what has changed, a map with it; or else what `tell` was given."""
        yield ": here we are\n\n"
        server = self._server
        while server is not None and not server.should_exit:
            if self.site.version != told:
                told, now = self.site.version, self.site.told()
                news = [event for key, event in now.items() if before.get(key) != event]
                before = now
                for event in self._news or [*news, {"type": "map"}]:
                    data = json.dumps(event | {"version": told})
                    yield f"id: {told}\nevent: {event['type']}\ndata: {data}\n\n"
                self._news = []
            await asyncio.sleep(0.03)

    def tell(self, *news: dict[str, Any]) -> None:
        """Say that just this has happened."""
        self._news = list(news)
        self.site.version += 1


def _problem(status: int, detail: str) -> Response:
    content = {"type": "about:blank", "title": "refused", "status": status, "detail": detail}
    return JSONResponse(content, status, media_type="application/problem+json")


@contextlib.contextmanager
def fake_server(site: FakeSite | None = None) -> Iterator[FakeServer]:
    """A server that is stopped in the end."""
    server = FakeServer(site)
    server.start()
    try:
        yield server
    finally:
        server.stop()

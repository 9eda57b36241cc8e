"""Sees every request: gives it an id, counts it, and logs it where it is worth a line."""

from __future__ import annotations

import logging
import re
import secrets
import time

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from lineloom_service.errors import INTERNAL, internal_problem
from lineloom_service.observation.log import bind
from lineloom_service.observation.metrics import Metrics

_LOG = logging.getLogger(__name__)
_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")
_SLOW_S = 1.0
_PROBES = ("/healthz", "/readyz")
_NO_ROUTE = "none"
_STREAM = "text/event-stream"


class RequestObserver:
    """ASGI middleware. A client's own `X-Request-ID` is kept, and every answer has one."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self._app = app
        self._metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, and look at what becomes of it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        offered = Headers(scope=scope).get("x-request-id", "")
        request_id = offered if _ID.fullmatch(offered) else secrets.token_hex(8)
        bind(request_id=request_id)
        begin = time.perf_counter()
        status, kind = 0, ""

        async def send_and_look(message: Message) -> None:
            nonlocal status, kind
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers["X-Request-ID"] = request_id
                status, kind = message["status"], headers.get("content-type", "")
            await send(message)

        try:
            await self._app(scope, receive, send_and_look)
        except Exception:
            _LOG.exception("%s %s failed", scope["method"], scope["path"])
            self._metrics.count_problem(INTERNAL.slug)
            if status:
                raise  # half an answer is out already: the server breaks the connection off
            await internal_problem()(scope, receive, send_and_look)
        finally:
            self._finish(scope, status, kind, time.perf_counter() - begin)

    def _finish(self, scope: Scope, status: int, kind: str, seconds: float) -> None:
        route = getattr(scope.get("route"), "path", _NO_ROUTE)
        streams = kind.startswith(_STREAM)
        if not streams:
            self._metrics.observe_request(scope["method"], route, status, seconds)
        slow = seconds > _SLOW_S and not streams
        level = logging.DEBUG
        if route in _PROBES:
            pass  # asked for every second, and "not yet" is no failure
        elif status >= 500 or slow:
            level = logging.WARNING
        elif status >= 400:
            level = logging.INFO
        if _LOG.isEnabledFor(level):
            names = scope.get("path_params") or {}
            bind(site=names.get("site"), robot=names.get("robot"))
            # Without the query: nothing of ours in it is secret, but others put tokens there.
            fields = {"status": status, "duration_s": round(seconds, 6)}
            _LOG.log(level, "%s %s %d", scope["method"], scope["path"], status, extra=fields)

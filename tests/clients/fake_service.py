"""A stand-in for the service that keeps its promises on ingest, and can be told to fail."""

from __future__ import annotations

import gzip
import json
import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import httpx
import msgpack

Answer = Callable[[httpx.Request], httpx.Response]


class FakeService:
    """Takes scans like the real service (idempotent by session and seq), answers like it.

    failures: answers, or exceptions, given to the next requests before any is served. lost: how
    many of the next POSTs are taken but their answers lost on the way.
    """

    def __init__(self) -> None:
        self.scans: dict[tuple[str, str, str, int], dict[str, Any]] = {}
        self.requests: list[httpx.Request] = []
        self.failures: list[Answer | Exception] = []
        self.routes: dict[tuple[str, str], Answer] = {}
        self.lost = 0
        self.unacceptable: set[int] = set()
        self.batch_sizes: list[int] = []
        self._lock = threading.Lock()

    def __call__(self, request: httpx.Request) -> httpx.Response:
        with self._lock:
            self.requests.append(request)
            if self.failures:
                failure = self.failures.pop(0)
                if isinstance(failure, Exception):
                    raise failure
                return failure(request)
            route = self.routes.get((request.method, request.url.path))
            if route is not None:
                return route(request)
            if request.method == "POST" and request.url.path.endswith("/scans"):
                return self._ingest(request)
            if request.url.path == "/readyz":
                return httpx.Response(200, json={"takes_scans": True, "maps": True, "reasons": []})
            if request.url.path.count("/") == 3:
                return self._site(request.url.path.rsplit("/", 1)[1])
        return problem(404, "not-found", "nothing here")(request)

    async def asynchronous(self, request: httpx.Request) -> httpx.Response:
        return self(request)

    def delivered(self, robot: str = "r") -> list[tuple[str, int]]:
        return [(session, seq) for _, name, session, seq in self.scans if name == robot]

    def _site(self, name: str) -> httpx.Response:
        """Answer for a site whose map is always done, all its robots in one component."""
        keys = [key for key in self.scans if key[0] == name]
        if not keys:
            return problem(404, "no-site", f"no site {name}")(httpx.Request("GET", "/"))
        robots = sorted({robot for _, robot, _, _ in keys})
        counts = {"accepted": len(keys), "processed": len(keys), "pending": 0}
        body = {"site": name, "version": len(keys), "idle": True, "scans": counts}
        body |= {"robots": robots, "merged_into": {}}
        body |= {"components": [{"id": "c1", "robots": robots, "keyframes": 1}]}
        return httpx.Response(200, json=body | {"constraints": {"loop": {"accepted": 2}}})

    def _ingest(self, request: httpx.Request) -> httpx.Response:
        _, _, _, site, _, robot, _ = request.url.path.split("/")
        body = read_body(request)
        counts: dict[str, Any] = {"accepted": 0, "duplicates": 0, "rejected": []}
        self.batch_sizes.append(len(body["scans"]))
        for index, scan in enumerate(body["scans"]):
            key = (site, robot, scan.get("session", "0"), scan["seq"])
            if scan["seq"] in self.unacceptable:
                refusal = {"index": index, "seq": scan["seq"], "reason": "range_max: too small"}
                counts["rejected"].append(refusal)
            elif key in self.scans:
                counts["duplicates"] += 1
            else:
                self.scans[key] = scan
                counts["accepted"] += 1
        if self.lost:
            self.lost -= 1
            raise httpx.ReadError("connection reset by peer")
        return httpx.Response(202, json={**counts, "pending": len(self.scans)})


def read_body(request: httpx.Request) -> Any:
    """Return what a request carries, decompressed and decoded."""
    content = request.content
    if request.headers.get("Content-Encoding") == "gzip":
        content = gzip.decompress(content)
    if request.headers["Content-Type"] == "application/msgpack":
        return msgpack.unpackb(content)
    return json.loads(content)


def problem(status: int, kind: str, detail: str, **headers: str) -> Answer:
    """Return an answer that is a problem of RFC 9457; underscores in header names are hyphens."""
    body = {"type": f"/problems/{kind}", "title": kind, "status": status, "detail": detail}
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    named["Content-Type"] = "application/problem+json"
    return lambda request: httpx.Response(status, content=json.dumps(body), headers=named)


def served(service: FakeService) -> tuple[ThreadingHTTPServer, str]:
    """Put a FakeService on a loopback port; the caller shuts the server down."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            self._answer()

        def do_PUT(self) -> None:
            self._answer()

        def do_DELETE(self) -> None:
            self._answer()

        def do_POST(self) -> None:
            self._answer()

        def _answer(self) -> None:
            content = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            request = httpx.Request(self.command, f"http://x{self.path}", content=content)
            request.headers.update(dict(self.headers))
            answer = service(request)
            self.send_response(answer.status_code)
            kind = answer.headers.get("Content-Type", "application/json")
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(answer.content)))
            self.end_headers()
            self.wfile.write(answer.content)

        def log_message(self, format: str, *args: object) -> None:
            """Keep the test's output clean."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True).start()
    return server, f"http://127.0.0.1:{server.server_address[1]}"


def scan(seq: int | None = 0, **changes: Any) -> dict[str, Any]:
    """Return a small scan; its ranges depend on seq, so that no two are alike."""
    fields: dict[str, Any] = {
        "stamp": 100.0 + 0.1 * (seq or 0),
        "angle_min": -0.1,
        "angle_increment": 0.1,
        "range_min": 0.1,
        "range_max": 30.0,
        "ranges": [1.0 + 0.01 * (seq or 0), None, "inf"],
    }
    if seq is not None:
        fields["seq"] = seq
    return fields | changes

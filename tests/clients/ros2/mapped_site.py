"""A stand-in for the service that places every scan: where its odometry was, moved."""

from __future__ import annotations

import json
from typing import Any

import httpx
import numpy as np
from lineloom.bridge.planar import Planar
from lineloom_core.fusion.occupancy import OccupancyGrid
from lineloom_core.io.nav2 import write_map

from tests.clients.fake_service import FakeService, problem


class MappedSite:
    """Site s. moved: T_map_odom of each component. component, state: of each robot, by name."""

    def __init__(self, fake: FakeService, *robots: str) -> None:
        self.moved: dict[str, Planar] = {"c0": Planar(10.0, 5.0, 1.0)}
        self.component = dict.fromkeys(robots, "c0")
        self.state = dict.fromkeys(robots, "tracking")
        self.merged_into: dict[str, str] = {}
        self.version = 1
        self.away = False
        self.mounts: list[Any] = []
        self._fake = fake
        fake.routes["GET", "/v1/sites/s"] = self._open(self._get_site)
        fake.routes["GET", "/v1/sites/s/map"] = self._open(self._get_map)
        for robot in robots:
            path = f"/v1/sites/s/robots/{robot}"
            fake.routes["PUT", path] = self._open(self._put)
            fake.routes["GET", path] = self._open(self._get)
            fake.routes["POST", f"{path}/scans"] = self._open(fake._ingest)

    def scans(self, robot: str = "r") -> list[dict[str, Any]]:
        """Return the scans that came, in order."""
        return [scan for key, scan in sorted(self._fake.scans.items()) if key[1] == robot]

    def _open(self, answer: Any) -> Any:
        def guarded(request: httpx.Request) -> httpx.Response:
            if self.away:
                return problem(503, "storage", "the service is away")(request)
            return answer(request)  # type: ignore[no-any-return]

        return guarded

    def _put(self, request: httpx.Request) -> httpx.Response:
        self.mounts.append(json.loads(request.content)["mount"])
        return self._get(request)

    def _get(self, request: httpx.Request) -> httpx.Response:
        name = request.url.path.rsplit("/", 1)[1]
        counts = {"accepted": 1, "processed": 1, "pending": 0}
        body: dict[str, Any] = {"robot": name, "site": "s", "scans": counts, "health": []}
        body["state"] = self.state[name]
        keys = [key for key in self._fake.scans if key[1] == name]
        if not keys:
            return httpx.Response(200, json=body | {"state": "starting"})
        latest = max(keys, key=lambda key: key[3])
        odometry = self._fake.scans[latest].get("odometry") or {"x": 0.0, "y": 0.0, "theta": 0.0}
        component = self.component[name]
        pose = self.moved[component] @ Planar(**odometry)
        covariance = [[0.01, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.003]]
        placed = {"x": pose.x, "y": pose.y, "theta": pose.theta, "covariance": covariance}
        body |= {"component": component, "pose": placed}
        return httpx.Response(
            200, json=body | {"latest_session": latest[2], "latest_seq": latest[3]}
        )

    def _get_site(self, _request: httpx.Request) -> httpx.Response:
        counts = {"accepted": 1, "processed": 1, "pending": 0}
        body = {"site": "s", "version": self.version, "idle": True, "scans": counts}
        body |= {"robots": list(self.state), "components": [], "constraints": {}}
        return httpx.Response(200, json=body | {"merged_into": self.merged_into})

    def _get_map(self, request: httpx.Request) -> httpx.Response:
        component = request.url.params["component"]
        width = 3 + int(component[1:])
        if request.url.params.get("format") == "nav2":
            cells = np.full((2, width), -1, dtype=np.int8)
            cells[0, :2] = 0, 100
            return httpx.Response(200, content=write_map(OccupancyGrid(cells, -1.0, -2.0, 0.05)))
        line = {"id": "l", "component": component, "x1": 0, "y1": 0, "x2": 1, "y2": 0.5}
        line |= {"sigma": 0.01, "support": 1, "robots": ["r"], "first_seen": 0, "last_seen": 0}
        components = [{"id": component, "robots": ["r"]}]
        body = {"site": "s", "version": self.version, "components": components, "lines": [line]}
        return httpx.Response(200, json=body)

"""Load from outside, by locust: robots that send scans, and people who look at the map.

    lineloom serve &
    locust -f tests/benchmarks/locustfile.py --headless --users 32 --spawn-rate 32 \\
           --run-time 60s --host http://127.0.0.1:8765

`pip install locust` (the dependency group `strangers`). Robots send one scan of 361 beams a POST as
fast as they are answered; per four robots one viewer asks for the map twice a second. Each run is a
site of its own (LINELOOM_SITE to choose); LINELOOM_TOKEN where the service asks for one.
"""

from __future__ import annotations

import itertools
import math
import os
import time

from lineloom.wire import MSGPACK, Scan, pack_msgpack
from locust import FastHttpUser, constant_pacing, task

BEAMS = 361
SITE = os.environ.get("LINELOOM_SITE", f"load-{int(time.time())}")
TOKEN = os.environ.get("LINELOOM_TOKEN")
HEADERS = {} if TOKEN is None else {"Authorization": f"Bearer {TOKEN}"}

_numbers = itertools.count()


def room(phase: float) -> list[float]:
    """Ranges of a robot that turns in a square room of 8 m."""
    angles = (phase + math.radians(0.5 * beam) for beam in range(BEAMS))
    return [4.0 / max(abs(math.cos(a)), abs(math.sin(a))) for a in angles]


class Robot(FastHttpUser):
    """Sends scan after scan."""

    weight = 4

    def on_start(self) -> None:
        """Take a name."""
        self.name = f"robot-{next(_numbers)}"
        self.sent = 0

    @task
    def send(self) -> None:
        """POST the next scan."""
        scan = Scan(
            seq=self.sent,
            stamp=0.1 * self.sent,
            angle_min=0.0,
            angle_increment=math.radians(0.5),
            range_min=0.1,
            range_max=30.0,
            ranges=room(0.02 * self.sent),
        )
        self.sent += 1
        self.client.post(
            f"/v1/sites/{SITE}/robots/{self.name}/scans",
            data=pack_msgpack([scan]),
            headers={**HEADERS, "Content-Type": MSGPACK},
            name="POST scans",
        )


class Viewer(FastHttpUser):
    """Looks at the map, and asks only for what is new."""

    weight = 1
    wait_time = constant_pacing(0.5)

    def on_start(self) -> None:
        """Know nothing."""
        self.etag = ""

    @task
    def look(self) -> None:
        """GET the map; 304 where nothing has changed, 404 before the first scan."""
        with self.client.get(
            f"/v1/sites/{SITE}/map",
            headers={**HEADERS, "If-None-Match": self.etag},
            name="GET map",
            catch_response=True,
        ) as response:
            if response.status_code in (200, 304, 404):
                response.success()
            self.etag = (response.headers or {}).get("ETag", "")

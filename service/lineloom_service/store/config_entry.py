"""The mapper's parameters as the log has them: an entry of kind `config`, canonical JSON.

The latest one holds from the first scan on. Entries belong to a robot, and these to none: so each
site has a robot without a name, which nobody sees, and with it lies what was logged last.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

OWN_ROBOT = ""
"""The name of the robot that stands for its site."""


@dataclass(frozen=True, slots=True)
class ConfigEntry:
    """What a site's map is made with from now on, the scans before included.

    digest: of code, parameters and processor (`lineloom_core.mapping.digest`). parameters: every
    one by name, nested. own: those that the site's own PUT named. position: in the log, 0 while it
    is in none. since: of the first of those in a row that make the same map.
    """

    digest: str
    parameters: Mapping[str, Any]
    own: Mapping[str, Any] = field(default_factory=dict)
    position: int = 0
    since: int = 0

    @property
    def making(self) -> str:
        """What snapshots of such a map are keyed by."""
        return f"{self.digest}@{self.since}"

    def encode(self) -> bytes:
        """Return the body of the log entry; the same entry gives the same bytes."""
        return json.dumps(asdict(self), sort_keys=True, separators=(",", ":")).encode()

    @classmethod
    def decode(cls, body: bytes) -> ConfigEntry:
        """Return the entry that was encoded."""
        return cls(**json.loads(body))

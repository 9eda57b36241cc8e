"""The mapper as the engine sees it."""

from __future__ import annotations

import importlib
from typing import Any, Protocol

from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.belief.claim import Claim
from lineloom_core.mapping.changes import Changes
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.snapshot import Snapshot
from lineloom_core.scan import Mount, Scan

from lineloom_service.store.codec import decode_claim, decode_mount, decode_scan
from lineloom_service.store.records import LogEntry

SITE_MAPPER = "lineloom_core.mapping.site_mapper:SiteMapper"
"""Where the mapper is; by name, so that the API process need not import gtsam."""

WARM_UP = "lineloom_core.warm_up.drive:warm_up"
"""What a worker calls before it is ready: loads its kernels, and compiles what is missing."""


class Mapper(Protocol):
    """A deterministic state machine over a site's log entries."""

    def add(self, robot: str, scan: Scan) -> Changes:
        """Take a scan."""
        ...

    def set_mount(self, robot: str, mount: Mount) -> None:
        """Take a robot's mount for the scans that follow."""
        ...

    def forget(self, robot: str) -> None:
        """Remove a robot."""
        ...

    def retract(self, constraint: str | Claim) -> None:
        """Believe a constraint no longer."""
        ...

    def restore(self, constraint: str | Claim) -> None:
        """Take a retraction back."""
        ...

    def join(self, claim: Claim) -> None:
        """Believe what an operator says."""
        ...

    def note(self) -> None:
        """Take an entry that changes nothing."""
        ...

    def view(self, *, settled: bool = False) -> SiteView:
        """Return all that is known now. settled: at the optimum of all constraints."""
        ...

    def snapshot(self, known: int = 0) -> Snapshot:
        """Return the state, without the first `known` chapters of its history."""
        ...


class MapperFactory(Protocol):
    """The mapper's class."""

    def __call__(self, config: MapperConfig, /) -> Mapper:
        """Make a mapper that knows nothing."""
        ...

    def resume(self, snapshot: Snapshot) -> Mapper:
        """Make one from a whole snapshot."""
        ...


def load(path: str) -> Any:
    """Import what `module:name` names."""
    module, _, name = path.partition(":")
    return getattr(importlib.import_module(module), name)


def apply(mapper: Mapper, entry: LogEntry) -> None:
    """Feed one log entry."""
    if entry.kind == "config":
        mapper.note()
        return
    if entry.kind == "forget":
        mapper.forget(entry.robot)
        return
    if entry.kind == "mount":
        mount = Mount() if entry.body is None else decode_mount(entry.body)
        mapper.set_mount(entry.robot, mount)
        return
    if entry.kind in ("retract", "restore"):
        act = mapper.retract if entry.kind == "retract" else mapper.restore
        act(decode_claim(entry.body or b""))
        return
    if entry.kind == "join":
        said = decode_claim(entry.body or b"")
        if isinstance(said, str):
            raise ValueError("a join entry has no claim")
        mapper.join(said)
        return
    if entry.body is None or entry.session is None or entry.seq is None:
        raise ValueError("a scan entry has no body, session or seq")
    mapper.add(entry.robot, decode_scan(entry.body, entry.session, entry.seq))

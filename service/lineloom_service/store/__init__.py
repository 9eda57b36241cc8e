"""The scan log: what was accepted, in which order it is mapped, and mapper snapshots."""

from lineloom_service.store.protocol import CommitListener, Store
from lineloom_service.store.records import (
    Appended,
    BacklogFullError,
    EntryKind,
    LogEntry,
    NewScan,
    RobotRecord,
    SiteRecord,
    Skip,
    SnapshotRecord,
    StoreError,
)
from lineloom_service.store.sqlite_store import SqliteStore

__all__ = [
    "Appended",
    "BacklogFullError",
    "CommitListener",
    "EntryKind",
    "LogEntry",
    "NewScan",
    "RobotRecord",
    "SiteRecord",
    "Skip",
    "SnapshotRecord",
    "SqliteStore",
    "Store",
    "StoreError",
]

"""What can be read of a recording that was cut short or has no index: a power cut, a full disk.

`rosbags` reads bags by their index, which stands at the end. Here the records are walked through
from the beginning, up to where they end or make no sense any more.
"""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
from collections.abc import Collection, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from lineloom_core.io.json_messages import from_json

_TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_MOST_MISSING = 20
"""A file that says that it is so many times as long as it is, is none."""

_MOST_GAPS = 10_000
"""Rows in a row that are missing before a table counts as read to its end."""


@dataclass(frozen=True, slots=True)
class Channel:
    """A topic. encoding: "cdr", "ros1" or "json"."""

    id: int
    topic: str
    msgtype: str
    encoding: str


@dataclass
class Salvaged:
    """The messages that could be read: channel, time of recording [ns], content. lost: the rest.

    Stands in for the reader of `rosbags`.
    """

    connections: list[Channel] = field(default_factory=list)
    read: list[tuple[Channel, int, bytes]] = field(default_factory=list)
    lost: str = ""

    def messages(self, connections: Collection[Channel]) -> Iterator[tuple[Channel, int, bytes]]:
        """Yield the messages of some channels, in the order in which they were recorded."""
        wanted = {channel.id for channel in connections}
        found = [message for message in self.read if message[0].id in wanted]
        yield from sorted(found, key=lambda message: message[1])

    def cut(self, size: int, missing: int) -> None:
        """Say that the file ends too soon. size: its own; missing: of its last chunk [bytes]."""
        mean = sum(len(raw) for _, _, raw in self.read) / max(len(self.read), 1)
        lost = max(1, round(missing / mean)) if mean else 1
        self.lost = (
            f"it was cut at byte {size}: about {lost} messages of the last chunk, and whatever was "
            "recorded after"
        )

    def deserialize(self, raw: bytes, msgtype: str) -> object:
        """Return a message, as ROS defines its type or JSON has it."""
        encoding = next((c.encoding for c in self.connections if c.msgtype == msgtype), "cdr")
        if encoding == "json":
            return from_json(raw)
        if encoding == "ros1":
            return _types(ros1=True).deserialize_ros1(raw, msgtype)
        return _types(ros1=False).deserialize_cdr(raw, msgtype)


def normal(msgtype: str) -> str:
    """Return a type's name as ROS 2 spells it."""
    package, _, name = msgtype.rpartition("/")
    return f"{package.partition('/')[0]}/msg/{name}" if package else name


def salvage_sqlite(path: Path) -> Salvaged:
    """Read a bag of SQLite row by row, passing over those that are damaged or gone.

    Raises sqlite3.Error where not even its topics can be read, ValueError where it is none.
    """
    with tempfile.TemporaryDirectory(prefix="lineloom-salvage-") as folder:
        copies = []
        for filler in (b"\0", b"\xff"):
            copy = Path(folder) / f"{filler.hex()}.db3"
            missing = _whole_copy(path, copy, filler)
            with closing(sqlite3.connect(copy)) as base:
                copies.append(_rows(base))
    (found, gone), (other, _) = copies
    # A row that goes on on a missing page is what that page was filled with.
    sound = set(other.read)
    kept = [message for message in found.read if message in sound]
    gone += len(found.read) - len(kept)
    found.read = kept
    if gone or missing:
        found.lost = (
            f"the file was cut or is damaged: {missing} bytes, and so {gone} messages or more"
        )
    return found


def _whole_copy(path: Path, copy: Path, filler: bytes) -> int:
    """Copy a file of SQLite; where it ends too soon, a filler follows. Return how many bytes.

    SQLite opens no file that is shorter than it says of itself. Raises ValueError.
    """
    with path.open("rb") as file:
        head = file.read(100)
    page = int.from_bytes(head[16:18], "big")
    page = 65536 if page == 1 else page
    there, told = path.stat().st_size, page * int.from_bytes(head[28:32], "big")
    if not head.startswith(b"SQLite format 3\0") or told > _MOST_MISSING * there:
        raise ValueError("it does not begin as a file of SQLite does")
    shutil.copyfile(path, copy)
    with copy.open("ab") as file:
        for at in range(there, told, page):
            file.write(filler * min(page, told - at))
    return max(0, told - there)


def _rows(base: sqlite3.Connection) -> tuple[Salvaged, int]:
    """Return what the tables hold, and how many rows could not be read."""
    found = Salvaged()
    for number, topic, msgtype in base.execute("SELECT id, name, type FROM topics"):
        found.connections.append(Channel(number, topic, normal(msgtype), "cdr"))
    channels = {channel.id: channel for channel in found.connections}
    gone = in_a_row = 0
    row = 1
    while in_a_row < _MOST_GAPS:
        try:
            query = "SELECT topic_id, timestamp, data FROM messages WHERE id = ?"
            message = base.execute(query, (row,)).fetchone()
        except sqlite3.DatabaseError:
            message, gone = None, gone + 1
        row, in_a_row = row + 1, in_a_row + 1
        if message is not None and message[0] in channels:
            found.read.append((channels[message[0]], message[1], message[2]))
            in_a_row = 0
    return found, gone


_STORES: dict[bool, Typestore] = {}


def _types(*, ros1: bool) -> Typestore:
    if ros1 not in _STORES:
        store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        if ros1:
            for name in _TRANSFORMS:
                definition = "geometry_msgs/TransformStamped[] transforms"
                store.register(get_types_from_msg(definition, name))
        _STORES[ros1] = store
    return _STORES[ros1]

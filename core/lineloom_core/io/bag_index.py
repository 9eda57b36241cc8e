"""ROS 1 bags by writers of their own, whose index records are not as the format has them.

The chunks tell what is there. Such bags also cut definitions of messages short: those that ROS has
are taken from it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Reader
from rosbags.rosbag1.reader import Header, IndexData, RecordType
from rosbags.typesys import Stores, get_typestore


@contextmanager
def opened(path: Path) -> Iterator[AnyReader]:
    """Open a bag of any kind. Raises AnyReaderError, OSError."""
    reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
    try:
        reader.open()
    except AssertionError:
        # rosbags asserts what it takes an index record to be; some writers have their own.
        reader.readers = [_ChunkReader(path)]
        reader.open()
    try:
        yield reader
    finally:
        reader.close()


class _ChunkReader(Reader):
    """Makes the index anew from a walk through all chunks."""

    def open(self) -> None:
        """Open the bag, its messages defined as ROS defines them."""
        super().open()
        known = get_typestore(Stores.ROS1_NOETIC)
        self.connections = [
            c._replace(msgdef=c.msgdef._replace(data=known.generate_msgdef(c.msgtype)[0]))
            if c.msgtype in known.fielddefs
            else c
            for c in self.connections
        ]

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        """Index the chunk at `pos`; there is a call for each connection in it, the first does."""
        if any(entry.chunk_pos == pos for found in indexes.values() for entry in found[-1:]):
            return
        assert self.bio is not None
        chunk = self.chunks[pos]
        self.bio.seek(chunk.datapos)
        content = chunk.decompressor(self.bio.read(chunk.datasize))
        records = BytesIO(content)
        while (offset := records.tell()) < len(content):
            header = Header.read(records)
            (size,) = struct.unpack("<L", records.read(4))
            records.seek(size, 1)
            if header.get_uint8("op") == RecordType.MSGDATA:
                entry = IndexData(header.get_time("time"), pos, offset)
                indexes[header.get_uint32("conn")].append(entry)

"""The service's nav2 map as the fields of nav_msgs/OccupancyGrid."""

from __future__ import annotations

import io
import re
import zipfile
from array import array
from dataclasses import dataclass

_UNKNOWN = 255  # -1 as an unsigned byte
_HEADER = re.compile(rb"P5\s+(?:#[^\n]*\n\s*)*(\d+)\s+(\d+)\s+255\s", re.DOTALL)


class GridError(ValueError):
    """What came is no nav2 map."""


@dataclass(frozen=True)
class Grid:
    """x, y: of the lower left corner in the map frame [m]. data: by rows from the lowest, 0 free,
    100 occupied, -1 unknown."""

    width: int
    height: int
    resolution: float
    x: float
    y: float
    data: array[int]


def read_grid(content: bytes) -> Grid:
    """Return the grid of a zip of map.pgm and map.yaml. Raises GridError."""
    try:
        archive = zipfile.ZipFile(io.BytesIO(content))
        about, picture = archive.read("map.yaml").decode(), archive.read("map.pgm")
    except (zipfile.BadZipFile, KeyError, UnicodeDecodeError) as error:
        raise GridError(f"not a zip of map.pgm and map.yaml: {error}") from None
    header = _HEADER.match(picture)
    resolution = re.search(r"^resolution: (\S+)$", about, re.MULTILINE)
    origin = re.search(r"^origin: \[(\S+), (\S+), (\S+)\]$", about, re.MULTILINE)
    if header is None or resolution is None or origin is None:
        raise GridError("map.pgm or map.yaml is not as the service writes it")
    width, height = int(header[1]), int(header[2])
    grey = picture[header.end() :]
    if len(grey) != width * height:
        raise GridError(f"map.pgm has {len(grey)} cells instead of {width} x {height}")
    values = grey.translate(_TABLE)
    rows = (values[i * width : (i + 1) * width] for i in reversed(range(height)))
    data = array("b")
    data.frombytes(b"".join(rows))
    x, y = float(origin[1]), float(origin[2])
    return Grid(width, height, float(resolution[1]), x, y, data)


_TABLE = bytes({254: 0, 0: 100}.get(grey, _UNKNOWN) for grey in range(256))

"""An occupancy grid as nav2's map server reads it: a zip of `map.pgm` and `map.yaml`.

The picture's first row is the top of the map; `origin` is the pose of its lower left corner in
the map's frame, its yaw always 0 (several readers ignore any other). Cell values are those of
nav2's own map saver: 254 free, 0 occupied, 205 unknown; with its thresholds of old, under which
205 is unknown also to readers that compare the grey value alone.
"""

from __future__ import annotations

import io
import zipfile

import numpy as np

from lineloom_core.fusion.occupancy import FREE, OCCUPIED, OccupancyGrid

_GREY_FREE, _GREY_OCCUPIED, _GREY_UNKNOWN = 254, 0, 205
_SAME_TIME = (1980, 1, 1, 0, 0, 0)  # the same map gives the same bytes


def write_pgm(grid: OccupancyGrid) -> bytes:
    """Return the grid as a binary PGM (P5), top row first."""
    grey = np.full(grid.cells.shape, _GREY_UNKNOWN, dtype=np.uint8)
    grey[grid.cells == FREE] = _GREY_FREE
    grey[grid.cells == OCCUPIED] = _GREY_OCCUPIED
    rows, columns = grid.cells.shape
    header = f"P5\n# {grid.resolution:.6g} m/pix\n{columns} {rows}\n255\n"
    return header.encode() + np.ascontiguousarray(grey[::-1]).tobytes()


def write_yaml(grid: OccupancyGrid, image: str = "map.pgm") -> str:
    """Return the description that lies beside the picture."""
    return (
        f"image: {image}\n"
        "mode: trinary\n"
        f"resolution: {grid.resolution!r}\n"
        f"origin: [{grid.x:.9g}, {grid.y:.9g}, 0.0]\n"
        "negate: 0\n"
        "occupied_thresh: 0.65\n"
        "free_thresh: 0.196\n"
    )


def write_map(grid: OccupancyGrid) -> bytes:
    """Return both files in one zip."""
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in (("map.pgm", write_pgm(grid)), ("map.yaml", write_yaml(grid))):
            entry = zipfile.ZipInfo(name, _SAME_TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content)
    return target.getvalue()

"""Exports: files of a map that never change."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from lineloom.wire.base import Answer, Number, Request, Settled
from lineloom.wire.map_format import MapFormat

MapFrame = Literal["map", "plan"]


class ExportRequest(Request):
    """What to export.

    component: only this one; nav2 takes exactly one. bbox: x_min, y_min, x_max, y_max [m]. align:
    turned so that walls run along the axes. frame: "plan" for the floor plan's coordinates.
    resolution [m]: of nav2's cells.
    """

    format: MapFormat
    component: str | None = None
    bbox: Annotated[list[Number], Field(min_length=4, max_length=4)] | None = None
    align: bool = False
    frame: MapFrame = "map"
    resolution: Annotated[Number, Field(gt=0.0, le=10.0)] | None = None


class MapDownload(Answer):
    """The parameters of VDA 5050's instant action `downloadMap`, as that spells them."""

    mapId: str
    mapVersion: str
    mapDownloadLink: str
    mapHash: str


class Export(Answer):
    """A file that stays as it is, at `url`, until it is deleted.

    version: of the site that it shows. created: seconds since 1970. sha256: of the bytes, in
    lower-case hexadecimal digits. map: what a fleet manager passes on to a vehicle.
    """

    id: str
    site: str
    version: int
    settled: Settled = False
    format: MapFormat
    component: str | None
    media_type: str
    size: int
    sha256: str
    created: float
    url: str
    map: MapDownload


class ExportList(Answer):
    """The exports of a site, oldest first."""

    site: str
    exports: list[Export]

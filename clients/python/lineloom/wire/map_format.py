"""Which files a map can be had as: the one table of service, client, command line and viewer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import AfterValidator, WithJsonSchema

from lineloom.wire.base import Answer


class MapFileKind(Answer):
    """What a format's files are: for people (`title`), for HTTP, and by their names' ending."""

    title: str
    media_type: str
    suffix: str
    binary: bool = False


MAP_FORMATS: Mapping[str, MapFileKind] = {
    "json": MapFileKind(title="JSON", media_type="application/json", suffix="json"),
    "geojson": MapFileKind(title="GeoJSON", media_type="application/geo+json", suffix="geojson"),
    "svg": MapFileKind(title="SVG", media_type="image/svg+xml", suffix="svg"),
    "png": MapFileKind(title="PNG", media_type="image/png", suffix="png", binary=True),
    "dxf": MapFileKind(title="DXF", media_type="image/vnd.dxf", suffix="dxf"),
    "csv": MapFileKind(title="CSV", media_type="text/csv", suffix="csv"),
    "ieee1873": MapFileKind(title="IEEE 1873", media_type="application/xml", suffix="xml"),
    "nav2": MapFileKind(title="nav2", media_type="application/zip", suffix="zip", binary=True),
}
"""By name. `core/docs/formats.md` tells of each; `lineloom_core.io` has a module for each."""


def _known(name: str) -> str:
    if name not in MAP_FORMATS:
        raise ValueError(f"no format {name!r}; available are {', '.join(MAP_FORMATS)}")
    return name


MapFormat = Annotated[
    str, AfterValidator(_known), WithJsonSchema({"type": "string", "enum": list(MAP_FORMATS)})
]
"""The name of a format."""


class MapFormatList(Answer):
    """What the service writes, by name."""

    formats: dict[str, MapFileKind]

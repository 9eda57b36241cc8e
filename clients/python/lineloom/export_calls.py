"""Calls about files of a map: exports that never change, and the building's floor plan."""

from __future__ import annotations

from lineloom.calls import (
    Call,
    MapOptions,
    Name,
    read_bytes,
    read_model,
    read_nothing,
    site_path,
    url_name,
)
from lineloom.wire import (
    JSON,
    Export,
    ExportList,
    ExportRequest,
    FloorPlanAnswer,
    MapFormat,
    PlanDifferences,
)


def post_export(site: Name, format: MapFormat, options: MapOptions) -> Call[Export]:
    """POST an export."""
    request = ExportRequest(
        format=format,
        component=options.component,
        bbox=None if options.bbox is None else list(options.bbox),
        align=options.align,
        frame=options.frame,
        resolution=options.resolution,
    )
    return Call(
        "POST",
        f"{site_path(site)}/exports",
        read_model(Export),
        headers={"Content-Type": JSON},
        content=request.model_dump_json().encode(),
    )


def exports(site: Name) -> Call[ExportList]:
    """GET the exports of a site."""
    return Call("GET", f"{site_path(site)}/exports", read_model(ExportList))


def export_file(site: Name, export: str) -> Call[bytes]:
    """GET an export's bytes."""
    return Call("GET", f"{site_path(site)}/exports/{url_name(export)}", read_bytes)


def delete_export(site: Name, export: str) -> Call[None]:
    """DELETE an export."""
    return Call("DELETE", f"{site_path(site)}/exports/{url_name(export)}", read_nothing)


def put_floorplan(site: Name, content: bytes, media_type: str) -> Call[FloorPlanAnswer]:
    """PUT a floor plan."""
    return Call(
        "PUT",
        f"{site_path(site)}/floorplan",
        read_model(FloorPlanAnswer),
        headers={"Content-Type": media_type},
        content=content,
    )


def floorplan(site: Name) -> Call[FloorPlanAnswer]:
    """GET where the map lies in the floor plan."""
    return Call("GET", f"{site_path(site)}/floorplan", read_model(FloorPlanAnswer))


def delete_floorplan(site: Name) -> Call[None]:
    """DELETE the floor plan."""
    return Call("DELETE", f"{site_path(site)}/floorplan", read_nothing)


def floorplan_differences(site: Name, component: str | None) -> Call[PlanDifferences]:
    """GET what differs between plan and map."""
    path, params = _differences(site, component, "json")
    return Call("GET", path, read_model(PlanDifferences), params=params)


def floorplan_drawing(site: Name, component: str | None, format: str) -> Call[bytes]:
    """GET the differences as a picture."""
    path, params = _differences(site, component, format)
    return Call("GET", path, read_bytes, params=params)


def _differences(site: Name, component: str | None, format: str) -> tuple[str, dict[str, str]]:
    params = {"format": format} | ({} if component is None else {"component": component})
    return f"{site_path(site)}/floorplan/differences", params

"""Files of a map that never change, for those who have to be sure which map they use."""

from __future__ import annotations

import base64
import hashlib
import json
import time

from fastapi import APIRouter, Request, Response
from lineloom import wire
from lineloom_core.io.selection import check_bbox
from lineloom_core.mapping.answers.site_view import SiteView
from pydantic import ValidationError
from starlette.datastructures import URL

from lineloom_service.answers import answer, matches
from lineloom_service.asking import settled_view
from lineloom_service.dependencies import CurrentView, KnownSite, ServiceDep
from lineloom_service.errors import (
    INVALID_PARAMETER,
    UNKNOWN_COMPONENT,
    UNKNOWN_EXPORT,
    ProblemError,
    field_errors,
    invalid_body,
)
from lineloom_service.map_files import render_map
from lineloom_service.map_frames import in_frame
from lineloom_service.openapi import also_as, body_of
from lineloom_service.request_body import read_body
from lineloom_service.service import Service
from lineloom_service.store.actions import remove_file
from lineloom_service.store.files import FileRecord, list_files, put_file, read_file
from lineloom_service.store.records import SiteRecord

router = APIRouter(tags=["exports"])

_FOREVER = "max-age=31536000, immutable"


@router.post(
    "/v1/sites/{site}/exports",
    status_code=201,
    response_model=wire.Export,
    openapi_extra=body_of("ExportRequest"),
)
async def post_export(
    site: KnownSite, view: CurrentView, request: Request, service: ServiceDep
) -> Response:
    """Write the map as it is now into a file that stays: kept on disk, at an address of its own.

    It is settled: where the site is busy, its optimum is worked out for this.

    The same map again is the same file. `map` holds the parameters of VDA 5050's `downloadMap`.
    """
    wanted = await _read_request(request, service)
    view = await settled_view(service, site, view)
    if wanted.component is not None and all(c.id != wanted.component for c in view.components):
        known = ", ".join(c.id for c in view.components) or "none"
        detail = f"no component {wanted.component!r}; there is: {known}"
        raise ProblemError(UNKNOWN_COMPONENT, detail)
    content = await _render(service, site, view, wanted)
    file = _file(view, wanted, content)
    kept = await service.store.read(read_file, site.id, "export", file.name)
    if kept is None:
        await service.store.write(put_file, site.id, "export", file)
    export = _export(request, site, kept or file)
    return answer(export, status=201, headers={"Location": export.url})


@router.get("/v1/sites/{site}/exports", response_model=wire.ExportList)
async def list_exports(site: KnownSite, request: Request, service: ServiceDep) -> Response:
    """Return the exports of a site, oldest first."""
    files = await service.store.read(list_files, site.id, "export")
    exports = [_export(request, site, file) for file in files]
    return answer(wire.ExportList(site=site.name, exports=exports))


@router.get(
    "/v1/sites/{site}/exports/{export}",
    name="get_export",
    response_class=Response,
    responses=also_as(*sorted({form.media_type for form in wire.MAP_FORMATS.values()})),
)
async def get_export(
    site: KnownSite, export: str, request: Request, service: ServiceDep
) -> Response:
    """Return an export's bytes; they never change."""
    file = await service.store.read(read_file, site.id, "export", export)
    if file is None or file.data is None:
        raise _unknown(site, export)
    etag = f'"{file.sha256}"'
    headers = {
        "ETag": etag,
        # What takes a token is not for a cache that answers whoever asks.
        "Cache-Control": f"{'private' if service.guard.protects else 'public'}, {_FOREVER}",
        # RFC 9530
        "Repr-Digest": f"sha-256=:{base64.b64encode(bytes.fromhex(file.sha256)).decode()}:",
        "Content-Disposition": f'attachment; filename="{_filename(site, file)}"',
    }
    if matches(request.headers.get("if-none-match"), etag):
        return Response(status_code=304, headers=headers)
    media_type = wire.MAP_FORMATS[json.loads(file.about)["format"]].media_type
    return Response(file.data, headers=headers, media_type=media_type)


@router.delete("/v1/sites/{site}/exports/{export}", status_code=204)
async def delete_export(site: KnownSite, export: str, service: ServiceDep) -> Response:
    """Remove an export that nobody uses any more."""
    if not await service.store.write(remove_file, site.id, "export", export):
        raise _unknown(site, export)
    return Response(status_code=204)


async def _read_request(request: Request, service: Service) -> wire.ExportRequest:
    body = await read_body(request, service.settings)
    try:
        return wire.ExportRequest.model_validate(body.value)
    except ValidationError as error:
        raise invalid_body(field_errors(error)) from None


async def _render(
    service: Service, site: SiteRecord, view: SiteView, wanted: wire.ExportRequest
) -> bytes:
    box = None
    if wanted.bbox is not None:
        box = (wanted.bbox[0], wanted.bbox[1], wanted.bbox[2], wanted.bbox[3])
        try:
            check_bbox(box)
        except ValueError as error:
            raise ProblemError(INVALID_PARAMETER, f"bbox: {error}") from None
    shown = await in_frame(
        service, site, view, align=wanted.align, frame=wanted.frame, component=wanted.component
    )
    return await render_map(
        service, site, shown, wanted.format, wanted.component, box, wanted.resolution
    )


def _file(view: SiteView, wanted: wire.ExportRequest, content: bytes) -> FileRecord:
    """Name a file after the map's version and its own content."""
    sha256 = hashlib.sha256(content).hexdigest()
    about = wanted.model_dump(mode="json") | {"version": view.version, "settled": view.settled}
    name = f"{wanted.format}-{view.version}-{sha256[:16]}"
    return FileRecord(name, json.dumps(about), sha256, len(content), time.time(), content)


def _export(request: Request, site: SiteRecord, file: FileRecord) -> wire.Export:
    about = json.loads(file.about)
    url = _address(request, request.url_for("get_export", site=site.name, export=file.name))
    component = about["component"]
    return wire.Export(
        id=file.name,
        site=site.name,
        version=about["version"],
        settled=about.get("settled", False),
        format=about["format"],
        component=component,
        media_type=wire.MAP_FORMATS[about["format"]].media_type,
        size=file.size,
        sha256=file.sha256,
        created=file.created,
        url=url,
        map=wire.MapDownload(
            mapId=site.name if component is None else f"{site.name}/{component}",
            mapVersion=f"{about['version']}-{file.sha256[:16]}",
            mapDownloadLink=url,
            mapHash=file.sha256,
        ),
    )


def _address(request: Request, url: URL) -> str:
    """Return where a file is, under a name that the service has: anybody may write any `Host`."""
    service: Service = request.app.state.service
    if service.settings.public_url is not None:
        return service.settings.public_url.rstrip("/") + url.path
    host, port = request.scope.get("server") or ("localhost", None)
    if service.hosts.knows(request.headers.get("host", ""), host):
        return str(url)
    return str(url.replace(hostname=host, port=port))


def _filename(site: SiteRecord, file: FileRecord) -> str:
    return f"{site.name}-{file.name}.{wire.MAP_FORMATS[json.loads(file.about)['format']].suffix}"


def _unknown(site: SiteRecord, export: str) -> ProblemError:
    return ProblemError(UNKNOWN_EXPORT, f"no export {export!r} in site {site.name!r}")

"""Taking scans."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from lineloom import wire

from lineloom_service.answers import answer
from lineloom_service.dependencies import RobotName, ServiceDep, SiteName
from lineloom_service.intake import conflicting, take_in
from lineloom_service.openapi import body_of
from lineloom_service.request_body import read_body
from lineloom_service.store.actions import append_scans

router = APIRouter(tags=["ingest"])


@router.post(
    "/v1/sites/{site}/robots/{robot}/scans",
    status_code=202,
    response_model=wire.IngestAnswer,
    openapi_extra=body_of("Scan", "ScanBatch"),
)
async def post_scans(
    site: SiteName, robot: RobotName, request: Request, service: ServiceDep
) -> Response:
    """Take one scan, or `{"scans": [...]}`. 202 means: on disk. Sending again is harmless."""
    settings = service.settings
    body = await read_body(request, settings)
    intake = await take_in(body, settings.max_batch)
    known = await service.store.site(site)
    appended = await service.store.write(
        append_scans,
        site,
        robot,
        intake.scans,
        processed=0 if known is None else service.conductor.processed(known.id),
        limit=settings.backlog_limit,
        robot_limit=settings.robot_backlog_limit,
    )
    await service.pacer.turn()  # all that shared the commit come back at once
    service.metrics.count_scans(site, appended.accepted, appended.duplicates)
    batch = isinstance(body.value, dict) and "scans" in body.value
    rejected = intake.rejected + [conflicting(c, batch=batch) for c in appended.conflicts]
    service.conflicts.note(appended.site_id, robot, appended.accepted, appended.conflicts)
    for refused in rejected:
        service.metrics.count_refused_scan(refused.reason.partition(":")[0].partition("/")[0])
    published = service.conductor.published(appended.site_id)
    return answer(
        wire.IngestAnswer(
            accepted=appended.accepted,
            duplicates=appended.duplicates,
            rejected=sorted(rejected, key=lambda refused: refused.index),
            pending=max(0, appended.position - published.position) + appended.held,
            suggested_rate_hz=None if known is None else service.loads.of(known).rate_hz,
        ),
        status=202,
    )

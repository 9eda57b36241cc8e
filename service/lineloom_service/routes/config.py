"""The mapper's parameters of a site."""

from __future__ import annotations

from dataclasses import replace

from fastapi import APIRouter, Request, Response
from lineloom import wire
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.parameters import Choice, Parameter, ParameterError, by_name, effective

from lineloom_service.answers import answer
from lineloom_service.convert import to_remaking
from lineloom_service.dependencies import KnownSite, ServiceDep, SiteName, known_site
from lineloom_service.errors import NEVER_REMADE, ProblemError, invalid_body, pointer
from lineloom_service.events.remade import LAST, from_file
from lineloom_service.openapi import body_of
from lineloom_service.request_body import read_body
from lineloom_service.service import Service
from lineloom_service.site_config import in_force, ordered
from lineloom_service.store.actions import configure
from lineloom_service.store.config_entry import ConfigEntry
from lineloom_service.store.files import read_file
from lineloom_service.store.records import SiteRecord

router = APIRouter(tags=["config"])

_NOTHING = "nothing: these are in force already"
_ANEW = (
    "the map is made anew from the first scan, beside the one that is shown, and then shown instead"
)
_FIRST = "they hold from the first scan on"


@router.get("/v1/sites/{site}/config", response_model=wire.SiteConfig)
async def get_config(site: KnownSite, service: ServiceDep) -> Response:
    """Return every parameter that a site's map is made with, with unit, meaning and default."""
    return answer(await _config(site, service))


@router.put(
    "/v1/sites/{site}/config", response_model=wire.SiteConfig, openapi_extra=body_of("ConfigChange")
)
async def put_config(name: SiteName, request: Request, service: ServiceDep) -> Response:
    """Set the site's own parameters, creating the site.

    The body names them nested, e.g. `{"join": {"least_set": 4}}`, and replaces what a PUT before
    named: others have the value of the service's `--mapper-config` file, else the default. Nothing
    is taken of a body with parameters that are unknown or cannot be so; all of them are named.
    """
    body = await read_body(request, service.settings)
    if not isinstance(body.value, dict):
        raise invalid_body([wire.FieldError(pointer="", reason="has to hold parameters by name")])
    try:
        order = ordered(body.value, service.settings.mapper)
    except ParameterError as error:
        raise invalid_body(
            [
                wire.FieldError(pointer=pointer(*name.split(".")), reason=reason)
                for name, reason in error.wrong.items()
            ]
        ) from None
    before = await service.store.site(name)
    was = _now(before, service.settings.mapper)
    if before is None or before.config is not None or order != was:
        await service.store.write(configure, name, order, make=True)
    after = await known_site(name, service)
    effect = _NOTHING if order.digest == was.digest else _ANEW if after.accepted else _FIRST
    config = await _config(after, service)
    return answer(config.model_copy(update={"effect": effect}))


@router.get("/v1/sites/{site}/config/difference", response_model=wire.RemadeEvent)
async def get_difference(site: KnownSite, service: ServiceDep) -> Response:
    """Return what changed when the map was last made anew: as its `remade` event told it."""
    file = await service.store.read(read_file, site.id, "remade", LAST)
    if file is None:
        raise ProblemError(NEVER_REMADE, f"the map of site {site.name!r} is the first one")
    return answer(from_file(file))


def _now(site: SiteRecord | None, base: MapperConfig) -> ConfigEntry:
    if site is None or site.config is None:
        return ordered({}, base)
    return replace(site.config, position=0, since=0)


async def _config(site: SiteRecord, service: Service) -> wire.SiteConfig:
    entry = site.config
    config = in_force(site, service.settings.mapper)
    return wire.SiteConfig(
        site=site.name,
        parameters={name: _value(p) for name, p in by_name(effective(config))},
        own={} if entry is None else dict(entry.own),
        position=None if entry is None else entry.position,
        digest=ordered({}, config).digest if entry is None else entry.digest,
        remaking=to_remaking(await service.conductor.remaking_anywhere(site)),
    )


def _value(p: Parameter | Choice) -> wire.ParameterValue:
    if isinstance(p, Choice):
        return wire.ParameterValue(
            value=p.value, default=p.default, unit="", meaning=p.meaning,
            least=None, most=None, choices=list(p.choices),
        )  # fmt: skip
    return wire.ParameterValue(
        value=p.value, default=p.default, unit=p.unit, meaning=p.meaning, least=p.least, most=p.most
    )

"""What FastAPI cannot see by itself: bodies that the routes read, and how errors are told."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from lineloom import wire
from pydantic.json_schema import models_json_schema

from lineloom_service.security.scopes import scope_of

_SCHEMAS = "#/components/schemas/"
_MODELS = (
    wire.Scan,
    wire.ScanBatch,
    wire.RobotSettings,
    wire.ConfigChange,
    wire.MatchRequest,
    wire.ExportRequest,
    wire.JoinRequest,
    wire.MatchScan,
    wire.LocalizeRequest,
    wire.Problem,
    wire.Event,
)
_OPEN = ("/healthz", "/readyz")
_DESCRIPTION = """\
Scans of 2D lidars in, one merged line map out, no poses needed.

SI units and radians; frames after REP-103 and REP-105; scans after `sensor_msgs/LaserScan`.
Errors are RFC 9457 problem details with a stable `type`.
"""

PROBLEM_ANSWER: dict[int | str, dict[str, Any]] = {
    "default": {
        "description": "What is wrong (RFC 9457).",
        "content": {"application/problem+json": {"schema": {"$ref": f"{_SCHEMAS}Problem"}}},
    },
    422: {
        "description": "Malformed; `errors` points at what.",
        "content": {"application/problem+json": {"schema": {"$ref": f"{_SCHEMAS}Problem"}}},
    },
}


NOT_MODIFIED: dict[int | str, dict[str, Any]] = {
    304: {"description": "The copy that If-None-Match names is current."},
}


def body_of(*models: str) -> dict[str, Any]:
    """Return the description of a body that is one of these models."""
    references = [{"$ref": _SCHEMAS + model} for model in models]
    schema = references[0] if len(references) == 1 else {"anyOf": references}
    content = {kind: {"schema": schema} for kind in (wire.JSON, wire.MSGPACK)}
    return {"requestBody": {"required": True, "content": content}}


def also_as(*media_types: str) -> dict[int | str, dict[str, Any]]:
    """Return the description of further formats of an answer."""
    return {200: {"content": {media_type: {} for media_type in media_types}}}


def events_of(model: str) -> dict[int | str, dict[str, Any]]:
    """Return the description of a stream whose events' `data` is this model."""
    data = {
        "type": "string",
        "contentMediaType": "application/json",
        "contentSchema": {"$ref": _SCHEMAS + model},
    }
    schema = {
        "type": "object",
        "properties": {"event": {"type": "string"}, "id": {"type": "string"}, "data": data},
    }
    description = f"Server-Sent Events; the `data` of each is JSON, see `{model}`."
    return {200: {"description": description, "content": {"text/event-stream": {"schema": schema}}}}


def install(app: FastAPI) -> None:
    """Have the app describe itself completely."""

    def describe() -> dict[str, Any]:
        if app.openapi_schema is None:
            document = get_openapi(
                title=app.title,
                version=app.version,
                description=_DESCRIPTION,
                routes=app.routes,
            )
            _, extra = models_json_schema(
                [(model, "validation") for model in _MODELS], ref_template=_SCHEMAS + "{model}"
            )
            schemas = document.setdefault("components", {}).setdefault("schemas", {})
            schemas.update(extra["$defs"])
            _describe_tokens(document)
            app.openapi_schema = document
        return app.openapi_schema

    app.openapi = describe  # type: ignore[method-assign]  # FastAPI's documented way


def _describe_tokens(document: dict[str, Any]) -> None:
    """Say which scope each call takes. Optional: where there are no tokens, none is needed."""
    document["components"]["securitySchemes"] = {
        "token": {
            "type": "http",
            "scheme": "bearer",
            "description": "From `lineloom token create`.",
        }
    }
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            if path in _OPEN:
                continue
            operation["security"] = [{"token": []}, {}]
            told = f"Token scope: `{scope_of(method.upper(), path)}`."
            operation["description"] = f"{operation.get('description', '')}\n\n{told}".lstrip()

"""`/docs`: every call, to be read and tried. Swagger UI, from this service and nowhere else."""

from __future__ import annotations

from importlib.resources import files

from fastapi import APIRouter, FastAPI, Response
from fastapi.responses import HTMLResponse
from fastapi.staticfiles import StaticFiles

router = APIRouter(include_in_schema=False)

_FILES = "/docs/files"
_PAGE = f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>Lineloom: the HTTP API</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="stylesheet" href="{_FILES}/swagger-ui.css">
<link rel="icon" href="data:,">
</head>
<body>
<div id="swagger-ui"></div>
<script src="{_FILES}/swagger-ui-bundle.js"></script>
<script src="/docs/start.js"></script>
</body>
</html>
"""
# No script within the page: the Content-Security-Policy does not let it run.
_START = """\
SwaggerUIBundle({
  url: "/openapi.json",
  dom_id: "#swagger-ui",
  deepLinking: true,
  presets: [SwaggerUIBundle.presets.apis],
});
"""


def mount(app: FastAPI) -> None:
    """Serve Swagger UI's own files."""
    directory = str(files("fastapi_offline") / "static")
    app.mount(_FILES, StaticFiles(directory=directory), name="docs-files")


@router.get("/docs")
async def get_docs() -> Response:
    """Return the page."""
    return HTMLResponse(_PAGE)


@router.get("/docs/start.js")
async def get_start() -> Response:
    """Return what starts Swagger UI."""
    return Response(_START, media_type="text/javascript")

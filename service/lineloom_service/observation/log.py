"""The log: a line of JSON for every record, with the request, site and robot that it is about."""

from __future__ import annotations

import contextvars
import logging
import os
import sys
from typing import Literal

from pythonjsonlogger.json import JsonFormatter

LogFormat = Literal["json", "text"]

_CONTEXT: contextvars.ContextVar[dict[str, str] | None] = contextvars.ContextVar(
    "lineloom_log_context", default=None
)
_TEXT = "%(asctime)s %(levelname)s %(name)s: %(message)s%(about)s"


def bind(**fields: str | None) -> None:
    """Have these fields in every record of the current task from now on."""
    known = {name: value for name, value in fields.items() if value is not None}
    _CONTEXT.set({**(_CONTEXT.get() or {}), **known})


def configure(level: str, form: LogFormat) -> None:
    """Log to stderr."""
    handler = logging.StreamHandler(sys.stderr)
    handler.addFilter(_add_context)
    if form == "json":
        handler.setFormatter(
            JsonFormatter(
                ["levelname", "name", "message"],
                timestamp="time",
                rename_fields={"levelname": "level", "name": "logger"},
                # The whole context is spread over fields of its own.
                reserved_attrs=[*_RESERVED, "about"],
            )
        )
    else:
        handler.setFormatter(logging.Formatter(_TEXT))
    os.environ["LINELOOM_LOG_LEVEL"], os.environ["LINELOOM_LOG_FORMAT"] = level, form
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(level.upper())
    # Requests are logged by `requests`, with more to them.
    for noisy in ("alembic", "uvicorn.access"):
        logging.getLogger(noisy).setLevel(logging.WARNING)


def configure_from_environment() -> None:
    """Log as the process does that started this one."""
    form = os.environ.get("LINELOOM_LOG_FORMAT", "json")
    configure(os.environ.get("LINELOOM_LOG_LEVEL", "info"), "text" if form == "text" else "json")


def _add_context(record: logging.LogRecord) -> bool:
    context = _CONTEXT.get() or {}
    for name, value in context.items():
        record.__dict__.setdefault(name, value)
    about = ", ".join(f"{name} {value}" for name, value in context.items())
    record.about = f" ({about})" if about else ""
    return True


_RESERVED = (*logging.makeLogRecord({}).__dict__, "color_message", "taskName")

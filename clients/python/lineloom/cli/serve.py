"""`lineloom serve`: the service in this process."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from lineloom.cli.failure import CommandError

Host = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Address to listen on; 127.0.0.1.")
]
Port = Annotated[
    int | None, typer.Option(min=0, max=65535, metavar="PORT", help="Port to listen on; 8765.")
]
DataDir = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Where everything is kept; ./lineloom-data."),
]
DatabaseUrl = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        help="PostgreSQL instead of a file: postgresql+asyncpg://user:password@host/database.",
    ),
]
Engine = Annotated[
    str | None,
    typer.Option(
        metavar="standby|require|off",
        help="Where another process on the same database maps: wait for its end, refuse to "
        "start, or never map; standby.",
    ),
]
Workers = Annotated[
    int | None,
    typer.Option(min=1, max=64, metavar="N", help="Mapping processes; all cores but one."),
]
MapperConfig = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="The mapper's parameters, TOML; those of a site go first."),
]
Open = Annotated[
    bool | None,
    typer.Option("--open", help="Listen beyond this machine although there are no tokens."),
]
SslCertfile = Annotated[
    Path | None, typer.Option(metavar="FILE", help="TLS certificate chain, PEM.")
]
SslKeyfile = Annotated[
    Path | None, typer.Option(metavar="FILE", help="The certificate's private key, PEM.")
]
AllowOrigins = Annotated[
    str | None,
    typer.Option(
        metavar="ORIGIN,…",
        help="Origins whose pages may call the service, e.g. https://maps.example; none.",
    ),
]
LogLevel = Annotated[
    str | None,
    typer.Option(metavar="LEVEL", help="debug, info, warning or error; info."),
]
LogFormat = Annotated[
    str | None,
    typer.Option(metavar="FORMAT", help="json, a line an object, or text, for people; json."),
]


def serve(
    host: Host = None,
    port: Port = None,
    data_dir: DataDir = None,
    database_url: DatabaseUrl = None,
    engine: Engine = None,
    workers: Workers = None,
    mapper_config: MapperConfig = None,
    open_: Open = None,
    ssl_certfile: SslCertfile = None,
    ssl_keyfile: SslKeyfile = None,
    allow_origins: AllowOrigins = None,
    log_level: LogLevel = None,
    log_format: LogFormat = None,
) -> None:
    """Run the service: takes scans over HTTP, keeps them on disk, maps them.

    Stop it with Ctrl-C or SIGTERM; the next start goes on where it stopped. Every setting may
    also come from the environment, e.g. LINELOOM_PORT; options go first.

    \b
    Example:
      lineloom serve --port 8765 --data-dir /var/lib/lineloom
    """
    try:
        from lineloom_service.server import run
        from lineloom_service.settings import Settings
    except ImportError as error:
        missing = (error.name or "").split(".")[0]
        raise CommandError(
            f"the service is not installed here ({missing or error} is missing): "
            "`pip install lineloom-client[server]`"
        ) from None
    except ValueError as error:  # kernels are set up as they are imported
        raise CommandError(f"settings: {error}") from None
    given: dict[str, Any] = {
        "host": host,
        "port": port,
        "data_dir": data_dir,
        "database_url": database_url,
        "engine": engine,
        "workers": workers,
        "mapper_config": mapper_config,
        "open": open_,
        "ssl_certfile": ssl_certfile,
        "ssl_keyfile": ssl_keyfile,
        "allow_origins": allow_origins,
        "log_level": log_level,
        "log_format": log_format,
    }
    try:
        settings = Settings(**{name: value for name, value in given.items() if value is not None})
    except ValueError as error:
        raise CommandError(f"settings: {error}") from None
    run(settings)

"""Settings: from arguments, else from the environment (`LINELOOM_*`), else these defaults."""

from __future__ import annotations

import os
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, Self

from lineloom.wire import MAX_BATCH, MAX_BODY_BYTES
from pydantic import Field, field_validator, model_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

if TYPE_CHECKING:
    from lineloom_core.mapping.config import MapperConfig


def _default_workers() -> int:
    # One core stays with the API process; on two cores one worker maps and one process answers.
    return max(1, (os.cpu_count() or 2) - 1)


class Settings(BaseSettings):
    """How one service runs. Times in seconds, sizes in bytes."""

    model_config = SettingsConfigDict(env_prefix="LINELOOM_", extra="ignore", frozen=True)

    data_dir: Path = Field(default=Path("lineloom-data"), description="Where everything is kept.")
    database_url: str | None = Field(
        default=None,
        pattern=r"^postgresql\+asyncpg://",
        description="PostgreSQL instead of a file in the data directory.",
    )
    host: str = "127.0.0.1"
    port: int = Field(default=8765, ge=0, le=65535)
    open: bool = Field(
        default=False, description="Listen beyond loopback although no tokens protect the service."
    )
    ssl_certfile: Path | None = Field(default=None, description="TLS certificate chain, PEM.")
    ssl_keyfile: Path | None = Field(default=None, description="Its private key, PEM.")
    allow_origins: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(), description="Origins whose pages may call the service, comma-separated."
    )
    public_url: str | None = Field(
        default=None,
        pattern=r"^https?://[^/?#]+(/[^?#]*)?$",
        description="Where clients reach the service: how links to exports begin.",
    )
    allow_hosts: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(), description="Names of the service beside this machine's, comma-separated."
    )
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    log_format: Literal["json", "text"] = "json"

    kernels: Literal["auto", "native", "generic"] = Field(
        default="auto",
        description="For this processor or for any of its kind; from the environment only.",
    )
    kernel_cache: Path | None = Field(
        default=None, description="Where compiled kernels are kept; from the environment only."
    )

    engine: Literal["standby", "require", "off"] = Field(
        default="standby",
        description="Where another process on the same database maps: wait for its end, refuse to "
        "start, or never map at all.",
    )
    mapper_config: Path | None = Field(
        default=None, description="Parameters of the mapper, TOML; of sites that name none."
    )
    workers: int = Field(default_factory=_default_workers, ge=1, le=64)
    max_body_bytes: int = Field(default=MAX_BODY_BYTES, ge=1024)
    max_bodies_bytes: int = Field(
        default=8 * MAX_BODY_BYTES,
        ge=2048,
        description="Of all bodies that are being read at a time, compressed and plain together.",
    )
    max_batch: int = Field(default=MAX_BATCH, ge=1, le=MAX_BATCH)
    backlog_limit: int = Field(
        default=20_000, ge=1, description="Log entries of a site waiting to be mapped before 429."
    )

    robot_backlog_limit: int = Field(
        default=10_000, ge=1, description="Of these, those that one robot may have."
    )
    group_limit: int = Field(
        default=256, ge=1, description="Requests that may share a commit to the disk."
    )
    token_rate: float = Field(
        default=1_000.0,
        gt=0.0,
        description="Requests a second of one token; more are answered 429.",
    )
    token_requests: int = Field(
        default=256, ge=1, description="Of one token at a time, streams of events aside."
    )
    token_streams: int = Field(
        default=64, ge=1, description="Listeners to events of one token at a time."
    )
    silent_after_s: float = Field(
        default=60.0, gt=0.0, description="A robot that sends no scan for this long is `silent`."
    )
    gap_window_s: float = Field(
        default=2.0, ge=0.0, description="How long a scan waits for those before it."
    )
    back_fill_after_s: float = Field(
        default=3.0,
        ge=0.0,
        description="Scans that came after their successors are mapped at their places once no "
        "more of them came for this long.",
    )
    max_held: int = Field(
        default=5_000, ge=1, description="Scans of one session that may wait for a gap to fill."
    )

    entry_timeout_s: float = Field(
        default=900.0,
        gt=0.0,
        description="A worker that is at one log entry for longer is ended; see the README.",
    )
    chunk: int = Field(default=64, ge=1, description="Log entries sent to a worker at a time.")
    publish_every_s: float = Field(
        default=0.5, ge=0.0, description="How often a busy worker publishes its map at most."
    )
    settle_after_s: float = Field(
        default=1.0,
        ge=0.0,
        description="A site that nothing has come to for this long is shown at its optimum.",
    )
    snapshot_every: int = Field(
        default=1_000, ge=1, description="Log entries between two snapshots of a busy site."
    )
    snapshot_idle_s: float = Field(
        default=5.0, ge=0.0, description="A site idle for this long is saved as well."
    )
    stop_grace_s: float = Field(
        default=10.0, ge=0.0, description="Time for last snapshots when the service stops."
    )

    map_cache_bytes: int = Field(
        default=64 * 1024 * 1024, ge=0, description="Rendered maps kept for the next who asks."
    )
    event_history: int = Field(
        default=5_000, ge=1, description="Published views of a site whose events are kept."
    )
    event_streams: int = Field(
        default=256, ge=1, description="Listeners to events at a time; more are answered 503."
    )
    heartbeat_s: float = Field(
        default=15.0, gt=0.0, description="A listener to events hears something this often."
    )
    slow_reader_s: float = Field(
        default=20.0, gt=0.0, description="A client that reads nothing for this long is dropped."
    )
    slow_sender_s: float = Field(
        default=20.0,
        gt=0.0,
        description="A client is dropped whose request has no complete head after this long, or "
        "whose body is this far behind `min_body_rate`.",
    )
    min_body_rate: float = Field(
        default=1000.0, gt=0.0, description="Bytes a second at which a body has to come."
    )

    @field_validator("mapper_config")
    @classmethod
    def _check_parameters(cls, value: Path | None) -> Path | None:
        if value is not None:
            from lineloom_service.parameter_file import read_config

            read_config(value)
        return value

    @field_validator("allow_origins", "allow_hosts", mode="before")
    @classmethod
    def _split(cls, value: object) -> object:
        if isinstance(value, str):
            return tuple(part.strip() for part in value.split(",") if part.strip())
        return value

    @model_validator(mode="after")
    def _check_tls(self) -> Self:
        if (self.ssl_certfile is None) != (self.ssl_keyfile is None):
            raise ValueError("ssl_certfile and ssl_keyfile go together")
        return self

    @model_validator(mode="after")
    def _check_bodies(self) -> Self:
        if self.max_bodies_bytes < 2 * self.max_body_bytes:
            raise ValueError("max_bodies_bytes must hold one body of max_body_bytes, twice")
        return self

    @cached_property
    def mapper(self) -> MapperConfig:
        """The parameters of the file, and the defaults of the others."""
        # Settings are read by what does without kernels as well, as the command line.
        from lineloom_core.mapping.config import MapperConfig

        from lineloom_service.parameter_file import read_config

        return MapperConfig() if self.mapper_config is None else read_config(self.mapper_config)

    @property
    def database_path(self) -> Path:
        """The SQLite file."""
        return self.data_dir / "lineloom.db"

"""The tables. Migrations build them; a test holds the two to each other."""

from __future__ import annotations

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Double,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Table,
    UniqueConstraint,
    false,
    text,
)

metadata = MetaData()

# SQLite numbers rows by itself only in a column of type INTEGER.
_Id = BigInteger().with_variant(Integer, "sqlite")

clock = Table(
    "clock",
    metadata,
    # There is one row. Whoever changes sites, robots, sessions or entries locks it first.
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("revision", BigInteger, nullable=False, server_default=text("0")),
    # Counts the engines that ever had the right to map.
    Column("term", BigInteger, nullable=False, server_default=text("0")),
)

sites = Table(
    "sites",
    metadata,
    Column("id", _Id, primary_key=True),
    Column("name", String(64), nullable=False),
    # Entries released to the mapper so far.
    Column("position", BigInteger, nullable=False, server_default=text("0")),
    Column("deleted", Boolean, nullable=False, server_default=false()),
    # The clock's when it last changed, its robots and sessions included.
    Column("revision", BigInteger, nullable=False, server_default=text("0")),
    Index(
        "ux_sites_name",
        "name",
        unique=True,
        sqlite_where=text("deleted = 0"),
        postgresql_where=text("NOT deleted"),
    ),
    # A deleted site's id must not come back: it tells an old map's ETag from a new one's.
    sqlite_autoincrement=True,
)

robots = Table(
    "robots",
    metadata,
    Column("id", _Id, primary_key=True),
    Column("site_id", ForeignKey("sites.id"), nullable=False),
    Column("name", String(64), nullable=False),
    Column("mount", LargeBinary),
    Column("forgotten", Boolean, nullable=False, server_default=false()),
    Index(
        "ux_robots_site_name",
        "site_id",
        "name",
        unique=True,
        sqlite_where=text("forgotten = 0"),
        postgresql_where=text("NOT forgotten"),
    ),
)

streams = Table(
    "streams",
    metadata,
    # In the order first seen.
    Column("id", _Id, primary_key=True),
    Column("robot_id", ForeignKey("robots.id"), nullable=False),
    Column("session", String(128), nullable=False),
    Column("released", BigInteger),
    Column("highest", BigInteger, nullable=False, server_default=text("-1")),
    Column("accepted", BigInteger, nullable=False, server_default=text("0")),
    UniqueConstraint("robot_id", "session", name="ux_streams_robot_session"),
)

entries = Table(
    "entries",
    metadata,
    # In the order of arrival.
    Column("id", _Id, primary_key=True),
    Column("site_id", ForeignKey("sites.id"), nullable=False),
    Column("robot_id", ForeignKey("robots.id"), nullable=False),
    Column("kind", String(8), nullable=False),
    Column("stream_id", ForeignKey("streams.id")),
    Column("seq", BigInteger),
    Column("body", LargeBinary),
    # In the order of the feed; null while a scan waits for those before it.
    Column("position", BigInteger),
    # `store.checksum`; null in entries from before there was one.
    Column("crc", BigInteger),
    UniqueConstraint("stream_id", "seq", name="ux_entries_stream_seq"),
    UniqueConstraint("site_id", "position", name="ux_entries_site_position"),
    Index(
        "ix_entries_held",
        "site_id",
        sqlite_where=text("position IS NULL"),
        postgresql_where=text("position IS NULL"),
    ),
)

skips = Table(
    "skips",
    metadata,
    Column("site_id", ForeignKey("sites.id"), primary_key=True, autoincrement=False),
    Column("position", BigInteger, primary_key=True, autoincrement=False),
    Column("reason", String, nullable=False),
)

snapshots = Table(
    "snapshots",
    metadata,
    Column("site_id", ForeignKey("sites.id"), primary_key=True, autoincrement=False),
    Column("position", BigInteger, primary_key=True, autoincrement=False),
    Column("scans", BigInteger, nullable=False),
    Column("producer", String(128), nullable=False),
    Column("data", LargeBinary, nullable=False),
    # How many of its producer's chapters it goes on from.
    Column("chapters", BigInteger, nullable=False, server_default=text("0")),
)

# The history that snapshots go on from, each piece kept once for all of them.
chapters = Table(
    "chapters",
    metadata,
    Column("site_id", ForeignKey("sites.id"), primary_key=True, autoincrement=False),
    Column("producer", String(128), primary_key=True),
    # From 0, without holes.
    Column("number", BigInteger, primary_key=True, autoincrement=False),
    # CRC-32 of the data.
    Column("crc", BigInteger, nullable=False),
    Column("data", LargeBinary, nullable=False),
)

# What was told to those who listen, a row for every published view that told anything.
events = Table(
    "events",
    metadata,
    Column("site_id", ForeignKey("sites.id"), primary_key=True, autoincrement=False),
    # Without holes, but for the oldest ones that are no longer kept.
    Column("number", BigInteger, primary_key=True, autoincrement=False),
    Column("position", BigInteger, nullable=False),
    Column("version", BigInteger, nullable=False),
    Column("producer", String(128), nullable=False),
    Column("body", LargeBinary, nullable=False),
)

views = Table(
    "views",
    metadata,
    Column("site_id", ForeignKey("sites.id"), primary_key=True, autoincrement=False),
    Column("position", BigInteger, nullable=False),
    Column("data", LargeBinary, nullable=False),
)

# Of a token's secret there is a digest only.
tokens = Table(
    "tokens",
    metadata,
    Column("id", String(12), primary_key=True),
    Column("digest", String(64), nullable=False),
    Column("scopes", String(64), nullable=False),
    Column("site", String(64)),
    Column("robot", String(64)),
    Column("note", String(200), nullable=False),
    Column("created", Double, nullable=False),
    Column("revoked", Double),
)

files = Table(
    "files",
    metadata,
    Column("site_id", ForeignKey("sites.id"), primary_key=True, autoincrement=False),
    Column("kind", String(16), primary_key=True),
    Column("name", String(128), primary_key=True),
    Column("about", String, nullable=False),
    Column("sha256", String(64), nullable=False),
    Column("size", BigInteger, nullable=False),
    Column("created", Double, nullable=False),
    Column("data", LargeBinary, nullable=False),
)

# What was deleted on purpose, so that a former copy does not bring it back.
tombstones = Table(
    "tombstones",
    metadata,
    Column("id", _Id, primary_key=True),
    # "site", "robot" or a kind of file.
    Column("kind", String(16), nullable=False),
    Column("site_id", BigInteger, nullable=False),
    # Of the site or the file; of a robot its number.
    Column("name", String(128), nullable=False),
    Column("at", Double, nullable=False),
)

questions = Table(
    "questions",
    metadata,
    Column("id", String(32), primary_key=True),
    Column("question", LargeBinary, nullable=False),
    Column("answer", LargeBinary),
)

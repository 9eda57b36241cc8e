"""Several processes on one database: what changed since when, and views that all can answer from.

revision: every commit that changes what is known of a site counts the clock on and leaves the
count at the site.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None

_ID = sa.BigInteger().with_variant(sa.Integer, "sqlite")


def _count(name: str) -> sa.Column[int]:
    return sa.Column(name, sa.BigInteger, nullable=False, server_default=sa.text("0"))


def upgrade() -> None:
    """Add the clock, its count at each site, and the published views."""
    clock = op.create_table(
        "clock",
        sa.Column("id", sa.Integer, primary_key=True, autoincrement=False),
        _count("revision"),
        _count("term"),
    )
    op.bulk_insert(clock, [{"id": 1, "revision": 0, "term": 0}])
    op.add_column("sites", _count("revision"))
    op.create_table(
        "views",
        sa.Column("site_id", _ID, sa.ForeignKey("sites.id"), primary_key=True, autoincrement=False),
        sa.Column("position", sa.BigInteger, nullable=False),
        sa.Column("data", sa.LargeBinary, nullable=False),
    )


def downgrade() -> None:
    """Remove them."""
    op.drop_table("views")
    op.drop_column("sites", "revision")
    op.drop_table("clock")

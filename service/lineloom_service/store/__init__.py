"""The scan log: what was accepted, in which order it is mapped, and mapper snapshots.

`protocol` is what the service relies on, `sql_store` the implementation, on SQLite or PostgreSQL.
Nothing is imported here: a worker process needs records and codec, not a database.
"""

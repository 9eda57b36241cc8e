"""The scan log: what was accepted, in which order it is mapped, and mapper snapshots.

`protocol` is what the service relies on, `sqlite_store` the embedded implementation. Nothing is
imported here: a worker process needs records and codec, not a database.
"""

"""Mapping outside the API process.

`protocol` is what the service needs of a place where mappers run, `local_engine` the embedded one
by child processes, `conductor` feeds either from the store. Nothing is imported here: a worker
process loads `worker`, not the whole service.
"""

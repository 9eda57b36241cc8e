"""Reading recordings and writing maps: a file a format, each a leaf that nothing else rests on.

A format of maps has `write_map(view, component, bbox, site) -> str | bytes` in the module of its
name, a format of recordings `read_log(path, session=…) -> Iterator[LogScan]`.
"""

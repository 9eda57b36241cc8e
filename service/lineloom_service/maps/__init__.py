"""The map as it is asked for: rendered once a version, and told as a difference.

`render_cache` keeps what was rendered, `line_history` knows since when every line is as it is,
`map_json` writes the JSON answer.
"""

"""What the docs' commands are to print: (a command's beginning, what its output matches)."""

from __future__ import annotations

EXPECTED = (
    ("curl -s localhost:8765/v1/sites/floor-2/robots/r1/scans", r'"accepted": ?1,'),
    ("curl -s $S/robots/r1/scans", r'"accepted": ?\d+.*"rejected": ?\[\]'),
    ("curl -s -X PUT $S/robots/r1", r'"mount"'),
    ("curl -s $S/robots/r1/trajectory?format=tum", r"(?m)^\d+\.\d+( -?[\d.e-]+){7}$"),
    ("curl -s $S/transforms/r1/r2", r'"T_a_b"'),
    ("curl -s $S/map ", r'"lines"'),
    ("curl -s $S/map?since=41", r'"lines"'),
    ("curl -s $S/graph?format=g2o", r"(?m)^VERTEX_SE2 \d+"),
    ("curl -s $S/constraints/$C ", r'"evidence"'),
    ("curl -s $S/localize", r'"verdict": ?"(unique|ambiguous)"'),
    ("curl -s localhost:8765/v1/match", r'"verdict": ?"(match|weak|ambiguous)"'),
    ("curl -s -X POST $S/constraints/$C/what-if", r'"component_after"'),
    ("curl -s -X POST $S/constraints/$C/retract", r'"retracted"'),
    ("curl -s -X POST $S/constraints/$C/restore", r'"accepted"'),
    ("curl -s -X POST $S/constraints/$C/confirm", r'"accepted"'),
    ("curl -s $S/constraints/what-if", r'"objections"'),
    ("curl -s $S/constraints -H", r'"operator"'),
    ("curl -s $S/exports -H", r'"mapHash"'),
    ("curl -s -X PUT $S/floorplan", r'"registered"'),
    ("curl -s localhost:8765/readyz", r'"maps": ?true'),
    ("curl -s localhost:8765/metrics", r"(?m)^lineloom_ready 1"),
    ("lineloom token list", r"ingest"),
    ("lineloom token create", r"\S{30}"),
    ("lineloom replay", r"scans"),
    ("lineloom export create", r'"mapHash"'),
)

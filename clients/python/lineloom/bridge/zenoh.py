"""Zenoh as ROS 2's rmw_zenoh speaks it: its keys, its attachments, its tokens. Needs the extra
`zenoh`, and a Zenoh router as ROS does (`ros2 run rmw_zenoh_cpp rmw_zenohd`)."""

from __future__ import annotations

import contextlib
import itertools
import os
import queue
import time
from collections.abc import Callable
from typing import Any

import zenoh
from zenoh import ext

from lineloom.bridge.dds import ros_domain
from lineloom.bridge.type_hashes import TYPE_HASHES
from lineloom.bridge.wire_types import ros_name

_CONFIG_VARIABLE = "ZENOH_SESSION_CONFIG_URI"
_ROUTER = '["tcp/localhost:7447"]'
_MOST_WAITING = 1_000
_NODE = "lineloom_bridge"


def key_of(domain: int, topic: str, kind: Any) -> str:
    """Return the key that a topic has: 0/scan/sensor_msgs::msg::dds_::LaserScan_/RIHS01_…"""
    return f"{domain}/{topic.strip('/')}/{_type_of(kind)}"


def _type_of(kind: Any) -> str:
    package, _, short = ros_name(kind).split("/")
    return f"{package}::msg::dds_::{short}_/{TYPE_HASHES[ros_name(kind)]}"


def attachment(number: int, at: int, gid: bytes) -> Any:
    """Return what goes with each message. number: counts from 1. at: nanoseconds. gid: 16 bytes,
    the publisher's."""
    parts = (
        ext.z_serialize("sequence_number"),
        ext.z_serialize(ext.Int64(number)),
        ext.z_serialize("source_timestamp"),
        ext.z_serialize(ext.Int64(at)),
        ext.z_serialize("source_gid"),
        ext.z_serialize(gid),
    )
    return zenoh.ZBytes(b"".join(bytes(part) for part in parts))


def usual_config() -> Any:
    """Return the configuration that ROS's variable names, else a peer of the local router."""
    path = os.environ.get(_CONFIG_VARIABLE)
    if path:
        return zenoh.Config.from_file(path)
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("connect/endpoints", _ROUTER)
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("timestamping/enabled", "true")
    return config


class ZenohWire:
    """A session. config: of zenoh; None for the usual one."""

    def __init__(self, config: Any = None, domain: int | None = None) -> None:
        self._domain = ros_domain() if domain is None else domain
        self._session = zenoh.open(usual_config() if config is None else config)
        self._come: queue.Queue[tuple[Any, Any, bytes]] = queue.Queue(_MOST_WAITING)
        self._ids = itertools.count(1)
        self._kept: list[Any] = [self._token("NN", 0, "")]

    def advertise(self, topic: str, kind: Any, *, latched: bool) -> Callable[[Any], None]:
        """Return what publishes."""
        key, number = key_of(self._domain, topic, kind), next(self._ids)
        cache = ext.CacheConfig(1) if latched else None
        publisher = ext.declare_advanced_publisher(
            self._session,
            key,
            cache=cache,
            publisher_detection=latched,
            congestion_control=zenoh.CongestionControl.BLOCK
            if latched
            else zenoh.CongestionControl.DROP,
        )
        self._kept += [publisher, self._token("MP", number, self._place(topic, kind, latched))]
        counts, gid = itertools.count(1), os.urandom(16)

        def send(message: Any) -> None:
            told = attachment(next(counts), time.time_ns(), gid)
            publisher.put(message.serialize(), attachment=told)

        return send

    def listen(
        self, topic: str, kind: Any, take: Callable[[Any], None], *, latched: bool, reliable: bool
    ) -> None:
        """Have messages handed on by `spin_once`. Zenoh is as reliable as its links anyway."""

        def come(sample: Any) -> None:
            # Whoever is so far behind that the queue is full has no use for more.
            with contextlib.suppress(queue.Full):
                self._come.put_nowait((kind, take, bytes(sample.payload)))

        history = ext.HistoryConfig(detect_late_publishers=True) if latched else None
        subscriber = ext.declare_advanced_subscriber(
            self._session, key_of(self._domain, topic, kind), come, history=history
        )
        number = next(self._ids)
        self._kept += [subscriber, self._token("MS", number, self._place(topic, kind, latched))]

    def spin_once(self, timeout: float) -> None:
        """Hand on what has come."""
        try:
            kind, take, content = self._come.get(timeout=timeout)
        except queue.Empty:
            return
        while True:
            take(kind.deserialize(content))
            try:
                kind, take, content = self._come.get_nowait()
            except queue.Empty:
                return

    def close(self) -> None:
        """Leave."""
        self._kept.clear()
        self._session.close()  # type: ignore[no-untyped-call]

    def _token(self, kind: str, number: int, rest: str) -> Any:
        """Declare who and what we are, so that `ros2 topic list` shows it."""
        zid = self._session.info.zid()
        key = f"@ros2_lv/{self._domain}/{zid}/0/{number}/{kind}/%/%/{_NODE}{rest}"
        return self._session.liveliness().declare_token(key)

    def _place(self, topic: str, kind: Any, latched: bool) -> str:
        mangled = topic.replace("/", "%")
        policies = f":{1 if latched else ''}:,{1 if latched else 10}:,:,:,,"
        return f"/{mangled}/{_type_of(kind)}/{policies}"

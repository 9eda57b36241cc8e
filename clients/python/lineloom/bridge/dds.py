"""ROS 2's usual wire: DDS, with Cyclone. Needs the extra `dds`."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from cyclonedds.core import (
    InstanceState,
    Policy,
    Qos,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

_ANY = ViewState.Any | SampleState.NotRead | InstanceState.Any
_AT_ONCE = 50
_DEPTH = 100
_SCANS = 5
"""As rclpy's profile of sensor data has it."""


def ros_domain() -> int:
    """Return the domain that ROS_DOMAIN_ID names, else 0."""
    return int(os.environ.get("ROS_DOMAIN_ID") or 0)


def qos(*, latched: bool, reliable: bool, depth: int) -> Qos:
    """Return the policies that rclpy's profiles stand for. Plain CDR, as every ROS 2 reads it."""
    wait = Policy.Reliability.Reliable(duration(milliseconds=500))
    return Qos(
        wait if reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )


class DdsWire:
    """A participant of a domain."""

    def __init__(self, domain: int | None = None) -> None:
        self._participant = DomainParticipant(ros_domain() if domain is None else domain)
        self._readers: list[tuple[Any, Any, Callable[[Any], None]]] = []
        self._waiting = WaitSet(self._participant)

    def advertise(self, topic: str, kind: Any, *, latched: bool) -> Callable[[Any], None]:
        """Return what publishes."""
        policies = qos(latched=latched, reliable=True, depth=1 if latched else _DEPTH)
        writer = DataWriter(self._participant, self._topic(topic, kind), qos=policies)
        return writer.write

    def listen(
        self, topic: str, kind: Any, take: Callable[[Any], None], *, latched: bool, reliable: bool
    ) -> None:
        """Have messages handed on by `spin_once`."""
        policies = qos(latched=latched, reliable=reliable, depth=_DEPTH if reliable else _SCANS)
        reader = DataReader(self._participant, self._topic(topic, kind), qos=policies)
        condition = ReadCondition(reader, _ANY)
        self._waiting.attach(condition)
        self._readers.append((reader, condition, take))

    def spin_once(self, timeout: float) -> None:
        """Hand on what has come."""
        self._waiting.wait(duration(milliseconds=max(1, round(1e3 * timeout))))
        for reader, _, take in self._readers:
            for sample in reader.take(_AT_ONCE):
                if sample.sample_info.valid_data:
                    take(sample)

    def close(self) -> None:
        """Leave the domain."""
        self._readers.clear()
        del self._waiting, self._participant

    def _topic(self, topic: str, kind: Any) -> Any:
        return Topic(self._participant, f"rt{topic}", kind)

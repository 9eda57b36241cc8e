"""The sensor doctor: what is wrong with a robot's lidar, found from what it sends."""

from lineloom_core.health.doctor import SensorDoctor, without_skew
from lineloom_core.health.finding import Finding, Severity

__all__ = ["Finding", "SensorDoctor", "Severity", "without_skew"]

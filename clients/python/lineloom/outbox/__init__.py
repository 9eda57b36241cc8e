"""A queue on disk between a robot and the network: what is put is delivered, once."""

from lineloom.outbox.async_outbox import AsyncOutbox
from lineloom.outbox.outbox import DeliveryFailure, Outbox
from lineloom.outbox.queue import OnFull, OutboxStats, Refusal

__all__ = ["AsyncOutbox", "DeliveryFailure", "OnFull", "Outbox", "OutboxStats", "Refusal"]

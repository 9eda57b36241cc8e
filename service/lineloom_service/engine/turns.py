"""Whose turn it is: sites that share a worker get the same time, whatever they ask for."""

from __future__ import annotations

from collections import deque

from lineloom_service.engine.messages import Chapter, Order, StartSite, StopSite


class Turns:
    """Waiting orders by site; within a site they stay in order.

    Next is the site that has used the least time. One that had nothing to do saves nothing up: it
    comes back as if it had used as much as the least of those that wait.
    """

    def __init__(self) -> None:
        self._orders: dict[int, deque[Order]] = {}
        self._used: dict[int, float] = {}

    def __bool__(self) -> bool:
        """Whether anything waits."""
        return bool(self._orders)

    def put(self, order: Order) -> None:
        """Take an order. What waits for a site that is started anew or stopped is void."""
        site = order.site
        if isinstance(order, Chapter | StartSite | StopSite):
            self._orders.pop(site, None)
        if site not in self._orders:
            least = min((self._used[other] for other in self._orders), default=0.0)
            self._used[site] = max(self._used.get(site, 0.0), least)
            self._orders[site] = deque()
        self._orders[site].append(order)

    def next(self) -> Order:
        """Return the first order of the site whose turn it is; it goes on waiting."""
        site = min(self._orders, key=lambda site: (self._used[site], site))
        return self._orders[site][0]

    def spend(self, site: int, seconds: float) -> None:
        """Charge a site for work."""
        self._used[site] += seconds

    def done(self, site: int) -> None:
        """Strike out the site's first order."""
        orders = self._orders[site]
        order = orders.popleft()
        if not orders:
            del self._orders[site]
        if isinstance(order, StopSite):
            self._used.pop(site, None)

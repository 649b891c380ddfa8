"""The plans made last, kept so that they can be executed by id."""

import threading
from collections import OrderedDict

from medor_wire.errors import NotFound
from medor_wire.messages import Plan


class Plans:
    """Plans by id; the oldest is forgotten when there are more than `keep`. Thread-safe."""

    def __init__(self, keep: int = 64) -> None:
        self._keep = keep
        self._plans: OrderedDict[str, Plan] = OrderedDict()
        self._lock = threading.Lock()

    def add(self, plan: Plan) -> None:
        with self._lock:
            self._plans[plan.plan_id] = plan
            while len(self._plans) > self._keep:
                self._plans.popitem(last=False)

    def get(self, plan_id: str) -> Plan:
        """Raises `NotFound` for an id never given out, or forgotten since."""
        with self._lock:
            if plan_id not in self._plans:
                raise NotFound(f"no plan {plan_id!r} among the last {len(self._plans)}")
            return self._plans[plan_id]

"""The planner's hand on the robot: the lease, kept alive while it is held, and the actions done under it."""

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from medor_planner.plans import Plans
from medor_wire import endpoints
from medor_wire.bus import Bus, Call
from medor_wire.errors import LeaseHeld, MedorError, Unavailable
from medor_wire.messages import ActOutcome, ActRequest, ExecuteRequest, Lease, LeaseRequest, Plan

log = logging.getLogger(__name__)

RENEWALS_PER_TTL = 4


class Executor:
    """Executes plans, one holder of the robot at a time."""

    def __init__(self, bus: Bus, plans: Plans) -> None:
        self._bus = bus
        self._plans = plans
        self._hand = threading.Lock()

    def execute(self, request: ExecuteRequest, call: Call) -> ActOutcome:
        """Carry a plan out, at most once: the robot answers the same plan again with its recorded outcome.

        Raises:
            NotFound: no such plan.
            LeaseHeld: an episode, or somebody else, holds the robot.
            OutcomeUnknown: the action was cut off; look again before acting.
        """
        plan = self._plans.get(request.plan_id)
        with self.hold() as hand:
            call.check()
            return hand.act(plan)

    @contextmanager
    def hold(self) -> Iterator["Hand"]:
        """The robot, leased to this planner until the block is left.

        Raises:
            LeaseHeld: it is leased already, to this planner or to another.
        """
        if not self._hand.acquire(blocking=False):
            raise LeaseHeld("this planner holds the robot for an episode or another action")
        try:
            lease = self._ask("acquire")
            over = threading.Event()
            renewer = threading.Thread(target=self._renew, args=(lease, over), name="lease", daemon=True)
            renewer.start()
            try:
                yield Hand(self._bus, lease)
            finally:
                over.set()
                renewer.join()
                self._release(lease)
        finally:
            self._hand.release()

    def _ask(self, action: str, epoch: int = 0) -> Lease:
        request = LeaseRequest.model_validate({"holder": self._bus.presence, "action": action, "epoch": epoch})
        return self._bus.ask(endpoints.LEASE, request)

    def _renew(self, lease: Lease, over: threading.Event) -> None:
        """Keep the lease until `over`. Once it is lost the robot refuses to act, which is how the holder learns."""
        while not over.wait(lease.ttl_s / RENEWALS_PER_TTL):
            try:
                self._ask("renew", lease.epoch)
            except Unavailable as gone:
                log.warning("lease %d not renewed: %s", lease.epoch, gone)
            except MedorError as lost:
                log.error("lease %d lost: %s", lease.epoch, lost)
                return

    def _release(self, lease: Lease) -> None:
        try:
            self._ask("release", lease.epoch)
        except MedorError as error:
            log.warning("lease %d not released, it will run out: %s", lease.epoch, error)


class Hand:
    """The robot while it is held."""

    def __init__(self, bus: Bus, lease: Lease) -> None:
        self._bus = bus
        self._lease = lease

    def act(self, plan: Plan) -> ActOutcome:
        """Do the plan's action; nothing moves when the plan is to do nothing."""
        if plan.no_op:
            return ActOutcome(action_id=plan.plan_id, grasped=False)
        action = ActRequest(action_id=plan.plan_id, epoch=self._lease.epoch, pick=plan.pick, place=plan.place)
        return self._bus.ask(endpoints.ACT, action)

"""The planner's hand on the robot: plans carried out under a lease, each at most once."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from medor_planner.plans import Plans
from medor_wire.bus import Bus, Call
from medor_wire.errors import LeaseHeld
from medor_wire.holding import Holding
from medor_wire.messages import ActOutcome, ActRequest, ExecuteRequest, Plan


class Executor:
    """Executes plans. The robot is held once at a time, though all of this process is one holder to the robot."""

    def __init__(self, bus: Bus, plans: Plans) -> None:
        self._bus = bus
        self._plans = plans
        self._held = threading.Lock()

    def execute(self, request: ExecuteRequest, call: Call) -> ActOutcome:
        """Carry a plan out, at most once: the robot answers the same plan again with its recorded outcome.

        Raises:
            NotFound: no such plan.
            LeaseHeld: an episode, or somebody else, holds the robot.
            OutcomeUnknown: the action was cut off; look again before acting.
        """
        plan = self._plans.get(request.plan_id)
        with self.hold() as robot:
            call.check()
            return act(robot, plan)

    @contextmanager
    def hold(self) -> Iterator[Holding]:
        """The robot, leased to this process until the block is left.

        Raises:
            LeaseHeld: it is leased already, to this process or to another.
        """
        if not self._held.acquire(blocking=False):
            raise LeaseHeld("this planner holds the robot for an episode or another action")
        try:
            with Holding(self._bus) as robot:
                yield robot
        finally:
            self._held.release()


def act(robot: Holding, plan: Plan) -> ActOutcome:
    """Do a plan's action; nothing moves when the plan is to do nothing."""
    if plan.no_op:
        return ActOutcome(action_id=plan.plan_id, grasped=False)
    request = ActRequest(
        action_id=plan.plan_id, epoch=robot.epoch, pick=plan.pick, place=plan.place, executor=plan.executor
    )
    return robot.act(request)

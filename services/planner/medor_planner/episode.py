"""Closed loop: look, plan, act, score, until the garment is done or the picks are used up (MEDOR, section V)."""

import time

from medor_planner.executor import Executor, act
from medor_planner.methods import method_named
from medor_planner.planner import Planner
from medor_wire import endpoints
from medor_wire.bus import Bus, Call
from medor_wire.errors import BadRequest, Unavailable
from medor_wire.holding import Holding
from medor_wire.messages import (
    Empty,
    Episode,
    EpisodePick,
    EpisodeProgress,
    EpisodeRequest,
    PlanRequest,
    Score,
    Task,
)


class Episodes:
    """Runs episodes, one at a time: an episode holds the robot from its start to its end."""

    def __init__(self, bus: Bus, planner: Planner, executor: Executor) -> None:
        self._bus = bus
        self._planner = planner
        self._executor = executor

    def run(self, request: EpisodeRequest, call: Call) -> Episode:
        """One episode. Doing nothing spends a pick like any action: the next one samples other candidates.

        Cancelling ends it before the next action. Any error ends it and is its answer.

        Raises:
            LeaseHeld: the robot is taken.
            Unavailable: there is no referee (`sim/score`), or another service does not answer.
        """
        check(request)
        self._find_referee()
        with self._executor.hold() as robot:
            score = self._bus.ask(endpoints.RESET, request.reset) if request.reset else self._score()
            picks = [EpisodePick(index=0, coverage_m2=score.coverage_m2, ni=improvement(score, request.task))]
            call.progress(EpisodeProgress(step=picks[0]))
            while picks[-1].ni <= request.stop_ni and len(picks) <= request.max_picks:
                pick = self._pick(request, len(picks), robot, call)
                call.progress(EpisodeProgress(step=pick))
                picks.append(pick.model_copy(update={"view": None, "plan": None}))
        return Episode(
            ni=picks[-1].ni,
            picks=tuple(picks),
            flat_coverage_m2=score.flat_coverage_m2,
            reason="solved" if picks[-1].ni > request.stop_ni else "max_picks",
        )

    def _pick(self, request: EpisodeRequest, index: int, robot: Holding, call: Call) -> EpisodePick:
        """Look, plan, act and score once."""
        call.check()
        robot.check()
        started = time.perf_counter()
        view = self._bus.ask(endpoints.CAPTURE, Empty())
        captured = time.perf_counter()
        asked = PlanRequest(
            category=request.category,
            task=request.task,
            method=request.method,
            view=view,
            candidates=request.candidates,
            seed=request.seed,
            executor=request.executor,
            exhaustive=request.exhaustive,
        )
        plan = self._planner.plan_pick(
            asked, index, call, lambda progress: call.progress(EpisodeProgress(planning=progress))
        )
        call.check()
        planned = time.perf_counter()
        act(robot, plan)
        acted = time.perf_counter()
        score = self._score()
        return EpisodePick(
            index=index,
            pick=plan.pick,
            place=plan.place,
            no_op=plan.no_op,
            reward=plan.reward,
            no_op_reward=plan.no_op_reward,
            coverage_m2=score.coverage_m2,
            ni=improvement(score, request.task),
            timings_ms={
                **plan.timings_ms,
                "capture": 1e3 * (captured - started),
                "act": 1e3 * (acted - planned),
                "total": 1e3 * (time.perf_counter() - started),
            },
            view=view,
            plan=plan,
        )

    def _find_referee(self) -> None:
        if self._bus.instances(endpoints.SCORE.service):
            return
        try:
            self._score()
        except Unavailable as nobody:
            raise Unavailable("episodes need a referee, and no service of this cell answers sim/score") from nobody

    def _score(self) -> Score:
        return self._bus.ask(endpoints.SCORE, Empty())


def check(request: EpisodeRequest) -> None:
    """Refuse what could only fail later."""
    method_named(request.method)
    reset = request.reset
    if reset is not None and reset.garment_id is None and reset.category != request.category:
        raise BadRequest(f"the episode is for {request.category}, but its reset lays out {reset.category}")


def improvement(score: Score, task: Task) -> float:
    """Normalized improvement of the task."""
    return score.ni_flatten if task == "flatten" else score.ni_canonicalize

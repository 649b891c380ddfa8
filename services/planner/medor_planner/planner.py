"""The planner: one observation in, the pick-and-place with the best predicted reward out (MEDOR, section IV-C)."""

import threading
from collections.abc import Callable, Mapping
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from medor_planner.choice import Choice, no_op
from medor_planner.goals import Goals, canonical_of
from medor_planner.judge.judge import Judge
from medor_planner.judge.opinions import OPINIONS, consulted, reconstructed
from medor_planner.judge.situation import Situation
from medor_planner.methods import Method, method_named
from medor_planner.plans import Plans
from medor_planner.random_policy import random_action
from medor_planner.sampling import Candidates, Scene, sample
from medor_planner.screening import Screening
from medor_planner.shooting import CHUNK, Shooting
from medor_planner.watching import Stage, Stages, cancelling
from medor_wire import endpoints
from medor_wire.bus import Bus, Call
from medor_wire.errors import BadRequest
from medor_wire.messages import (
    ClothMesh,
    DepthView,
    Empty,
    Executor,
    Plan,
    PlanProgress,
    PlanRequest,
    ReachRequest,
    Reward,
    RolloutRequest,
)

SCREEN_CHUNK = 50
"""Candidates per request to rate them: about as much work as to roll out a third of them."""


class Planner:
    """Plans by asking: the cell for what it sees, recon for the mesh, dynamics for what actions would do."""

    def __init__(
        self,
        bus: Bus,
        plans: Plans,
        chunk: int = CHUNK,
        screening: Screening | None = None,
        judge: Callable[[], Judge] = Judge.load,
    ) -> None:
        self._bus = bus
        self._plans = plans
        self._goals = Goals(bus)
        self._chunk = chunk
        self._screening = screening or Screening()
        self._judge_of = cache(judge)

    def plan(self, request: PlanRequest, call: Call) -> Plan:
        """The best of `request.candidates` sampled actions, or doing nothing when that is predicted best.

        The same request and cell give the same action. Raises what `plan_pick` does.
        """
        return self.plan_pick(request, 0, call, call.progress)

    def plan_pick(self, request: PlanRequest, index: int, call: Call, tell: Callable[[PlanProgress], None]) -> Plan:
        """`plan` for one pick of an episode: every `index` draws other candidates.

        Raises:
            BadRequest: unknown method, or another category on the table.
            OutOfReach: no candidate can be carried out.
            ReconstructionFailed: recon found no mesh it trusts, or none of its vertices lies over cloth that was seen.
            Unavailable: a service that is needed does not answer.
        """
        method = method_named(request.method)
        rng = np.random.default_rng([request.seed, index])
        stages = Stages(call, tell)
        reachable = partial(self._reachable, request.executor)
        with cancelling(call) as cancel:
            with stages.stage("capture"):
                view = request.view or self._bus.ask(endpoints.CAPTURE, Empty(), cancel=cancel)
            with stages.stage("reconstruct"):
                meshes = self._meshes(method, request, view, cancel)
                scene = Scene(next(iter(meshes.values())), view)
            if method.dynamics is None:
                with stages.stage("sample"):
                    choice = Choice.unrated(random_action(scene, rng, reachable))
            else:
                with stages.stage("goals"):
                    reward = self._reward(method, request, scene.mesh, cancel)
                with stages.stage("sample"):
                    candidates = sample(scene, request.candidates, rng, reachable=reachable)
                drawn = len(candidates)
                candidates = self._screen(request, scene.mesh, candidates, reward, stages, cancel)
                if method.judged:
                    rewards, no_op_reward = self._judge(request, view, meshes, candidates, stages, cancel)
                else:
                    every = no_op(scene.mesh) + candidates
                    backend = method.dynamics
                    found = self._rewards("rollout", scene.mesh, every, reward, backend, self._chunk, stages, cancel)
                    rewards, no_op_reward = found[1:], float(found[0])
                choice = Choice(candidates, rewards, no_op_reward, drawn)
        plan = choice.plan(request, scene.mesh, stages.total())
        self._plans.add(plan)
        return plan

    def _meshes(
        self, method: Method, request: PlanRequest, view: DepthView, cancel: threading.Event
    ) -> dict[str, ClothMesh]:
        """The meshes to plan on by reconstruction method, the one to choose picks on first."""
        if method.recon is None:
            mesh = self._bus.ask(endpoints.TRUTH, Empty(), cancel=cancel).mesh
            if mesh.category != request.category:
                raise BadRequest(f"asked to plan for {request.category}, but {mesh.category} lies on the table")
            return {"": mesh}
        wanted = (opinion.recon for opinion in OPINIONS) if method.judged else (method.recon,)
        return reconstructed(self._bus, view, request.category, wanted, cancel)

    def _reward(self, method: Method, request: PlanRequest, mesh: ClothMesh, cancel: threading.Event) -> Reward:
        if request.task == "flatten":
            return Reward(task="flatten", visible_only=method.visible_reward)
        return self._goals.reward(method, mesh, cancel)

    def _reachable(
        self, executor: Executor, picks: NDArray[np.float32], places: NDArray[np.float32]
    ) -> NDArray[np.bool_]:
        request = ReachRequest(points=picks, places=places, executor=executor)
        return self._bus.ask(endpoints.REACH, request).reachable

    def _screen(
        self,
        request: PlanRequest,
        mesh: ClothMesh,
        candidates: Candidates,
        reward: Reward,
        stages: Stages,
        cancel: threading.Event,
    ) -> Candidates:
        """The candidates to roll out: the survivors of screening, or all of them."""
        screening = self._screening
        if request.exhaustive or screening.leaves(len(candidates)) == len(candidates):
            return candidates

        def rewards(some: Candidates, backend: str) -> NDArray[np.float64]:
            return self._rewards("screen", mesh, some, reward, backend, SCREEN_CHUNK, stages, cancel)

        return screening.survivors(candidates, rewards)

    def _rewards(
        self,
        stage: Stage,
        mesh: ClothMesh,
        candidates: Candidates,
        reward: Reward,
        backend: str,
        chunk: int,
        stages: Stages,
        cancel: threading.Event,
    ) -> NDArray[np.float64]:
        """(K,) what one backend foresees."""
        asked = RolloutRequest(
            mesh=mesh, picks=candidates.picks, places=candidates.places, reward=reward, backend=backend
        )
        with stages.stage(stage):
            return Shooting(self._bus, asked, cancel, chunk).rewards(on_fraction=partial(stages.report, stage))

    def _judge(
        self,
        request: PlanRequest,
        view: DepthView,
        meshes: Mapping[str, ClothMesh],
        candidates: Candidates,
        stages: Stages,
        cancel: threading.Event,
    ) -> tuple[NDArray[np.float64], float]:
        """(K,) rewards to expect when all models have been heard, and that of doing nothing."""
        goals = self._goals.of(canonical_of(next(iter(meshes.values()))), cancel)
        with stages.stage("rollout"):
            tell = partial(stages.report, "rollout")
            foreseen = consulted(self._bus, meshes, candidates, cancel, tell, self._chunk)
        with stages.stage("judge"):
            return self._judge_of().rated(Situation(view, candidates, goals, foreseen), request.task)

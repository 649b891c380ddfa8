"""The planner: one observation in, the pick-and-place with the best predicted reward out (MEDOR, section IV-C)."""

import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from medor_planner.choice import Choice, no_op
from medor_planner.goals import Goals
from medor_planner.judge.hearing import Hearing
from medor_planner.judge.judge import SHIPPED
from medor_planner.methods import Method, method_named
from medor_planner.plans import Plans
from medor_planner.random_policy import random_action
from medor_planner.sampling import Candidates, Scene, sample
from medor_planner.screening import SCREEN_CHUNK, Screening
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
    ReconstructRequest,
    Reward,
    RolloutRequest,
)

GLANCES = 5
"""Pulls that a judge glances at for every candidate that is asked for."""


class Planner:
    """Plans by asking: the cell for what it sees, recon for the mesh, dynamics for what actions would do."""

    def __init__(
        self,
        bus: Bus,
        plans: Plans,
        chunk: int = CHUNK,
        screening: Screening | None = None,
        judges: Path = SHIPPED,
        glances: int = GLANCES,
    ) -> None:
        self._bus = bus
        self._plans = plans
        self._goals = Goals(bus)
        self._chunk, self._glances = chunk, glances
        self._screening = screening or Screening()
        self._hearing = Hearing(bus, self._goals, judges, chunk)

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
                scene = Scene(self._mesh(method, request, view, cancel), view)
            if method.dynamics is None:
                with stages.stage("sample"):
                    choice = Choice.unrated(random_action(scene, rng, reachable))
            else:
                with stages.stage("goals"):
                    reward = self._reward(method, request, scene.mesh, cancel)
                with stages.stage("sample"):
                    count = request.candidates * (self._glances if method.judged else 1)
                    candidates = sample(scene, count, rng, reachable=reachable)
                decide = (
                    partial(self._hearing.choice, method) if method.judged else partial(self._shoot, method, reward)
                )
                choice = decide(request, scene, candidates, stages, cancel)
        plan = choice.plan(request, scene.mesh, stages.total())
        self._plans.add(plan)
        return plan

    def _mesh(self, method: Method, request: PlanRequest, view: DepthView, cancel: threading.Event) -> ClothMesh:
        if method.recon is None:
            mesh = self._bus.ask(endpoints.TRUTH, Empty(), cancel=cancel).mesh
            if mesh.category != request.category:
                raise BadRequest(f"asked to plan for {request.category}, but {mesh.category} lies on the table")
            return mesh
        asked = ReconstructRequest(view=view, category=request.category, method=method.recon)
        return self._bus.ask(endpoints.RECONSTRUCT, asked, cancel=cancel).mesh

    def _reward(self, method: Method, request: PlanRequest, mesh: ClothMesh, cancel: threading.Event) -> Reward:
        if request.task == "flatten":
            return Reward(task="flatten", visible_only=method.visible_reward)
        return self._goals.reward(method, mesh, cancel)

    def _reachable(
        self, executor: Executor, picks: NDArray[np.float32], places: NDArray[np.float32]
    ) -> NDArray[np.bool_]:
        request = ReachRequest(points=picks, places=places, executor=executor)
        return self._bus.ask(endpoints.REACH, request).reachable

    def _shoot(
        self,
        method: Method,
        reward: Reward,
        request: PlanRequest,
        scene: Scene,
        candidates: Candidates,
        stages: Stages,
        cancel: threading.Event,
    ) -> Choice:
        """Rolls candidates out: the survivors of screening, or all of them."""
        mesh = scene.mesh

        def rewards(stage: Stage, some: Candidates, backend: str, chunk: int) -> NDArray[np.float64]:
            asked = RolloutRequest(mesh=mesh, picks=some.picks, places=some.places, reward=reward, backend=backend)
            with stages.stage(stage):
                tell = partial(stages.report, stage)
                return Shooting(self._bus, asked, cancel, chunk).rewards(on_fraction=tell)

        drawn, screening = len(candidates), self._screening
        if not request.exhaustive and screening.leaves(drawn) < drawn:
            candidates = screening.survivors(candidates, partial(rewards, "screen", chunk=SCREEN_CHUNK))
        found = rewards("rollout", no_op(mesh) + candidates, method.dynamics or "", self._chunk)
        return Choice(candidates, found[1:], float(found[0]), drawn)

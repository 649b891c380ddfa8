"""The choice among rolled-out candidates: the best one, unless doing nothing is as good."""

import uuid
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from medor_planner.sampling import Candidates
from medor_wire.messages import ClothMesh, Plan, PlanRequest

OUT_OF_GRASP_M = 1.0
"""Height of the no-op's picker over the highest vertex [m]."""


def no_op(mesh: ClothMesh) -> Candidates:
    """One candidate that grasps nothing; the paper always has one (MEDOR, section IV-C)."""
    over = np.array([[0, 0, mesh.vertices[:, 2].max() + OUT_OF_GRASP_M]], np.float32)
    return Candidates(over, over)


@dataclass(frozen=True)
class Choice:
    """Candidates with their predicted rewards (K,), and the reward of doing nothing."""

    candidates: Candidates
    rewards: NDArray[np.float64]
    no_op_reward: float | None
    """None when nothing was predicted at all: then a candidate is always chosen."""
    drawn: int = 1
    """How many there were before screening."""

    @classmethod
    def unrated(cls, candidates: Candidates) -> "Choice":
        """Candidates without a model to rate them; the first is chosen, with reward 0."""
        return cls(candidates, np.zeros(len(candidates)), None)

    @property
    def best_first(self) -> NDArray[np.int64]:
        """(K,) candidates by falling reward; equal ones in their order, so that the choice is deterministic."""
        return np.argsort(-self.rewards, kind="stable")

    @property
    def nothing(self) -> bool:
        """Whether no candidate is better than doing nothing."""
        return self.no_op_reward is not None and bool(self.rewards.max() <= self.no_op_reward)

    def plan(self, request: PlanRequest, mesh: ClothMesh, timings_ms: dict[str, float]) -> Plan:
        """The choice as a plan with an id of its own. Doing nothing is told as a place equal to its pick."""
        top = self.best_first[: request.report]
        pick, place = self.candidates.picks[top[0]], self.candidates.places[top[0]]
        no_op_reward = self.no_op_reward or 0.0
        return Plan(
            plan_id=uuid.uuid4().hex,
            category=request.category,
            task=request.task,
            method=request.method,
            no_op=self.nothing,
            pick=pick.astype(np.float64),
            place=(pick if self.nothing else place).astype(np.float64),
            reward=no_op_reward if self.nothing else float(self.rewards[top[0]]),
            no_op_reward=no_op_reward,
            mesh=mesh,
            top_picks=self.candidates.picks[top],
            top_places=self.candidates.places[top],
            top_rewards=self.rewards[top],
            candidates=self.drawn,
            survivors=len(self.candidates),
            executor=request.executor,
            timings_ms=timings_ms,
        )

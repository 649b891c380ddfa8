"""A judged decision: the rough model is heard about every candidate, all models about the best of them."""

import threading
from collections.abc import Callable, Mapping
from functools import cache, partial

from medor_planner.choice import Choice
from medor_planner.goals import Goals, canonical_of
from medor_planner.judge.judge import ALL, SCREEN, Judge
from medor_planner.judge.opinions import COARSE, OPINIONS, Opinion, consulted, reconstructed
from medor_planner.judge.situation import Foreseen, Situation
from medor_planner.sampling import Candidates, Scene
from medor_planner.screening import SCREEN_CHUNK, Screening
from medor_planner.shooting import CHUNK
from medor_planner.watching import Stage, Stages
from medor_wire.bus import Bus
from medor_wire.messages import PlanRequest


class Hearing:
    """Decides by asking several models and a judge.

    Args:
        bus: where models are asked.
        goals: keeps goal poses.
        judge: loads one of the judges by name.
        screening: how many candidates all models are heard about.
        chunk: candidates per request.
    """

    def __init__(
        self,
        bus: Bus,
        goals: Goals,
        judge: Callable[[str], Judge],
        screening: Screening,
        chunk: int = CHUNK,
    ) -> None:
        self._bus, self._goals, self._screening, self._chunk = bus, goals, screening, chunk
        self._judge = cache(judge)

    def choice(
        self, request: PlanRequest, scene: Scene, candidates: Candidates, stages: Stages, cancel: threading.Event
    ) -> Choice:
        """The candidates that were rolled out, with the rewards to expect of them.

        Raises:
            BadRequest: no weights, or of other features.
            MedorError: what the services asked say.
        """
        known = {OPINIONS[0].recon: scene.mesh}
        with stages.stage("reconstruct"):
            others = [opinion.recon for opinion in OPINIONS if opinion.recon not in known]
            meshes = known | reconstructed(self._bus, scene.view, request.category, others, cancel)
        with stages.stage("goals"):
            goals = self._goals.of(canonical_of(scene.mesh), cancel)

        def hear(stage: Stage, opinions: list[Opinion], some: Candidates, chunk: int) -> Mapping[str, Foreseen]:
            with stages.stage(stage):
                return consulted(self._bus, opinions, meshes, some, cancel, partial(stages.report, stage), chunk)

        drawn = Situation(scene.view, scene.mesh, candidates, goals, hear("screen", [COARSE], candidates, SCREEN_CHUNK))
        left = drawn
        if not request.exhaustive and self._screening.leaves(len(candidates)) < len(candidates):
            with stages.stage("judge"):
                rewards, _ = self._judge(SCREEN).rated(drawn, request.task)
            left = drawn.among(self._screening.best(rewards))
        rest = [opinion for opinion in OPINIONS if opinion is not COARSE]
        left = left.hearing(hear("rollout", rest, left.candidates, self._chunk))
        with stages.stage("judge"):
            rewards, no_op_reward = self._judge(ALL).rated(left, request.task)
        return Choice(left.candidates, rewards, no_op_reward, len(candidates))

"""A judged decision: a glance at many pulls, all models' word on those that it likes best, and the mean of what the
glance and the judge who heard the models expect."""

import threading
from functools import cache, partial
from pathlib import Path

from medor_planner.choice import Choice
from medor_planner.goals import Goals, canonical_of
from medor_planner.judge.glance import Glance
from medor_planner.judge.judge import SHIPPED, TASKS, Judge, rewards
from medor_planner.judge.opinions import OPINIONS, consulted, reconstructed
from medor_planner.judge.situation import Situation
from medor_planner.methods import Method
from medor_planner.sampling import Candidates, Scene
from medor_planner.screening import AT_LEAST, best
from medor_planner.shooting import CHUNK
from medor_planner.watching import Stages
from medor_wire.bus import Bus
from medor_wire.messages import PlanRequest


class Hearing:
    """Decides by asking several models and a judge.

    Args:
        bus: where models are asked.
        goals: keeps goal poses.
        weights: folder of the glance's and the judge's.
        chunk: candidates per request.
    """

    def __init__(
        self,
        bus: Bus,
        goals: Goals,
        weights: Path = SHIPPED,
        chunk: int = CHUNK,
    ) -> None:
        self._bus, self._goals, self._chunk = bus, goals, chunk
        self._glance, self._judge = cache(lambda: Glance.load(weights)), cache(lambda: Judge.load(weights))

    def choice(
        self,
        method: Method,
        request: PlanRequest,
        scene: Scene,
        drawn: Candidates,
        stages: Stages,
        cancel: threading.Event,
    ) -> Choice:
        """The candidates that were rolled out, with the rewards to expect of them.

        Args:
            method: whose mesh the scene has; where it is the true one all models are asked about that.
            request: what is asked for.
            scene: the garment as seen.
            drawn: pulls to glance at.
            stages: told what goes on.
            cancel: stops waiting.

        Raises:
            BadRequest: no weights, or of other features.
            MedorError: what the services asked say.
        """
        recons = dict.fromkeys(opinion.recon for opinion in OPINIONS)
        known = dict.fromkeys([method.recon] if method.recon else recons, scene.mesh)
        with stages.stage("reconstruct"):
            others = [recon for recon in recons if recon not in known]
            meshes = known | reconstructed(self._bus, scene.view, request.category, others, cancel)
        with stages.stage("goals"):
            goals = self._goals.of(canonical_of(scene.mesh), cancel)

        count = request.candidates if request.exhaustive else min(request.candidates, AT_LEAST)
        case = Situation(scene.view, scene.mesh, drawn, goals, {})
        with stages.stage("screen"):
            glanced = self._glance().gains(case)
            chosen = best(glanced[:, TASKS.index(request.task)], min(count, len(drawn)))
            glanced, case = glanced[chosen], case.among(chosen)
        with stages.stage("rollout"):
            tell = partial(stages.report, "rollout")
            case = case.hearing(consulted(self._bus, OPINIONS, meshes, case.candidates, cancel, tell, self._chunk))
        with stages.stage("judge"):
            gains = (glanced + self._judge().gains(case)) / 2
            expected, no_op_reward = rewards(case, gains, request.task)
        return Choice(case.candidates, expected, no_op_reward, len(drawn))

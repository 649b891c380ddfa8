"""The models that are asked before the judge decides: each foresees the same candidates on a mesh of its own."""

import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from medor_planner.choice import no_op
from medor_planner.judge.situation import Foreseen
from medor_planner.sampling import Candidates
from medor_planner.shooting import CHUNK, Shooting
from medor_wire import endpoints
from medor_wire.bus import Bus
from medor_wire.messages import Category, ClothMesh, DepthView, ReconstructRequest, Reward, RolloutRequest


@dataclass(frozen=True)
class Opinion:
    """One model on one mesh."""

    recon: str
    """Reconstruction method that makes the mesh."""
    backend: str
    """Of dynamics."""

    @property
    def name(self) -> str:
        return f"{self.recon}+{self.backend}"


COARSE = Opinion("medor", "coarse")
"""The rough model, cheap enough to be asked about every candidate."""
OPINIONS = (Opinion("medor", "layerless"), Opinion("isometric", "layerless"), Opinion("medor", "learned"), COARSE)
"""Whom the judge has learnt to listen to; picks are chosen on the first one's mesh."""


def reconstructed(
    bus: Bus, view: DepthView, category: Category, methods: Iterable[str], cancel: threading.Event
) -> dict[str, ClothMesh]:
    """The meshes that reconstruction methods make of a view, each once. Raises what recon does."""
    return {
        method: bus.ask(
            endpoints.RECONSTRUCT, ReconstructRequest(view=view, category=category, method=method), cancel=cancel
        ).mesh
        for method in dict.fromkeys(methods)
    }


def consulted(
    bus: Bus,
    opinions: Sequence[Opinion],
    meshes: Mapping[str, ClothMesh],
    candidates: Candidates,
    cancel: threading.Event,
    on_fraction: Callable[[float], None] = lambda share: None,
    chunk: int = CHUNK,
) -> dict[str, Foreseen]:
    """What each model foresees of doing nothing and of every candidate, by its name. Raises what `Shooting` does."""
    every, reward = no_op(meshes[OPINIONS[0].recon]) + candidates, Reward(task="flatten")
    found = {}
    for i, opinion in enumerate(opinions):
        mesh = meshes[opinion.recon]
        asked = RolloutRequest(
            mesh=mesh, picks=every.picks, places=every.places, reward=reward, backend=opinion.backend
        )
        positions, _ = Shooting(bus, asked, cancel, chunk).rollouts(
            lambda share, done=i: on_fraction((done + share) / len(opinions))
        )
        found[opinion.name] = Foreseen(mesh, positions)
    return found

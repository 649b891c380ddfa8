"""How fast rollouts are: `python -m medor_dynamics.bench --preset cpu`.

Rolls a plan's candidates out on a crumpled garment held out from training, in float32 and, where the processor is fast
at it, in bfloat16, and a few of them as the paper does, one graph at a time. Prints JSON: seconds by the clock and of
CPU, and how far the results lie apart.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
import tyro
from numpy.typing import NDArray
from rich.console import Console

from medor_cloth.garment import generate
from medor_cloth.goals import flattened, solver_of
from medor_cloth.start import dropped
from medor_dynamics.model import Dynamics
from medor_dynamics.node_mesh import NodeMesh
from medor_dynamics.plain import roll_out_plainly
from medor_dynamics.preset import PRESETS, STEPS
from medor_dynamics.rollout import CHUNK, Pulls, roll_out
from medor_dynamics.shipped import load
from medor_learn.precision import has_bf16
from medor_wire.messages import Category, ClothMesh

HELD_OUT_SEED = 800_001


@dataclass(frozen=True)
class Options:
    """What to time."""

    preset: Literal["cpu", "paper"] = "cpu"
    """Size of the model; its weights are random unless given."""
    weights: Path | None = None
    category: Category = "trousers"
    candidates: int = 500
    threads: int = 2
    chunk: int = CHUNK
    plain: int = 4
    """Candidates rolled out the paper's way."""


def main(options: Options) -> None:
    torch.set_num_threads(1)
    torch.manual_seed(0)
    model = load(options.weights) if options.weights else Dynamics(PRESETS[options.preset]).eval()
    nodes, positions = crumpled(options.category)
    Console().print_json(data=measured(options, model, nodes, positions))


def crumpled(category: Category) -> tuple[NodeMesh, NDArray[np.float32]]:
    """A dropped garment's coarse mesh and where its nodes lie (n, 3) [m]."""
    garment = generate(category, HELD_OUT_SEED)
    solver = solver_of(garment)
    vertices = dropped(solver, flattened(garment, solver), np.random.default_rng(0)).positions
    seen = np.ones(len(vertices), bool)
    mesh = ClothMesh(
        vertices=vertices, faces=garment.faces, category=category, visible=seen, canonical=garment.vertices
    )
    nodes = NodeMesh.of(mesh)
    return nodes, vertices[nodes.ids]


def random_pulls(nodes: int, count: int) -> Pulls:
    rng = np.random.default_rng(1)
    directions = rng.uniform((-0.5, -0.5, 0), 0.5, (count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return Pulls(rng.integers(nodes, size=count), (directions * rng.uniform(0.05, 0.2, (count, 1))).astype(np.float32))


def measured(options: Options, model: Dynamics, nodes: NodeMesh, positions: NDArray[np.float32]) -> dict[str, Any]:
    graph, pulls = nodes.graphs(positions, model.preset), random_pulls(len(positions), options.candidates)
    rest = nodes.rest_lengths(positions, model.preset)
    few = pulls[: options.plain]

    def lean(dtype: torch.dtype, some: Pulls) -> NDArray[np.float32]:
        predictor = model.predictor(dtype)
        return roll_out(predictor, graph, positions, some, chunk=options.chunk, threads=options.threads)

    precisions = {"float32": torch.float32} | ({"bfloat16": torch.bfloat16} if has_bf16() else {})
    results, cost = {}, {}
    for name, dtype in precisions.items():
        lean(dtype, few)  # compiles
        results[name], cost[name] = timed(lambda dtype=dtype: lean(dtype, pulls))
    after, rounded = results["float32"], results.get("bfloat16")
    plain_after, plain = timed(
        lambda: np.array(
            [
                roll_out_plainly(model, nodes.edges, rest, positions, int(node), pull)
                for node, pull in zip(few.nodes, few.displacements, strict=True)
            ]
        )
    )
    wiring = graph.wire(torch.from_numpy(positions), model.preset)
    return {
        "category": options.category,
        "nodes": len(positions),
        "edges": len(wiring.senders),
        "parameters": sum(parameter.numel() for parameter in model.parameters()),
        "candidates": options.candidates,
        "steps": STEPS,
        "threads": options.threads,
        **cost,
        "plain_cpu_s_a_candidate": plain["cpu_s"] / max(len(few), 1),
        "float32_largest_difference_from_plain_m": float(np.abs(after[: len(few)] - plain_after).max(initial=0)),
        "bfloat16_mean_difference_mm": None
        if rounded is None
        else 1e3 * float(np.linalg.norm(rounded - after, axis=-1).mean()),
        "mean_travel_mm": 1e3 * float(np.linalg.norm(after - positions, axis=-1).mean()),
    }


def timed(run: Callable[[], NDArray[np.float32]]) -> tuple[NDArray[np.float32], dict[str, float]]:
    clock, cpu = time.perf_counter(), time.process_time()
    result = run()
    return result, {"wall_s": time.perf_counter() - clock, "cpu_s": time.process_time() - cpu}


if __name__ == "__main__":
    main(tyro.cli(Options))

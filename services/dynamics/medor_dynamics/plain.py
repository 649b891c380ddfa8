"""The paper's way to roll out: one graph at a time, every pair looked at, every edge concatenated.

The reference that `rollout` is tested against and timed beside. It shares the weights and nothing else.
"""

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import KDTree
from torch import Tensor

from medor_dynamics.lengths import OVER_RELAXATION
from medor_dynamics.model import Dynamics
from medor_dynamics.network import Block
from medor_dynamics.preset import HISTORY, PULL_STEPS, STEP_S, STEPS, Preset


@torch.no_grad()
def roll_out_plainly(
    model: Dynamics,
    edges: NDArray[np.int32],
    rest: NDArray[np.float32],
    positions: NDArray[np.float32],
    node: int,
    pull: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Nodes (n, 3) [m] after one pull (3,) of a node, with rest lengths (e,) of the mesh edges (e, 2)."""
    angle = np.arctan2(pull[1], pull[0]) if model.preset.frame == "pull" else 0.0
    to_model = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    x = torch.from_numpy((positions @ to_model.T).astype(np.float32))
    step = torch.from_numpy((to_model @ pull / PULL_STEPS).astype(np.float32))
    history = [torch.zeros_like(x) for _ in range(HISTORY)]
    for number in range(STEPS):
        held = torch.zeros(len(x), dtype=torch.bool)
        if number < PULL_STEPS:
            held[node] = True
            x = torch.where(held[:, None], x + step, x)
            shifted = [step / STEP_S, *(velocity[node] for velocity in history[:-1])]
            history = [torch.where(held[:, None], new, old) for new, old in zip(shifted, history, strict=True)]
        velocity = history[0] + STEP_S * accelerations(model, x, history, held, edges, rest)
        shifted = [velocity, *history[:-1]]
        history = [torch.where(held[:, None], old, new) for old, new in zip(history, shifted, strict=True)]
        before, x = x, torch.where(held[:, None], x, x + STEP_S * velocity)
        for _ in range(model.preset.length_passes):
            x = x + OVER_RELAXATION * corrections(x, held, edges, rest)
        if model.preset.length_passes:
            history[0] = torch.where(held[:, None], history[0], (x - before) / STEP_S)
    return (x.numpy() @ to_model).astype(np.float32)


def accelerations(
    model: Dynamics, x: Tensor, history: list[Tensor], held: Tensor, edges: NDArray[np.int32], rest: NDArray[np.float32]
) -> Tensor:
    """(n, 3) accelerations of one graph [m/s²]."""
    norm, network = model.normalizer, model.network
    pairs = [(a, b, length, 1) for (a, b), length in zip(edges, rest, strict=True)]
    pairs += [(b, a, length, 1) for (a, b), length in zip(edges, rest, strict=True)]
    pairs += [(sender, receiver, 0.0, 0) for sender, receiver in collisions(x.numpy(), edges, model.preset)]
    senders, receivers = (torch.tensor([pair[end] for pair in pairs]) for end in (0, 1))
    lengths, mesh = (torch.tensor([pair[column] for pair in pairs]) for column in (2, 3))
    offset = x[receivers] - x[senders]
    distance = offset.norm(dim=1)
    stretch = torch.where(mesh == 1, distance - lengths, 0.0)
    edge = torch.cat([offset, distance[:, None], stretch[:, None], (1 - mesh)[:, None], mesh[:, None]], dim=1)
    node = torch.cat([*history, x[:, 2:], (~held)[:, None], held[:, None]], dim=1)
    nodes = network.encode_nodes((node - norm.node_mean) / norm.node_scale)
    messages = network.encode_edges((edge.float() - norm.edge_mean) / norm.edge_scale)
    shared = torch.zeros(network.width)
    for block in network.blocks:
        assert isinstance(block, Block)
        nodes_in = nodes
        nodes_out, messages_out, shared_out = pass_messages(block, nodes, messages, shared, senders, receivers)
        nodes, messages, shared = nodes_in + nodes_out, messages + messages_out, shared + shared_out
    return network.decode(nodes_out) * norm.acceleration_scale


def corrections(x: Tensor, held: Tensor, edges: NDArray[np.int32], rest: NDArray[np.float32]) -> Tensor:
    """(n, 3) mean of what the edges at each node ask of it to have their rest lengths again [m]."""
    first, second = torch.from_numpy(edges.T.astype(np.int64))
    offset, free = x[second] - x[first], (~held).float()
    way = offset * (1 - torch.from_numpy(rest) / offset.norm(dim=1).clamp(min=1e-6))[:, None]
    way = way / (free[first] + free[second]).clamp(min=1)[:, None]
    ones = torch.ones(len(way))
    sums = torch.zeros_like(x).index_add(0, first, way).index_add(0, second, -way) * free[:, None]
    counts = torch.zeros(len(x)).index_add(0, first, ones).index_add(0, second, ones)
    return sums / counts.clamp(min=1)[:, None]


def pass_messages(
    block: Block, nodes: Tensor, messages: Tensor, shared: Tensor, senders: Tensor, receivers: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """One block's output: nodes, messages and global vector."""
    to_all = [shared.expand(len(messages), -1)] if block.shared is not None else []
    messages_out = block.edge(torch.cat([nodes[receivers], nodes[senders], messages, *to_all], dim=1))
    received = torch.zeros_like(nodes).index_add(0, receivers, messages_out)
    to_all = [shared.expand(len(nodes), -1)] if block.shared is not None else []
    nodes_out = block.node(torch.cat([nodes, received, *to_all], dim=1))
    if block.shared is None:
        return nodes_out, messages_out, shared
    return nodes_out, messages_out, block.shared(torch.cat([shared, nodes_out.mean(0), messages_out.mean(0)]))


def collisions(x: NDArray[np.float32], edges: NDArray[np.int32], preset: Preset) -> list[tuple[int, int]]:
    """Pairs (sender, receiver) of close nodes."""
    meshed = set() if preset.close_mesh_edges else {(a, b) for pair in edges.tolist() for a, b in (pair, pair[::-1])}
    found = []
    for receiver, near in enumerate(KDTree(x).query_ball_point(x, preset.radius_m)):
        others = [other for other in near if other != receiver and (other, receiver) not in meshed]
        others.sort(key=lambda other: (np.square(x[other].astype(float) - x[receiver]).sum(), other))
        found += [(other, receiver) for other in others[: preset.nearest or None]]
    return found

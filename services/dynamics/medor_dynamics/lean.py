"""The graph network's forward pass for rollouts on a CPU: the same numbers with a fraction of the memory traffic.

Layers are those of `dense`. What lies between them (gathering, adding, summing into receivers) takes one pass each,
in float32 arithmetic over values kept in the network's precision.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numba import types
from numba.extending import overload
from numpy.typing import NDArray
from torch import Tensor

from medor_cloth.kernel import kernel
from medor_dynamics.dense import Dense, DenseMlp
from medor_dynamics.graphs import Wiring
from medor_dynamics.network import Block, GraphNetwork, edge_graphs


class LeanNetwork:
    """A network made ready for inference on a CPU; later changes of its weights are not seen.

    Called as the network is, it gives what the network gives, up to rounding.
    """

    def __init__(self, network: GraphNetwork, dtype: torch.dtype) -> None:
        """`dtype` is the precision of weights and hidden values: float32 or bfloat16.

        Nodes, of which there are few, begin, are summed up and are decoded in float32.
        """
        self._encode_nodes = DenseMlp(network.encode_nodes, torch.float32)
        self._encode_edges = DenseMlp(network.encode_edges, dtype)
        self._decode = DenseMlp(network.decode, torch.float32)
        self._blocks = [LeanBlock(block, dtype) for block in network.blocks if isinstance(block, Block)]
        self._width = network.width

    def __call__(self, nodes: Tensor, edges: Tensor, wiring: Wiring) -> Tensor:
        """(N, 18) node features and (E, 7) edge features -> (N, 3)."""
        with torch.autocast("cpu", enabled=False):  # it has a precision of its own
            return self._forward(nodes, edges, wiring)

    def _forward(self, nodes: Tensor, edges: Tensor, wiring: Wiring) -> Tensor:
        nodes, edges = self._encode_nodes(nodes.float()), self._encode_edges(edges)
        shared = edges.new_zeros(wiring.graphs, self._width)
        nodes_out, hidden = nodes, torch.empty_like(edges)
        for last, block in zip(reversed(range(len(self._blocks))), self._blocks, strict=True):
            nodes_out, shared_out = block(nodes.to(edges.dtype), edges, shared, wiring, hidden, update_edges=last > 0)
            nodes, shared = nodes + nodes_out, shared + shared_out
        return self._decode(nodes_out.float())


class LeanBlock:
    """One round of message passing."""

    def __init__(self, block: Block, dtype: torch.dtype) -> None:
        first, self._second = (Dense.of(block.edge[at], dtype) for at in (0, 2))
        parts = first.weight.t().split(block.width)
        self._receiver, self._sender, self._edge, *self._shared = (part.contiguous() for part in parts)
        self._first_bias = first.bias
        self._third = Dense.of(block.edge[4], torch.float32)
        self._third_weight = self._third.weight.t().to(dtype).contiguous()
        self._node = DenseMlp(block.node, dtype)
        self._global = DenseMlp(block.shared, dtype) if block.shared is not None else None

    def __call__(
        self, nodes: Tensor, edges: Tensor, shared: Tensor, wiring: Wiring, hidden: Tensor, update_edges: bool
    ) -> tuple[Tensor, Tensor]:
        """What nodes (N, width) and global vectors (B, width) gain; edges (E, width) gain theirs in place.

        `hidden` (E, width) is overwritten.
        """
        received = torch.addmm(self._first_bias, nodes, self._receiver)
        if self._shared:
            received += (shared @ self._shared[0])[wiring.graph_of]
        senders, receivers = wiring.senders.numpy(), wiring.receivers.numpy()
        torch.mm(edges, self._edge, out=hidden)
        add_ends_relu(raw(hidden), raw(received), raw(nodes @ self._sender), senders, receivers)
        second = self._second.relu(hidden)
        sums = torch.zeros(nodes.shape, dtype=torch.float32)
        if update_edges:
            torch.mm(second, self._third_weight, out=hidden)
            sum_and_add(raw(hidden), self._third.bias.numpy(), raw(edges), receivers, sums.numpy())
        else:  # nobody asks what single edges become, and the last layer of a sum is the sum of last layers
            sum_into_receivers(raw(second), receivers, sums.numpy())
            received = torch.bincount(wiring.receivers, minlength=len(nodes))
            sums = sums @ self._third.weight.t() + received[:, None] * self._third.bias
        return self._nodes_and_shared(nodes, sums, shared, wiring)

    def _nodes_and_shared(self, nodes: Tensor, sums: Tensor, shared: Tensor, wiring: Wiring) -> tuple[Tensor, Tensor]:
        own = [shared[wiring.graph_of]] if self._global is not None else []
        nodes_out = self._node(torch.cat([nodes, sums.to(nodes.dtype), *own], dim=1))
        if self._global is None:
            return nodes_out, shared
        # Every edge has one receiver: what the nodes of a graph received is what its edges sent.
        per_graph = sums.new_zeros(wiring.graphs, 2, nodes.shape[1])
        per_graph.index_add_(0, wiring.graph_of, torch.stack([nodes_out.float(), sums], dim=1))
        sizes = [torch.bincount(of, minlength=wiring.graphs) for of in (wiring.graph_of, edge_graphs(wiring))]
        means = per_graph / torch.stack(sizes, dim=1).clamp(min=1)[:, :, None]
        return nodes_out, self._global(torch.cat([shared, means.flatten(1).to(shared.dtype)], dim=1))


def raw(values: Tensor) -> NDArray:
    """The memory of float32 values, or of bfloat16 ones as uint16."""
    return values.numpy() if values.dtype == torch.float32 else values.view(torch.uint16).numpy()


def _read(stored: Any) -> Any:
    """A stored value as float32."""
    raise NotImplementedError("for compiled code")


def _stored_like(value: Any, sample: Any) -> Any:
    """A float32 value as it is stored in an array of the sample's type, rounded to nearest even."""
    raise NotImplementedError("for compiled code")


@overload(_read, inline="always")
def _(stored) -> Callable | None:
    if stored == types.uint16:
        return lambda stored: np.uint32(np.uint32(stored) << np.uint32(16)).view(np.float32)
    return lambda stored: stored


@overload(_stored_like, inline="always")
def _(value, sample) -> Callable | None:
    if sample == types.uint16:

        def rounded(value, sample):
            bits = np.float32(value).view(np.uint32)
            even = np.uint32(np.uint32(bits >> np.uint32(16)) & np.uint32(1))
            return np.uint16(np.uint32(bits + np.uint32(0x7FFF) + even) >> np.uint32(16))

        return rounded
    return lambda value, sample: value


@kernel
def add_ends_relu(hidden, received, sent, senders, receivers):
    """What receiver and sender add to the first layer of each edge, and its ReLU, in place."""
    for edge in range(len(hidden)):
        sender, receiver = senders[edge], receivers[edge]
        for c in range(hidden.shape[1]):
            value = _read(hidden[edge, c]) + _read(received[receiver, c]) + _read(sent[sender, c])
            hidden[edge, c] = _stored_like(max(value, np.float32(0)), hidden[edge, c])


@kernel
def sum_and_add(out, bias, edges, receivers, sums):
    """Adds each edge's output, its bias added, to the edge and to its receiver's sum."""
    for edge in range(len(out)):
        receiver = receivers[edge]
        for c in range(out.shape[1]):
            value = _read(out[edge, c]) + bias[c]
            sums[receiver, c] += value
            edges[edge, c] = _stored_like(_read(edges[edge, c]) + value, edges[edge, c])


@kernel
def sum_into_receivers(hidden, receivers, sums):
    """Adds each edge's hidden values to its receiver's sum."""
    for edge in range(len(hidden)):
        receiver = receivers[edge]
        for c in range(hidden.shape[1]):
            sums[receiver, c] += _read(hidden[edge, c])

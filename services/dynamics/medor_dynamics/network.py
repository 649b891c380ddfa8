"""The graph network: features of nodes and edges in, one acceleration per node out (MEDOR, dynamics model)."""

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from medor_dynamics.graphs import Wiring
from medor_dynamics.preset import HISTORY, Preset

NODE_FEATURES = 3 * HISTORY + 3
"""Velocities, height, not picked or picked."""
EDGE_FEATURES = 7
"""Offset, its length, stretch, collision edge or mesh edge."""

LAST_GAIN = 0.25
"""Spread of a new network's outputs against that of its hidden values: with all of it, sums over ten or thirty edges
a round grow without bounds; with torch's own start, far less gets through and learning takes several times as long."""


class GraphNetwork(nn.Module):
    """Encoders, blocks of message passing and a decoder, all of one width.

    The last block's nodes are decoded as they come out of it, without what went in.
    """

    def __init__(self, preset: Preset) -> None:
        super().__init__()
        width = preset.width
        self.width = width
        self.encode_nodes = mlp(NODE_FEATURES, width, width)
        self.encode_edges = mlp(EDGE_FEATURES, width, width)
        self.blocks = nn.ModuleList(Block(width, preset.global_vector) for _ in range(preset.blocks))
        self.decode = mlp(width, width, 3)

    def forward(self, nodes: Tensor, edges: Tensor, wiring: Wiring) -> Tensor:
        """(N, 18) node features and (E, 7) edge features -> (N, 3)."""
        nodes, edges = self.encode_nodes(nodes), self.encode_edges(edges)
        shared = nodes.new_zeros(wiring.graphs, self.width)
        *inner, last = self.blocks
        for block in inner:
            nodes_out, edges_out, shared_out = block(nodes, edges, shared, wiring)
            nodes, edges, shared = nodes + nodes_out, edges + edges_out, shared + shared_out
        return self.decode(last(nodes, edges, shared, wiring)[0])


class Block(nn.Module):
    """One round: edges read their ends, nodes read their incoming edges, the global vector reads them all."""

    def __init__(self, width: int, global_vector: bool) -> None:
        super().__init__()
        reads = 1 if global_vector else 0
        self.width = width
        self.edge = mlp((3 + reads) * width, width, width)
        self.node = mlp((2 + reads) * width, width, width)
        self.shared = mlp(3 * width, width, width) if global_vector else None

    def forward(self, nodes: Tensor, edges: Tensor, shared: Tensor, wiring: Wiring) -> tuple[Tensor, Tensor, Tensor]:
        edges_out = self.edge[1:](self._first_edge_layer(nodes, edges, shared, wiring))
        received = torch.zeros_like(nodes, dtype=edges_out.dtype).index_add_(0, wiring.receivers, edges_out)
        own = [shared[wiring.graph_of]] if self.shared is not None else []
        nodes_out = self.node(torch.cat([nodes, received, *own], dim=1))
        if self.shared is None:
            return nodes_out, edges_out, shared
        of_nodes = mean_over(nodes_out, wiring.graph_of, wiring)
        of_edges = mean_over(edges_out, edge_graphs(wiring), wiring)
        return nodes_out, edges_out, self.shared(torch.cat([shared, of_nodes, of_edges], dim=1))

    def _first_edge_layer(self, nodes: Tensor, edges: Tensor, shared: Tensor, wiring: Wiring) -> Tensor:
        """The layer over (receiver, sender, edge, global), each part projected where there is fewest of it."""
        layer = self.edge[0]
        assert isinstance(layer, nn.Linear)
        receiver, sender, edge, *of_shared = layer.weight.split(self.width, dim=1)
        received = F.linear(nodes, receiver)
        if of_shared:
            received = received + F.linear(shared, of_shared[0])[wiring.graph_of]
        hidden = F.linear(edges, edge, layer.bias)
        hidden += received.index_select(0, wiring.receivers)
        hidden += F.linear(nodes, sender).index_select(0, wiring.senders)
        return hidden


def mlp(size: int, hidden: int, out: int) -> nn.Sequential:
    """Two hidden layers that keep the spread of what goes through them, and a last layer that begins small."""
    layers = nn.Linear(size, hidden), nn.Linear(hidden, hidden), nn.Linear(hidden, out)
    for layer in layers[:-1]:
        nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
    nn.init.normal_(layers[-1].weight, std=LAST_GAIN / hidden**0.5)
    for layer in layers:
        nn.init.zeros_(layer.bias)
    return nn.Sequential(layers[0], nn.ReLU(), layers[1], nn.ReLU(), layers[2])


def mean_over(values: Tensor, graph_of: Tensor, wiring: Wiring) -> Tensor:
    """(B, width) mean over the rows of each graph; 0 where it has none."""
    sums = values.new_zeros(wiring.graphs, values.shape[1]).index_add_(0, graph_of, values)
    counts = torch.bincount(graph_of, minlength=wiring.graphs).clamp(min=1)
    return sums / counts[:, None].to(sums.dtype)


def edge_graphs(wiring: Wiring) -> Tensor:
    """(E,) graph of each edge."""
    return wiring.graph_of[wiring.receivers]

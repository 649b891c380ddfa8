import numpy as np
import pytest
import torch

from medor_recon.completion.scatter import nearest_node, nodes_of, sample, scatter_max


@pytest.mark.parametrize("node", [(1, 3, 6), (0, 0, 7), (7, 2, 0)])
def test_the_query_at_a_node_reads_that_node(node):
    volume = torch.zeros(1, 1, 8, 8, 8)
    volume[(0, 0, *node)] = 1
    assert sample(volume, torch.tensor([[node]]) / 7).item() == pytest.approx(1, abs=1e-5)
    exchanged = torch.tensor([[node[::-1]]]) / 7
    assert sample(volume, exchanged).item() == pytest.approx(0, abs=1e-5)


def test_what_is_scattered_is_sampled_where_it_was():
    rng = np.random.default_rng(0)
    node = torch.from_numpy(rng.permutation(6**3)[:20])
    nocs = torch.stack([node // 36, node // 6 % 6, node % 6], dim=1) / 5
    features = torch.from_numpy(rng.random((20, 4)))
    volume = scatter_max(features, nocs, torch.zeros(20, dtype=torch.long), 1, 6)
    torch.testing.assert_close(sample(volume, nocs[None].float())[0], features.float())


def test_nodes_run_like_a_flattened_volume():
    volume = torch.rand(1, 2, 5, 5, 5)
    torch.testing.assert_close(sample(volume, nodes_of(5)[None])[0].T, volume[0].flatten(1))


def test_sampling_a_linear_volume_is_exact_and_constant_beyond_the_border():
    line = torch.linspace(0, 1, 5)
    volume = torch.stack(torch.meshgrid(line, line, line, indexing="ij"))[None]
    queries = torch.rand(1, 30, 3)
    torch.testing.assert_close(sample(volume, queries), queries)
    torch.testing.assert_close(sample(volume, torch.tensor([[[1.4, -0.3, 0.5]]])), torch.tensor([[[1.0, 0.0, 0.5]]]))


def test_a_cell_keeps_the_largest_value_of_each_feature_and_empty_cells_are_zero():
    nocs = torch.tensor([[0.49, 0.5, 0.5], [0.51, 0.5, 0.5], [0.5, 0.5, 0.5], [0.0, 0.0, 1.0]])
    features = torch.tensor([[-3.0, 1.0], [-2.0, 5.0], [-2.5, 2.0], [7.0, 7.0]])
    item = torch.tensor([0, 0, 0, 1])
    volume = scatter_max(features, nocs, item, 2, 5)
    assert volume[0, :, 2, 2, 2].tolist() == [-2, 5]
    assert volume[1, :, 0, 0, 4].tolist() == [7, 7]
    assert (volume != 0).sum() == 4


def test_points_belong_to_their_nearest_node():
    points = torch.rand(500, 3)
    nearest = nodes_of(4)[((nodes_of(4)[None] - points[:, None]).norm(dim=2)).argmin(dim=1)]
    torch.testing.assert_close(nearest_node(points, 4) / 3, nearest)


def test_gradient_reaches_the_winner_only():
    features = torch.tensor([[1.0], [2.0]], requires_grad=True)
    scatter_max(features, torch.full((2, 3), 0.5), torch.zeros(2, dtype=torch.long), 1, 3).sum().backward()
    assert features.grad is not None
    assert features.grad.flatten().tolist() == [0, 1]

"""Point clouds: what is chosen of them and who is whose neighbour."""

import numpy as np
import torch

from medor_recon.canonical.pointnet import PointNet, ball, farthest_points

CLOUD = np.random.default_rng(0).random((300, 3)).astype(np.float32)


def test_farthest_points_cover_the_cloud_better_than_chance():
    chosen = farthest_points(CLOUD, 30)
    assert len(set(chosen.tolist())) == 30
    assert chosen[0] == 0
    assert _reach(CLOUD[chosen]) < 0.8 * _reach(CLOUD[:30])
    second = np.linalg.norm(CLOUD - CLOUD[0], axis=1).argmax()
    assert chosen[1] == second


def test_a_ball_holds_only_what_is_within_its_radius():
    centres = np.arange(40)
    members = ball(CLOUD, centres, 0.2, 8)
    distance = np.linalg.norm(CLOUD[members] - CLOUD[centres][:, None], axis=2)
    assert distance.max() <= 0.2
    everyone = (np.linalg.norm(CLOUD[centres][:, None] - CLOUD, axis=2) <= 0.2).sum(1)
    assert [len(set(row)) for row in members.tolist()] == np.minimum(everyone, 8).tolist()


def test_features_go_with_their_points():
    torch.manual_seed(0)
    network, cloud = PointNet().eval(), torch.from_numpy(CLOUD)[None]
    features = network(cloud)
    assert features.shape == (1, 300, 128)
    moved = torch.cat([cloud[:, :1], cloud[:, 1:].flip(1)], 1)  # the first point is where choosing starts
    other = network(moved)
    nearby = (features[:, 1:].flip(1) - other[:, 1:]).abs().mean()
    assert nearby < 0.2 * (features - features.flip(1)).abs().mean()


def _reach(points):
    return np.linalg.norm(CLOUD[:, None] - points, axis=2).min(1).max()

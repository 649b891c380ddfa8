from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from medor_cloth.cluster import cluster
from medor_cloth.dataset import Dataset
from medor_dynamics.evaluate import motionless_errors, rigid_errors
from medor_dynamics.node_mesh import NodeMesh
from medor_dynamics.preset import CPU, PAPER, PULL_STEPS, STEP_S, STEPS
from medor_dynamics.samples import Recording, Sampler, recordings, seen, stretches


def drawn(recording: Recording, size: int = 4, seed: int = 3, **options: Any):
    return Sampler([recording], size=size, seed=seed, **options).draw(0)


def test_a_batch_depends_on_seed_and_step_alone(folded):
    sampler = Sampler([folded], size=4, noise=0.1, mirror=True, seed=3)
    same, other = sampler.draw(7), sampler.draw(8)
    np.testing.assert_array_equal(sampler.draw(7).motion.velocities, same.motion.velocities)
    assert not np.array_equal(other.motion.velocities, same.motion.velocities)


def test_what_is_learnt_leads_from_the_history_to_the_target(folded):
    for first in range(STEPS):
        batch = stretches([folded], [first], [folded.before(first)], 1)
        here = folded.positions[first]
        np.testing.assert_array_equal(batch.motion.positions, here)
        np.testing.assert_array_equal(batch.targets[0], folded.positions[first + 1])
        before = here if first == 0 else folded.positions[first - 1]
        np.testing.assert_allclose(batch.motion.velocities[:, 0] * STEP_S, here - before, atol=1e-6)
        assert (len(batch.grips[0].nodes) == 1) == (first < PULL_STEPS)


def test_before_the_action_the_cloth_lies_still(folded):
    batch = stretches([folded], [2], [folded.before(2)], 1)
    assert batch.motion.velocities[:, :2].abs().max() > 0
    assert batch.motion.velocities[:, 2:].abs().max() == 0


def test_the_node_held_follows_the_picker(folded):
    travelled = folded.positions[PULL_STEPS, folded.node] - folded.positions[0, folded.node]
    np.testing.assert_allclose(travelled, PULL_STEPS * folded.step, atol=0.01)


def test_noise_is_of_the_size_asked_for_and_moves_the_target_along(folded):
    plain, noisy = drawn(folded, size=64), drawn(folded, size=64, noise=0.2)
    error = (noisy.motion.velocities - plain.motion.velocities).numpy()
    assert error[:, 0].std() == pytest.approx(0.2, rel=0.1)
    assert error[:, 4].std() == pytest.approx(0.2 / np.sqrt(5), rel=0.1)
    shift = noisy.motion.positions - plain.motion.positions
    np.testing.assert_allclose(noisy.targets[0] - plain.targets[0], shift, atol=1e-6)
    held = plain.graphs.starts[:-1] + folded.node
    assert error[held].max() == 0


def test_a_mirror_changes_sides_and_nothing_else(folded):
    mirrored = folded.mirrored()
    np.testing.assert_array_equal(mirrored.mirrored().positions, folded.positions)
    np.testing.assert_allclose(rigid_errors([mirrored]), rigid_errors([folded]), rtol=1e-6)
    np.testing.assert_array_equal(mirrored.positions[..., 1], -folded.positions[..., 1])


def test_turning_keeps_lengths_and_heights(folded):
    turned = folded.turned(1.1)
    np.testing.assert_allclose(turned.positions[..., 2], folded.positions[..., 2])
    np.testing.assert_allclose(motionless_errors([turned]), motionless_errors([folded]), atol=1e-6)
    assert np.linalg.norm(turned.step) == pytest.approx(np.linalg.norm(folded.step))


def test_what_the_camera_does_not_see_is_left_out(folded):
    visible = np.arange(folded.positions.shape[1]) % 3 > 0
    visible[folded.node] = False
    part = seen(folded, visible)
    np.testing.assert_array_equal(part.positions[:, part.node], folded.positions[:, folded.node])
    assert part.positions.shape[1] == visible.sum() + 1
    ends = part.positions[0][part.edges]
    np.testing.assert_allclose(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1), part.rest, atol=1e-6)


@pytest.mark.parametrize("preset", [CPU, PAPER, replace(CPU, rest="true")])
def test_a_trajectory_of_a_data_set_as_the_model_sees_it(tmp_path, sheet, write_shard, preset):
    mesh = sheet(side=0.1, panels=True)
    nodes = NodeMesh.over(mesh.vertices, cluster(mesh.vertices, mesh.faces))
    pull = np.array([0.03, 0.04, 0.05], np.float32)
    squeezed = mesh.vertices * np.array([0.9, 1, 1], np.float32)
    frames = squeezed + np.linspace(0, 1, STEPS + 1, dtype=np.float32)[:, None, None] * pull
    write_shard(tmp_path, mesh, frames, np.stack([squeezed[0], squeezed[0] + pull]), nodes)
    (seen_by_model,) = recordings(Dataset(tmp_path), preset)
    assert seen_by_model.positions.shape == (STEPS + 1, len(nodes.ids), 3)
    total = seen_by_model.positions[-1] - seen_by_model.positions[0]
    expected = [0.05, 0, 0.05] if preset.frame == "pull" else pull
    np.testing.assert_allclose(total, np.broadcast_to(expected, total.shape), atol=2e-4)
    np.testing.assert_allclose(seen_by_model.step * PULL_STEPS, expected, atol=1e-6)
    shape = mesh.vertices if preset.rest == "true" else squeezed
    ends = shape[nodes.ids][nodes.edges]
    np.testing.assert_allclose(seen_by_model.rest, np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1), atol=1e-4)

import numpy as np
import pytest

from medor_cloth.dataset import Dataset
from medor_cloth.garment import Garment
from medor_cloth.goals import solver_of
from medor_cloth.picker import GLANCE_FRAMES, pick_place
from medor_dynamics.coarse import Coarse
from medor_dynamics.evaluate import motionless_errors
from medor_dynamics.node_mesh import NodeMesh
from medor_dynamics.physics import Physics
from medor_dynamics.preset import CPU
from medor_dynamics.replay import replay_errors
from medor_dynamics.samples import recordings
from medor_dynamics.sheet import WIDTH_PX
from medor_dynamics.sheet import sheet as picture_of


@pytest.fixture
def recorded(tmp_path, sheet, write_shard) -> Dataset:
    """The corner of a sheet pulled over the rest of it."""
    mesh = sheet(side=0.15, panels=True)
    solver = solver_of(Garment("tshirt", 1, mesh.vertices, mesh.faces, mesh.panel_uv))
    pick = mesh.vertices[0] + np.array([0, 0, 0.01], np.float32)
    move = np.stack([pick, pick + np.array([0.12, 0.1, 0.05], np.float32)])
    frames = pick_place(solver, solver.rest(mesh.vertices), *move, record_every=5).frames
    frames = np.concatenate([mesh.vertices[None], frames, np.repeat(frames[-1:], 16, axis=0)])[:17]
    write_shard(tmp_path, mesh, frames, move, NodeMesh.of(mesh))
    return Dataset(tmp_path)


def test_the_solver_that_recorded_a_pull_repeats_it(recorded):
    (error,) = replay_errors(Physics(1, settle_frames=GLANCE_FRAMES), recorded.garments)
    assert error == pytest.approx(0, abs=2e-3)


def test_the_coarse_cloth_is_off_but_foresees_more_than_nothing(recorded):
    (rough,) = replay_errors(Coarse(1), recorded.garments)
    assert 0 < rough < 0.5 * motionless_errors(recordings(recorded, CPU))[0, -1]


def test_a_sheet_shows_the_pull_and_what_was_foreseen_of_it(recorded):
    (pull,) = recorded.garments[0].trajectories()
    picture = picture_of([pull, pull], {"coarse solver": Coarse(1)})
    assert picture.shape == (2 * WIDTH_PX, 3 * WIDTH_PX, 3)
    np.testing.assert_array_equal(picture[:WIDTH_PX], picture[WIDTH_PX:])
    before, after, foreseen = (picture[:, k * WIDTH_PX : (k + 1) * WIDTH_PX].astype(int) for k in range(3))
    assert np.abs(before - after).mean() > np.abs(foreseen - after).mean() > 0

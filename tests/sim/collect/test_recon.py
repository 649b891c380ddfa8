import numpy as np

from medor_cloth.raster import Raster, rasterize
from medor_sim.collect.recon import CAMERA, OBSERVATIONS, nocs_map


def test_shapes_and_units(recon_data):
    for trajectory in recon_data:
        assert trajectory["depth"].shape == trajectory["mask"].shape == (OBSERVATIONS, 200, 200)
        np.testing.assert_array_equal(trajectory["mask"], trajectory["depth"] > 0)
        assert not trajectory["nocs"][~trajectory["mask"]].any()
        cloth = trajectory["depth"][trajectory["mask"]]
        assert cloth.min() > 0.45
        assert cloth.max() < 0.651


def test_all_particles_are_in_view(recon_data):
    for trajectory in recon_data:
        assert CAMERA.contains(trajectory["positions"]).all()


def test_depth_is_that_of_the_stored_positions(recon_data):
    trajectory = recon_data[0]
    for depth, positions in zip(trajectory["depth"], trajectory["positions"], strict=True):
        again = rasterize(positions, trajectory.garment["faces"], CAMERA).depth
        both = (depth > 0) & (again > 0)
        assert (both == (depth > 0)).mean() > 0.999
        assert np.median(np.abs(depth - again)[both]) < 2e-4


def test_labels_lead_back_to_the_vertex_seen(recon_data):
    """Canonical point of a pixel -> place on the canonical mesh -> same place on the posed mesh -> the pixel.

    Positions are stored to 0.05 mm; at one pixel in a thousand that decides which of two layers is the upper one.
    """
    trajectory = recon_data[0]
    record = trajectory.garment
    faces, canonical = record["faces"], record.garment.vertices.astype(np.float64)
    seen = rasterize(trajectory["positions"][-1], faces, CAMERA)
    pixels = np.argwhere(seen.mask & trajectory["mask"][-1])
    points = record.box.decode(trajectory["nocs"][-1][tuple(pixels.T)])
    ends = np.empty((len(pixels), 2))
    for i, (pixel, point) in enumerate(zip(pixels, points, strict=True)):
        corners = canonical[faces[seen.face[tuple(pixel)]]]
        weights = np.linalg.lstsq(np.vstack([corners.T, np.ones(3)]), np.append(point, 1), rcond=None)[0]
        posed = weights @ trajectory["positions"][-1][faces[seen.face[tuple(pixel)]]]
        column, row = CAMERA.project(posed)[0]
        ends[i] = row, column
    off = np.abs(ends - pixels - 0.5).max(axis=1)
    assert len(off) > 1000
    assert np.mean(off < 0.3) > 0.998


def test_a_pixel_at_a_corner_of_a_face_has_the_label_of_its_vertex(scene):
    faces = scene.garment.faces
    corners = np.broadcast_to(np.eye(3, dtype=np.float32), (len(faces), 3, 3))
    shown = np.repeat(np.arange(len(faces), dtype=np.int32)[:, None], 3, 1)
    labels = nocs_map(Raster(np.ones(shown.shape, np.float32), shown, corners), faces, scene.nocs)
    np.testing.assert_array_equal(labels, scene.nocs[faces])


def test_drops_and_flat_starts_both_occur_and_moves_are_recorded(recon_data):
    moves = np.stack([trajectory["moves"] for trajectory in recon_data])
    assert np.isfinite(moves[:, 1:]).all()
    dropped = np.isnan(moves[:, 0]).all(axis=(1, 2))
    assert (dropped | np.isfinite(moves[:, 0]).all(axis=(1, 2))).all()

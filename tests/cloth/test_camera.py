import numpy as np
import pytest

from medor_cloth.camera import Camera, overhead


def tilted() -> Camera:
    c, s = np.cos(0.6), np.sin(0.6)
    T = np.array([[1, 0, 0, 0.1], [0, -c, -s, 0.3], [0, s, -c, 0.8], [0, 0, 0, 1]])
    K = np.array([[300.0, 0.0, 150.0], [0.0, 310.0, 110.0], [0.0, 0.0, 1.0]])
    return Camera(K, T, 320, 240)


def test_overhead_frames_agree_with_the_table():
    camera = overhead(720)
    uv, depth = camera.project(np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]))
    np.testing.assert_allclose(depth, 0.65)
    np.testing.assert_allclose(uv[0], [360, 360])
    assert uv[1, 0] > 360
    assert uv[1, 1] == pytest.approx(360)
    assert uv[2, 1] < 360
    assert uv[2, 0] == pytest.approx(360)
    assert camera.K[0, 0] == pytest.approx(869.1, abs=0.1)


def test_200_pixels_span_538_mm_of_table():
    camera = overhead(200)
    table = camera.back_project(np.full((200, 200), 0.65))
    np.testing.assert_allclose(table[..., 2], 0, atol=1e-6)
    pixel = table[0, 1, 0] - table[0, 0, 0]
    assert pixel * 200 == pytest.approx(0.538, abs=5e-4)


@pytest.mark.parametrize("camera", [overhead(60), tilted()], ids=["overhead", "tilted"])
def test_projecting_what_was_back_projected_returns_pixel_centres_and_depth(camera):
    depth = np.random.default_rng(0).uniform(0.3, 0.9, (camera.height, camera.width))
    uv, projected_depth = camera.project(camera.back_project(depth))
    i, j = np.indices(depth.shape)
    np.testing.assert_allclose(uv, np.stack([j + 0.5, i + 0.5], axis=-1), atol=1e-3)
    np.testing.assert_allclose(projected_depth, depth, atol=1e-6)


def test_unmeasured_pixels_have_no_point():
    depth = np.full((8, 8), 0.6)
    depth[2, 3] = 0
    missing = np.isnan(overhead(8).back_project(depth)).sum(axis=-1) == 3
    assert missing[2, 3]
    assert missing.sum() == 1


def test_contains_is_the_image_and_only_in_front():
    camera = overhead(720)
    half = 0.65 * np.tan(np.radians(22.5))
    points = np.array([[0, 0, 0], [half - 1e-4, 0, 0], [half + 1e-4, 0, 0], [0, -half - 1e-4, 0], [0, 0, 1.3]])
    assert camera.contains(points).tolist() == [True, True, False, False, False]
    # Nearer to the camera less of the world is in view.
    assert not camera.contains(np.array([half - 1e-4, 0, 0.1]))


def test_resizing_keeps_the_view():
    camera, small = overhead(720), overhead(720).resized(200, 200)
    points = np.random.default_rng(1).uniform(-0.2, 0.2, (50, 3))
    np.testing.assert_allclose(small.project(points)[0], camera.project(points)[0] * (200 / 720))
    np.testing.assert_allclose(small.K, overhead(200).K)


def test_bad_matrices_are_refused():
    with pytest.raises(ValueError, match="T_world_camera"):
        Camera(np.eye(3), np.eye(3), 10, 10)
    with pytest.raises(ValueError, match="depth image"):
        overhead(10).back_project(np.zeros((5, 10)))

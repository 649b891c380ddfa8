import numpy as np
import trimesh

from medor_cloth.camera import Camera, overhead
from medor_cloth.portrait import captioned, portrait, vertex_normals, with_arrow

from .sheets import sheet

CAMERA = overhead(96)


def lying(columns=8, rows=8, height=0.01):
    vertices, faces = sheet(columns, rows)
    return vertices - vertices.mean(0) + np.array([0, 0, height], np.float32), faces


def brightness(picture):
    return picture.astype(float).mean(-1)


def test_the_two_sides_of_the_cloth_are_told_apart():
    vertices, faces = lying()
    upward = (
        np.cross(vertices[faces[0, 1]] - vertices[faces[0, 0]], vertices[faces[0, 2]] - vertices[faces[0, 0]])[2] > 0
    )
    outside, inside = (
        portrait(vertices, f, CAMERA)[48, 48].astype(int) for f in (faces, faces[:, ::-1])[:: 1 if upward else -1]
    )
    assert outside[0] > outside[2] + 40
    assert inside[2] > inside[0] + 20


def test_what_is_beside_and_under_a_layer_lies_in_its_shadow():
    vertices, faces = lying(height=0.03)
    light = brightness(portrait(vertices, faces, CAMERA))
    edge = int(CAMERA.project(np.array([vertices[:, 0].min(), 0, 0.03]))[0][0])
    assert light[48, edge - 2] < 0.8 * light[48, 15]


def test_the_picture_turns_with_cloth_and_camera():
    rng = np.random.default_rng(0)
    vertices, faces = lying()
    vertices = vertices + rng.normal(0, 0.002, vertices.shape).astype(np.float32)
    turn = np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    turned = Camera(CAMERA.K, turn @ CAMERA.T_world_camera, CAMERA.width, CAMERA.height)
    straight = portrait(vertices, faces, CAMERA).astype(int)
    difference = portrait((vertices @ turn[:3, :3].T).astype(np.float32), faces, turned).astype(int) - straight
    assert np.percentile(np.abs(difference), 99.5) <= 2


def test_normals_of_a_ball_point_away_from_its_middle():
    ball = trimesh.creation.icosphere(subdivisions=3)
    np.testing.assert_allclose(vertex_normals(ball.vertices, ball.faces), ball.vertices, atol=0.02)


def test_without_a_table_there_is_nothing_but_the_cloth():
    vertices, faces = lying()
    assert len(np.unique(portrait(vertices, faces, CAMERA, table=False)[:10].reshape(-1, 3), axis=0)) == 1
    assert len(np.unique(portrait(vertices, faces, CAMERA)[:10].reshape(-1, 3), axis=0)) > 1, "lines every 10 cm"


def test_captions_and_arrows_change_only_their_place():
    blank = np.zeros((96, 96, 3), np.uint8)
    assert not captioned(blank, "7/9")[:70].any()
    assert captioned(blank, "7/9")[70:].any()
    move = np.array([[0, 0, 0.01], [0.1, 0, 0.01]], np.float32)
    rows, columns = np.nonzero(with_arrow(blank, move, CAMERA).any(-1))
    (left, right), middle = CAMERA.project(move)[0][:, 0], 48
    assert abs(rows - middle).max() <= 6
    assert left - 6 <= columns.min() < columns.max() <= right + 6
    assert with_arrow(blank, np.full((2, 3), np.nan), CAMERA) is blank

import numpy as np
import pytest
import trimesh

from medor_cloth.errors import ClothError
from medor_cloth.footage import Footage, load, of_garment
from medor_cloth.garment import generate
from medor_cloth.goals import solver_of

from .sheets import sheet

VERTICES, FACES = sheet(3, 2)


@pytest.fixture(scope="module")
def skirt():
    return generate("skirt", 5, 0.03)


def test_a_saved_state_with_faces_is_shown_as_it_was(tmp_path, skirt):
    state = solver_of(skirt).rest(skirt.laid_flat())
    np.savez(tmp_path / "state.npz", faces=skirt.faces, **state.to_arrays())  # type: ignore[arg-type]
    footage = load(tmp_path / "state.npz")
    np.testing.assert_array_equal(footage.states, state.positions[None])
    np.testing.assert_array_equal(footage.faces, skirt.faces)
    assert not footage.worn


def test_a_state_without_faces_takes_the_garments(tmp_path, skirt):
    rollout = np.stack([skirt.laid_flat() + np.float32(0.01 * k) for k in range(4)])
    np.save(tmp_path / "rollout.npy", rollout)
    np.testing.assert_array_equal(load(tmp_path / "rollout.npy", garment=skirt).states, rollout)
    with pytest.raises(ClothError, match=r"no `faces`.*--category and --seed"):
        load(tmp_path / "rollout.npy")
    np.save(tmp_path / "few.npy", rollout[:, :20])
    with pytest.raises(ClothError, match="there are 20"):
        load(tmp_path / "few.npy", garment=skirt)


@pytest.mark.parametrize("kind", ["obj", "ply", "glb", "stl"])
def test_any_mesh_file_will_do_even_one_that_cannot_be_cloth(tmp_path, kind):
    ball = trimesh.creation.icosphere(subdivisions=1)
    ball.export(tmp_path / f"ball.{kind}")
    footage = load(tmp_path / f"ball.{kind}")
    assert footage.worn, "reaches below the table"
    assert len(footage.faces) == len(ball.faces)
    np.testing.assert_allclose(np.sort(footage.states[0].ravel())[[0, -1]], [-1, 1], atol=1e-5)


def test_generated_garments_are_worn_or_lie_flat(skirt):
    worn = of_garment("skirt", 5, "worn", 0.03)
    np.testing.assert_array_equal(worn.states[0], skirt.vertices)
    assert worn.worn
    flat = of_garment("skirt", 5, "flat", 0.03)
    assert not flat.worn
    assert flat.states[..., 2].max() < 0.02 < np.ptp(worn.states[..., 1])


def write(path, **arrays):
    np.savez(path, **arrays)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "content", "complaint"),
    [
        ("missing.obj", None, "does not exist"),
        ("notes.txt", b"cloth", r"cannot show notes.txt: expected a mesh \(.obj"),
        ("broken.glb", b"not a mesh", "not a readable .glb file"),
        ("broken.npz", b"not an archive", "not a readable .npz file"),
        ("empty.obj", b"# nothing\n", "empty"),
        ("a.npz", {"faces": FACES}, r"an array `positions`, got faces \(12, 3\)"),
        ("b.npz", {"positions": VERTICES[:, :2], "faces": FACES}, r"expected positions \(V,3\)"),
        ("c.npz", {"positions": VERTICES * np.nan, "faces": FACES}, "not finite"),
        ("d.npz", {"positions": VERTICES, "faces": FACES + 5}, "faces name vertices 5…16, there are 12"),
        ("e.npz", {"positions": VERTICES, "faces": FACES * 1.0}, "whole numbers"),
    ],
)
def test_what_cannot_be_shown_is_said_plainly(tmp_path, name, content, complaint):
    path = tmp_path / name
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content:
        write(path, **content)
    with pytest.raises(ClothError, match=complaint):
        load(path)


def test_a_folder_is_a_data_set_or_nothing(tmp_path):
    with pytest.raises(ClothError, match="no shards"):
        load(tmp_path)


def test_captions_count_the_states_and_tell_the_time():
    footage = Footage("pull", np.repeat(VERTICES[None], 3, 0), FACES, seconds=0.05)
    assert [footage.caption(k) for k in range(3)] == ["pull  1/3  0.00 s", "pull  2/3  0.05 s", "pull  3/3  0.10 s"]
    assert Footage("cloth", VERTICES[None], FACES).caption(0) == "cloth"

import numpy as np
from scipy.ndimage import label, rotate

from medor_sim.collect.harris import harris_corners, harris_response


def square(size=60):
    mask = np.zeros((200, 200), bool)
    mask[70 : 70 + size, 60 : 60 + size] = True
    return mask


def test_corners_of_a_square_are_its_four_corners():
    corners = harris_corners(square())
    spots, count = label(corners)  # type: ignore[misc]
    centres = np.array([np.argwhere(spots == k + 1).mean(0) for k in range(count)])
    expected = np.array([[70, 60], [70, 119], [129, 60], [129, 119]])
    assert count == 4
    np.testing.assert_allclose(centres, expected, atol=4)


def test_corners_lie_on_the_mask_and_away_from_straight_hems():
    mask = square()
    corners = harris_corners(mask)
    assert not (corners & ~mask).any()
    assert not corners[80:120].any()
    assert not corners[:, 70:110].any()


def test_a_quarter_turn_turns_the_corners():
    mask = rotate(square().astype(float), 20, reshape=False, order=1) > 0.5
    np.testing.assert_array_equal(harris_corners(np.rot90(mask)), np.rot90(harris_corners(mask)))


def test_hems_answer_negatively_and_corners_positively():
    response = harris_response(square())
    assert response[100, 60] < 0
    assert response[70, 60] > 0
    assert response[100, 90] == response[5, 5] == 0

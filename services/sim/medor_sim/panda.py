"""How the Panda picks and places: approach, descend, close, pull, open, retreat, all of it planned before it moves.

The pull is the flying picker's: from the same point straight to the same place, as fast between the ramps, slower where
a joint could not follow.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from medor_cloth.integration import FRAME_S
from medor_cloth.picker import PULL_FRAMES
from medor_sim.arm import OPEN_M, PARKED, Arm
from medor_sim.kinematics import Poses, forward, solve
from medor_sim.trajectory import Line, Rest, Segment, Transit, frames
from medor_wire.errors import OutOfReach, Refused

OVER_M, RISE_M = 0.12, 0.03
"""The tool comes and leaves straight from this high over the table, at least so much over its goal [m]."""
STRAIGHT_SPEED = 0.25
"""Of the tool coming down and leaving [m/s]."""
CLOSED_M = 0.0025
"""Half of the gap between fingers closed on cloth."""
GRIP_S = 0.1
"""Time to open or to close, at the gripper's 0.2 m/s."""
PULL_S = PULL_FRAMES * FRAME_S
"""Time of the flying picker's pull, whatever its length."""
SHORTEST_M = 1e-4
"""A shorter pull stays where it is."""
STATIONS = 33
"""Points of a straight way that are tried."""


@dataclass(frozen=True)
class Motion:
    """One pick-and-place of the arm, frame by frame of 0.01 s.

    Attributes:
        joints: (T,7) at the end of each frame [rad].
        openings: (T,) half of the gap between the fingers [m].
        holding: (T,) whether the fingers hold what they closed on.
        poses: Where the tool is, (T,).
        done: Frames until it has left the cloth; after them it only returns.
        stretch: How much longer the pull takes than its speed and ramps ask for, for the joints' sake.
    """

    joints: NDArray[np.float64]
    openings: NDArray[np.float64]
    holding: NDArray[np.bool_]
    poses: Poses
    done: int
    stretch: float

    @property
    def seconds(self) -> float:
        """How long all of it takes."""
        return len(self.joints) * FRAME_S


class _Leg(NamedTuple):
    segment: Segment
    opening: float
    """Half of the fingers' gap at its end [m]."""
    holding: bool = False


def hovering(points: NDArray) -> NDArray[np.float64]:
    """From where the tool comes straight down to points (...,3) [m], and to where it leaves them."""
    over = np.array(points, np.float64)
    over[..., 2] = np.maximum(over[..., 2] + RISE_M, OVER_M)
    return over


def plan(arm: Arm, pick: NDArray, place: NDArray) -> Motion:
    """The motion from where the arm stands by way of pick and place (3,) [m] to where it parks. Nothing moves.

    Raises:
        OutOfReach: the joints do not allow it.
        Refused: it would touch the table or itself.
    """
    pick, place = np.asarray(pick, np.float64), np.asarray(place, np.float64)
    _within_reach(arm, pick, place)
    pull = _pull(arm, pick, place)
    motion = _joined(arm, [*_arrival(arm, pick), _Leg(pull, CLOSED_M, holding=True), *_departure(arm, place)])
    _keep_clear(arm, motion)
    return motion


def _within_reach(arm: Arm, pick: NDArray, place: NDArray) -> None:
    along = np.linspace(0, 1, STATIONS)[:, None]
    ways = {
        "pick": pick[None],
        "place": place[None],
        "way down to the pick": hovering(pick) + along * (pick - hovering(pick)),
        "way from pick to place": pick + along * (place - pick),
        "way up from the place": place + along * (hovering(place) - place),
    }
    for name, points in ways.items():
        beyond = ~solve(points, arm.base).within | (points[:, 2] < 0)
        if beyond.any():
            raise OutOfReach(f"{name}: the arm cannot bring its tool to {points[beyond.argmax()].round(4).tolist()} m")


def _posture(arm: Arm, point: NDArray) -> NDArray[np.float64]:
    return solve(point[None], arm.base).joints[0]


def _arrival(arm: Arm, pick: NDArray) -> Iterator[_Leg]:
    """To the pick from wherever it stands: low, if a stop left it so."""
    here, start, over = arm.tool, arm.joints, hovering(pick)
    if here[2] < OVER_M:
        yield _Leg(Line(here, hovering(here), STRAIGHT_SPEED, arm.base), OPEN_M)
        start = _posture(arm, hovering(here))
    yield _Leg(Transit(start, _posture(arm, over)), OPEN_M)
    yield _Leg(Line(over, pick, STRAIGHT_SPEED, arm.base), OPEN_M)
    yield _Leg(Rest(_posture(arm, pick), GRIP_S), CLOSED_M)


def _pull(arm: Arm, pick: NDArray, place: NDArray) -> Line | Rest:
    length = float(np.linalg.norm(place - pick))
    return Line(pick, place, length / PULL_S, arm.base) if length > SHORTEST_M else Rest(_posture(arm, pick), PULL_S)


def _departure(arm: Arm, place: NDArray) -> Iterator[_Leg]:
    over = hovering(place)
    yield _Leg(Rest(_posture(arm, place), GRIP_S), OPEN_M)
    yield _Leg(Line(place, over, STRAIGHT_SPEED, arm.base), OPEN_M)
    yield _Leg(Transit(_posture(arm, over), PARKED), OPEN_M)


def _joined(arm: Arm, legs: list[_Leg]) -> Motion:
    """Legs one after the other; each begins with a whole frame."""
    joints = [frames(leg.segment) for leg in legs]
    counts = [len(q) for q in joints]
    gaps = np.array([OPEN_M, *(leg.opening for leg in legs)])
    ends = np.cumsum([0, *counts])
    every = np.concatenate(joints)
    stretch = max((leg.segment.stretch for leg in legs if leg.holding and isinstance(leg.segment, Line)), default=1.0)
    return Motion(
        joints=every,
        openings=np.interp(np.arange(1, len(every) + 1), ends, gaps),
        holding=np.repeat([leg.holding for leg in legs], counts),
        poses=forward(every, arm.base),
        done=len(every) - counts[-1],
        stretch=stretch,
    )


def _keep_clear(arm: Arm, motion: Motion) -> None:
    """Try every frame; the arm ends as it stood.

    Raises:
        Refused: says what would touch what.
    """
    stood = arm.joints
    try:
        for number, (joints, opening) in enumerate(zip(motion.joints, motion.openings, strict=True)):
            arm.move_to(joints, opening)
            if (touched := arm.touched()) is not None:
                at = motion.poses.points[number].round(3).tolist()
                raise Refused(f"would collide: with the tool at {at} m, {touched}")
    finally:
        arm.move_to(stood)

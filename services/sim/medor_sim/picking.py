"""Who picks: the flying picker or the Panda, with the same grasp and the same release on the same cloth."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from medor_cloth.picker import pull
from medor_sim.fingers import Fingers
from medor_sim.grasp_failures import Grasp, NextLayer
from medor_sim.panda import Motion
from medor_sim.scene import Pulled, Scene, Touch

Check = Callable[[], None]


def by_picker(scene: Scene, pick: NDArray, place: NDArray, grasp: Grasp, check: Check) -> Pulled:
    """The scene after a pick-and-place of MEDOR's flying gripper."""
    path = pull(pick, place)
    holding = np.full(len(path), grasp != "missed")
    return scene.carried(pick, path, holding, check, list(_second_layer(scene, grasp)))


def by_panda(scene: Scene, motion: Motion, grasp: Grasp, check: Check, watch: Sequence[Touch] = ()) -> Pulled:
    """The scene after a motion of the arm, whose fingers push what they meet.

    The cloth is at rest, and time passes for it only from where it is first touched or held until the arm has left it.
    Frames are counted from the motion's begin. `watch` is shown the cloth after every one of them.
    """
    fingers = Fingers(motion.poses, motion.openings)
    grip = int(motion.holding.argmax())
    first = next((f for f in range(1, grip) if fingers.touch(f, scene.cloth.positions)), grip)
    walk = slice(first, motion.done)
    touches = [*_second_layer(scene, grasp), fingers.push, *watch]
    tool, holding = motion.poses.points, motion.holding & (grasp != "missed")
    from_first = [lambda frame, cloth, touch=touch: touch(first + frame, cloth) for touch in touches]
    pulled = scene.carried(tool[first - 1], tool[walk], holding[walk], check, from_first)
    return pulled._replace(walked=first + pulled.walked)


def _second_layer(scene: Scene, grasp: Grasp) -> Iterator[Touch]:
    if grasp == "two layers":
        yield NextLayer(scene.piece.engine.cloth.edges).follow

"""How the joints get from one posture to another: jerk-limited, within what Franka Robotics allows the Panda's joints.

`Transit` goes freely, `Line` takes the tool along a straight line. Both begin and end at rest.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from ruckig import InputParameter, Ruckig
from ruckig import Trajectory as Profile
from scipy.interpolate import make_interp_spline

from medor_cloth.integration import FRAME_S
from medor_sim.kinematics import N_JOINTS, solve

VELOCITY = np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61])
ACCELERATION = np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0])
JERK = np.array([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0])
"""Limits of the joints [rad/s, rad/s², rad/s³], as Franka Robotics states them."""
TRANSIT_SHARE = 0.5
"""Of these limits that free moves use."""
TOOL_ACCELERATION, TOOL_JERK = 3.0, 100.0
"""Of the tool along a line [m/s², m/s³]: up to 0.4 m/s in 0.16 s."""
KNOTS = 65
"""Postures computed along a line; a quintic spline passes through them."""
INSTANTS = 400
"""Moments of a line at which the joints are held against their limits."""


class Segment(Protocol):
    """A motion from rest to rest."""

    @property
    def duration(self) -> float:
        """[s]."""
        ...

    def joints(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Joint angles (T,7) [rad] at times (T,) [s]."""
        ...


def frames(segment: Segment) -> NDArray[np.float64]:
    """Joint angles (T,7) [rad] at the ends of the frames of 0.01 s; what is left of the last one it rests."""
    count = int(np.ceil(segment.duration / FRAME_S - 1e-9))
    return segment.joints(np.minimum(np.arange(1, count + 1) * FRAME_S, segment.duration))


class Transit:
    """The quickest way of all joints from one posture to another (7,) [rad], within a share of their limits."""

    def __init__(self, start: NDArray[np.float64], end: NDArray[np.float64], share: float = TRANSIT_SHARE) -> None:
        self._profile = _profile(start, end, share * VELOCITY, share * ACCELERATION, share * JERK)
        self.duration: float = self._profile.duration

    def joints(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array([self._profile.at_time(time)[0] for time in times])


class Line:
    """The tool along a straight line at a steady speed, with ramps; slower where a joint could not follow.

    Slower means all of it by one factor: that divides velocities by it, accelerations by its square, jerks by its cube.

    Args:
        start: Where the tool is (3,) [m].
        end: Where it goes (3,) [m].
        speed: Of the tool between the ramps [m/s].
        base: Foot of the arm (3,) [m].
    """

    def __init__(self, start: NDArray, end: NDArray, speed: float, base: NDArray) -> None:
        length = float(np.linalg.norm(np.asarray(end) - start))
        along = np.linspace(0, 1, KNOTS)
        postures = solve(start + along[:, None] * (np.asarray(end) - start), base)
        self._spline = make_interp_spline(along, postures.joints, k=5)
        self._profile = _profile([0.0], [1.0], *(np.array([[speed], [TOOL_ACCELERATION], [TOOL_JERK]]) / length))
        self.stretch = max(1.0, self._haste(TOOL_JERK / length))
        """How much longer it takes than the tool's own limits ask for."""
        self.duration: float = self._profile.duration * self.stretch

    def joints(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._spline([self._profile.at_time(time / self.stretch)[0][0] for time in times])

    def _haste(self, jerk: float) -> float:
        """How many times too fast the joints would be."""
        times = np.linspace(0, self._profile.duration, INSTANTS)
        s, v, a = (np.array(x)[:, :1] for x in zip(*map(self._profile.at_time, times), strict=True))
        first, second, third = (np.abs(self._spline(s[:, 0], nu=n)) for n in (1, 2, 3))
        a = np.abs(a)
        speed = (first * v / VELOCITY).max()
        acceleration = ((second * v**2 + first * a) / ACCELERATION).max()
        jolt = ((third * v**3 + 3 * second * v * a + first * jerk) / JERK).max()
        return float(max(speed, np.sqrt(acceleration), np.cbrt(jolt)))


class Rest:
    """Staying where it is (7,) [rad] for a while [s]."""

    def __init__(self, joints: NDArray[np.float64], duration: float) -> None:
        self._joints = joints
        self.duration = duration

    def joints(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.broadcast_to(self._joints, (len(times), N_JOINTS))


def _profile(start, end, velocity, acceleration, jerk) -> Profile:
    """Time-optimal jerk-limited profile from rest to rest."""
    asked = InputParameter(len(start))
    asked.current_position, asked.target_position = list(start), list(end)
    asked.max_velocity, asked.max_acceleration, asked.max_jerk = list(velocity), list(acceleration), list(jerk)
    profile = Profile(len(start))
    result = Ruckig(len(start)).calculate(asked, profile)
    if result.value < 0:
        raise ValueError(f"no trajectory from {start} to {end}: {result}")
    return profile

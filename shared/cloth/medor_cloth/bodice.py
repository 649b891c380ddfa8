"""The upper part of a garment: neckline, shoulders, sleeves and side seams of T-shirts, dresses and jumpsuits."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from medor_cloth.outline import Curve, bezier, fillet, join, line, mirror

SIDE_CLEARANCE = 0.035
"""How far beyond the side seam a sleeve's cuff must lie, human scale [m]."""
STRAP = 0.045
"""Least width of a shoulder: about one mesh edge at the robot's scale, human scale [m]."""


@dataclass(frozen=True)
class Bodice:
    """Measures of the upper body, human scale [m]; widths are half widths; y = 0 at the neck point."""

    neck: float
    slope: float  # of shoulder and sleeve below the horizontal [rad]
    shoulder: float
    chest: float
    armhole: float
    sleeve: float  # length, 0 without sleeves
    cuff: float
    underarm_radius: float
    neckline: str
    front_depth: float
    back_depth: float

    @classmethod
    def sample(cls, rng: np.random.Generator, sleeves: tuple[float, float, float]) -> Self:
        """Random measures; `sleeves` are the probabilities of no, short and long sleeves."""
        neck, armhole = rng.uniform(0.075, 0.125), rng.uniform(0.20, 0.27)
        shoulder = rng.uniform(0.17, 0.23)
        kind = rng.choice(3, p=sleeves)
        sleeve = (0.0, rng.uniform(0.06, 0.24), rng.uniform(0.30, 0.52))[kind]
        if kind == 0:
            shoulder = max(neck + STRAP, shoulder - rng.uniform(0.0, 0.06))
        cuff = np.interp(sleeve, (0.05, 0.55), (armhole * 0.86, 0.11)) * rng.uniform(0.9, 1.3)
        return cls(
            neck=neck,
            slope=np.radians(rng.uniform(2, 18)),
            shoulder=shoulder,
            chest=rng.uniform(0.215, 0.30),
            armhole=armhole,
            sleeve=sleeve,
            cuff=min(cuff, armhole * 0.95),
            underarm_radius=rng.uniform(0.03, 0.12),
            neckline=str(rng.choice(("round", "v", "square", "boat"), p=(0.5, 0.25, 0.1, 0.15))),
            front_depth=rng.uniform(0.06, 0.17),
            back_depth=rng.uniform(0.015, 0.05),
        )

    def neck_curve(self, front: bool) -> Curve:
        """The neckline from left to right; the back is always round."""
        neck, depth = self.neck, self.front_depth if front else self.back_depth
        match self.neckline if front else "round":
            case "v":
                return line((-neck, 0), (0, -depth), (neck, 0))
            case "square":
                return line((-neck, 0), (-0.92 * neck, -depth), (0.92 * neck, -depth), (neck, 0))
            case "boat":
                return bezier((-neck, 0), (0, -2 * depth), (neck, 0))
        t = np.linspace(np.pi, 2 * np.pi, 31)
        return np.column_stack([neck * np.cos(t), depth * np.sin(t)])

    def right_side(self, below: Curve) -> dict[str, Curve]:
        """The right edges, counter-clockwise (upwards): side seam, cuff, shoulder.

        Args:
            below: (n, 2) the side seam below the underarm, downwards, without the underarm point.
        """
        shoulder, cuff, side = self._sleeved(below) if self.sleeve else self._sleeveless(below)
        return {"side_right": side[::-1], "cuff_right": cuff[::-1], "shoulder_right": shoulder[::-1]}

    def outline(self, front: bool, below: Curve, bottom: dict[str, Curve]) -> dict[str, Curve]:
        """A whole panel: `bottom` edges (left to right), right side, neck, left side."""
        right = self.right_side(below)
        return {**bottom, **right, "neck": self.neck_curve(front)[::-1], **mirrored(right)}

    def _sleeveless(self, below: Curve) -> tuple[Curve, Curve, Curve]:
        along, _ = self._arm_axes()
        neck_point, underarm = np.array([self.neck, 0.0]), np.array([self.chest, -self.armhole])
        tip = neck_point + along * (self.shoulder - self.neck)
        inward = 0.55 * (self.chest - tip[0]) + 0.02
        armhole = bezier(tip, tip - (0, 0.45 * self.armhole), underarm - (inward, 0), underarm, samples=32)
        return line(neck_point, tip), armhole, np.vstack([underarm, below])

    def _sleeved(self, below: Curve) -> tuple[Curve, Curve, Curve]:
        along, across = self._arm_axes()
        width = self._cuff_width()
        sine, cosine = np.sin(self.slope), np.cos(self.slope)
        clear = (self.chest + SIDE_CLEARANCE + sine * width - self.neck) / cosine
        neck_point, underarm = np.array([self.neck, 0.0]), np.array([self.chest, -self.armhole])
        tip = neck_point + along * max((self.shoulder - self.neck) / cosine + self.sleeve, clear)
        cuff_end = tip + across * width
        side = join(fillet(cuff_end, underarm, below[0], self.underarm_radius), below)
        return line(neck_point, tip), line(tip, cuff_end), side

    def _cuff_width(self) -> float:
        """The cuff of a short sleeve must not be wider than the armhole, which the shoulder's slope shortens."""
        if self.sleeve >= 0.2:
            return self.cuff
        return min(self.cuff, max(0.09, 0.97 * (self.armhole - np.sin(self.slope) * (self.chest - self.neck))))

    def _arm_axes(self) -> tuple[np.ndarray, np.ndarray]:
        sine, cosine = np.sin(self.slope), np.cos(self.slope)
        return np.array([cosine, -sine]), np.array([-sine, -cosine])


def mirrored(right: dict[str, Curve]) -> dict[str, Curve]:
    """The left edges that continue a counter-clockwise outline after the given right ones."""
    return {name.replace("right", "left"): mirror(curve) for name, curve in reversed(right.items())}

"""The lower part of trousers and jumpsuits: outer seam, hems and inner seam."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from medor_cloth.outline import Curve, bezier, fillet, join, line, mirror


@dataclass(frozen=True)
class Legs:
    """Measures below the waist, human scale [m]; widths are half widths; `top` is the height of the waist."""

    top: float
    waist: float
    hip: float
    rise: float
    leg: float
    spread: float  # of each leg from the vertical [rad]
    thigh: float
    taper: float
    crotch_radius: float
    bell: bool = False

    @classmethod
    def of_trousers(cls, rng: np.random.Generator) -> Self:
        waist = rng.uniform(0.175, 0.235)
        hip = waist + rng.uniform(0.02, 0.07)
        return cls(
            top=0.0,
            waist=waist,
            hip=hip,
            rise=rng.uniform(0.23, 0.34),
            leg=rng.uniform(0.18, 0.76) if rng.random() < 0.8 else rng.uniform(0.08, 0.25),
            spread=np.radians(rng.uniform(13, 30)),
            thigh=hip * rng.uniform(0.95, 1.08),
            taper=rng.uniform(0.55, 1.15),
            crotch_radius=rng.uniform(0.02, 0.06),
            bell=bool(rng.random() < 0.12),
        )

    @classmethod
    def of_jumpsuit(cls, rng: np.random.Generator, chest: float) -> Self:
        waist = chest * rng.uniform(0.82, 1.0)
        hip = max(waist, 0.95 * chest) + rng.uniform(0.01, 0.07)
        return cls(
            top=-rng.uniform(0.36, 0.44),
            waist=waist,
            hip=hip,
            rise=rng.uniform(0.26, 0.38),
            leg=rng.uniform(0.12, 0.80),
            spread=np.radians(rng.uniform(7, 20)),
            thigh=hip * rng.uniform(0.95, 1.08),
            taper=rng.uniform(0.55, 1.1),
            crotch_radius=rng.uniform(0.02, 0.05),
        )

    def outer_seam(self) -> Curve:
        """Right outer seam, from the waist down to the hem."""
        waist, hip = np.array([self.waist, self.top]), np.array([self.hip, self.top - 0.62 * self.rise])
        over_hip = bezier(waist, (self.hip, self.top - 0.3 * self.rise), hip, samples=14)
        return join(over_hip, line(hip, self._hem()[1]))

    def bottom(self) -> dict[str, Curve]:
        """The lower edges, counter-clockwise: left hem, inner seams up to the crotch and down, right hem."""
        inner, outer = self._hem()
        over = fillet(inner * (-1, 1), (0.0, self.top - self.rise), inner, self.crotch_radius)
        crotch = np.array([0.0, np.interp(0.0, over[:, 0], over[:, 1])])
        inseam = np.vstack([crotch, over[over[:, 0] > 1e-9]])
        hem = line(inner, outer)
        return {
            "hem_left": mirror(hem),
            "inseam_left": mirror(inseam),
            "inseam_right": inseam,
            "hem_right": hem,
        }

    def _hem(self) -> tuple[np.ndarray, np.ndarray]:
        """Inner and outer end of the right hem."""
        sine, cosine = np.sin(self.spread), np.cos(self.spread)
        knee_to_ankle = np.interp(self.leg, (0.1, 0.75), (0.98, self.taper))
        width = self.thigh * knee_to_ankle * (1.35 if self.bell else 1.0)
        middle = np.array([self.thigh / 2 + self.leg * sine, self.top - self.rise - self.leg * cosine])
        half = width / 2 * np.array([cosine, sine])
        inner = middle - half
        inner[0] = max(inner[0], 0.012 + 0.25 * self.leg * sine)
        return inner, middle + half

"""Views to learn from and to validate on, true and predicted."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from medor_recon.completion.augment import Example, example
from medor_recon.completion.observations import Observation, Prediction
from medor_recon.completion.predictions import Predictions


@dataclass
class Material:
    """Observations and, if there is a canonicaliser, its views of them.

    Attributes:
        learn: to draw from.
        held_out: of other garments.
        predictions: a frozen canonicaliser's views.
        looks: observations that a validation takes, spread over the held-out ones.
        only_predicted: for networks that read a canonicaliser's features: views with true coordinates have none.
    """

    learn: list[Observation]
    held_out: list[Observation]
    predictions: Predictions | None = None
    looks: int = 100
    only_predicted: bool = False

    def draw(self, predicted: float, rng: np.random.Generator) -> tuple[Observation, Prediction | None]:
        """One observation, as a canonicaliser sees it in a share of the cases."""
        observation = self.learn[rng.integers(len(self.learn))]
        drawn = rng.random() < predicted
        return observation, self.predictions(observation) if self.predictions and drawn else None

    @property
    def looked_at(self) -> list[Observation]:
        """The observations of a validation."""
        spread = np.linspace(0, len(self.held_out) - 1, min(self.looks, len(self.held_out))).round().astype(int)
        return [self.held_out[i] for i in spread]

    def validate(self, measure: Callable[[list[Example]], dict[str, float]], score: str) -> dict[str, float]:
        """Measures of the views with true coordinates, and `predicted_…` with predicted ones.

        The one named `score` becomes the score, predicted if there is a canonicaliser: that is what will be met.
        """
        looked_at = self.looked_at
        metrics = {} if self.only_predicted else measure([example(one) for one in looked_at])
        if self.predictions:
            found = measure([example(one, self.predictions(one)) for one in looked_at])
            metrics |= {f"predicted_{name}": value for name, value in found.items()}
        return metrics | {"score": metrics[f"predicted_{score}" if self.predictions else score]}

"""The error tree of the learning package.

LearnError
├── WeightsError    a folder of weights that does not fit the network, or is not one
├── ResumeError     a run's folder that belongs to another configuration
└── Diverged        the loss is no longer a number
"""


class LearnError(ValueError):
    """Anything the learning package reports on purpose."""


class WeightsError(LearnError):
    """Weights that do not fit."""


class ResumeError(LearnError):
    """A run that cannot be gone on with."""


class Diverged(LearnError):
    """Training that has gone wrong for good."""

"""The error tree of the cloth package, from general to specific.

ClothError
├── MeshError       a mesh that cannot be cloth: what was found and what is needed
├── GarmentError    a garment that cannot be made: unknown category, no valid shape for this seed
└── DatasetError    a data set on disk that is not one: shards that do not belong together
"""


class ClothError(ValueError):
    """Anything the cloth package reports on purpose."""


class MeshError(ClothError):
    """A mesh that cannot be used as cloth."""


class GarmentError(ClothError):
    """A garment that cannot be generated."""


class DatasetError(ClothError):
    """Files that are not one data set."""

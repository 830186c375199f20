"""The texts of the trap files: one rule of MJCF each, in a robot of at most a few joints."""

from . import bodies, classes, geoms, joints, others  # noqa: F401  each module adds its files
from .robots import ASSETS, TRAPS  # noqa: F401

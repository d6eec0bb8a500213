"""Granular materials by discrete elements: element tests of one cell of grains, and pools of such cells for finite-element codes.

==================  ==========================================================================
:class:`Rve`        one cell in this process: ``triaxial``, ``oedometer``, ``simple_shear`` ...
:class:`Pool`       worker processes that answer trials of many points at once
:func:`run`         a whole scene: finite elements whose material law is a packing of grains
:func:`pack`        a packing from a recipe
:func:`calibrate`   contact parameters from a measured curve
==================  ==========================================================================

SI units. Components of stresses and strains are tension positive; pressures and shortenings that are passed as such, and columns
``p``, ``q``, ``deviator`` and ``axial_compression``, are compression positive.
"""

from ._native import build as _build
from ._native import observable_names as _observable_names
from ._native import tangent_names as _tangent_names
from ._program import executable
from .calibration import Calibration, calibrate
from .errors import (
    ElementTestStopped,
    GrainspanError,
    InputError,
    Interrupted,
    NothingToCommit,
    PoolClosed,
    RunFailed,
    StartError,
    TrialRefused,
    WorkersLost,
)
from .fields import Fields, read_fields, read_grains
from .history import History, draw, read_history
from .packing import Packing, pack
from .pool import Pool, States
from .result import (
    DAMPING_CHANGED,
    ELASTIC_INCREMENT,
    EVENT_INCREMENT,
    HANDED_OVER,
    LARGE_OVERLAP,
    NO_LOAD_BEARING_CONTACTS,
    NOT_EQUILIBRATED,
    SKIPPED_NULL_TARGET,
    TANGENT_FALLBACK,
    TANGENT_REGULARISED,
    TrialResult,
)
from .run import Run, run
from .rve import Rve

#: Version, compiler and code generation flags.
build = dict(_build())

__version__ = build["version"]


def tangents() -> list[str]:
    """Keywords of the tangent operators, see docs/concepts/theory.md section 5."""
    return _tangent_names()


def observables() -> list[str]:
    """Names of the observables that a trial computes on request."""
    return _observable_names()


__all__ = [
    "DAMPING_CHANGED",
    "ELASTIC_INCREMENT",
    "EVENT_INCREMENT",
    "HANDED_OVER",
    "LARGE_OVERLAP",
    "NO_LOAD_BEARING_CONTACTS",
    "NOT_EQUILIBRATED",
    "SKIPPED_NULL_TARGET",
    "TANGENT_FALLBACK",
    "TANGENT_REGULARISED",
    "Calibration",
    "ElementTestStopped",
    "Fields",
    "GrainspanError",
    "History",
    "InputError",
    "Interrupted",
    "NothingToCommit",
    "Packing",
    "Pool",
    "PoolClosed",
    "Run",
    "RunFailed",
    "Rve",
    "StartError",
    "States",
    "TrialRefused",
    "TrialResult",
    "WorkersLost",
    "build",
    "calibrate",
    "draw",
    "executable",
    "observables",
    "pack",
    "read_fields",
    "read_grains",
    "read_history",
    "run",
    "tangents",
]

"""Write an RVE engine in Python: one class, and it serves a Grainspan run as a worker.

A user subclasses :class:`Rve` and ends the module with ``main(MyRve)``. Everything else, that is joining the run,
shared memory, messages, states, faults, lies behind it. ``docs/guide/external-engines.md`` in the repository is the tutorial,
``grainspan_worker.engines.reference`` the smallest complete engine.
"""

from .answer import Answer, TrialOptions
from .definition import Definition
from .errors import (
    DefinitionRefused,
    EngineFault,
    NotEquilibrated,
    NotFinite,
    RveError,
    SnapshotRefused,
    StepTooLarge,
    TargetInverted,
    TargetNotFinite,
    TargetTooLarge,
    Unsupported,
)
from .command_line import main
from .rve import Rve

#: Former name of :class:`TrialOptions`, kept for one version.
Ask = TrialOptions

__all__ = [
    "Answer",
    "Ask",
    "Definition",
    "DefinitionRefused",
    "EngineFault",
    "NotEquilibrated",
    "NotFinite",
    "Rve",
    "RveError",
    "SnapshotRefused",
    "StepTooLarge",
    "TargetInverted",
    "TargetNotFinite",
    "TargetTooLarge",
    "TrialOptions",
    "Unsupported",
    "main",
]

__version__ = "0.1.0"

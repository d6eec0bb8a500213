"""The executable that the package carries."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from pathlib import Path

from .errors import StartError

_VARIABLE = "GRAINSPAN_PROGRAM"

#: The C library, loaded before any process is started: between fork and exec there is no safe time for it.
_C_LIBRARY = ctypes.CDLL(None)

#: Number of the operation of ``prctl`` by which the system signals a process when its parent ends.
_SIGNAL_AT_END_OF_PARENT = 1


def end_with_parent() -> None:
    """Called in a process that is started: it is asked to end in good order when this one ends, however that happens.

    Without it, a run that a job script began would go on alone when the scheduler ends the script.
    """
    _C_LIBRARY.prctl(_SIGNAL_AT_END_OF_PARENT, signal.SIGTERM)


def executable() -> Path:
    """Path of the program `grainspan`.

    The environment variable ``GRAINSPAN_PROGRAM`` names another one, built from the same sources as the package: a pool refuses workers of
    another build, whose results may differ.

    Raises
    ------
    StartError
        The package has no executable.
    """
    named = os.environ.get(_VARIABLE)
    place = Path(named) if named else Path(__file__).parent / "bin" / "grainspan"
    if not os.access(place, os.X_OK):
        raise StartError(f"there is no program at {place}; install the package again, or set {_VARIABLE}")
    return place


def main() -> None:
    """Replaces this process by the program; the command ``grainspan`` of an environment."""
    program = str(executable())
    os.execv(program, [program, *sys.argv[1:]])

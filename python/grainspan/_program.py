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
        There is no program that can be started, or the variable names something else.
    """
    named = os.environ.get(_VARIABLE)
    if named:
        return runnable(named, f"{_VARIABLE} has to name the program grainspan")
    return runnable(Path(__file__).parent / "bin" / "grainspan", f"install the package again, or set {_VARIABLE}")


def runnable(program: str | os.PathLike[str], remedy: str) -> Path:
    """The path of a program; a :class:`StartError` with the remedy if it cannot be one."""
    place = Path(program)
    if not place.exists():
        raise StartError(f"there is no program at {place}; {remedy}")
    if place.is_dir():
        raise StartError(f"{place} is a folder and no program; {remedy}")
    if not os.access(place, os.X_OK):
        raise StartError(f"{place} may not be executed; {remedy}")
    return place


def not_started(program: str, error: OSError) -> StartError:
    """The exception for a program that the system does not start."""
    return StartError(f"{program} cannot be started: {error.strerror}; is it the program grainspan, built for this machine?")


def main() -> None:
    """Replaces this process by the program; the command ``grainspan`` of an environment."""
    program = str(executable())
    os.execv(program, [program, *sys.argv[1:]])

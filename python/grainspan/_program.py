"""The executable that the package carries."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from .errors import StartError

_VARIABLE = "GRAINSPAN_PROGRAM"


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

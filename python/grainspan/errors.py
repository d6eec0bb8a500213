"""Exceptions of the package."""

from __future__ import annotations

__all__ = [
    "ElementTestStopped",
    "GrainspanError",
    "InputError",
    "Interrupted",
    "NothingToCommit",
    "PoolClosed",
    "RunFailed",
    "StartError",
    "TrialRefused",
    "WorkersLost",
]


class GrainspanError(Exception):
    """Base of all exceptions of the package."""


class InputError(GrainspanError, ValueError):
    """A packing, table or argument is not what it should be; the text names the place and the remedy."""


class StartError(GrainspanError, RuntimeError):
    """The executable is missing, or channels or workers cannot be made."""


class PoolClosed(GrainspanError, RuntimeError):
    """The pool is closed, or was opened by the process that this one was forked from."""


class WorkersLost(GrainspanError, RuntimeError):
    """No workers are left and none can be started, or one trial has ended several of them."""


class Interrupted(GrainspanError):
    """A call was ended early; committed states are unchanged."""


class NothingToCommit(GrainspanError, RuntimeError):
    """A state has no trial; nothing was committed."""


class TrialRefused(GrainspanError, RuntimeError):
    """A cell refused a trial. Committed states are unchanged, and no trial of the call counts.

    Attributes
    ----------
    point : int
        Place in the call, from 0; with several refusals that of the oldest state.
    curable : bool
        Whether a smaller deformation may avoid it, so that the caller should cut its step.
    """

    def __init__(self, message: str, point: int, curable: bool) -> None:
        super().__init__(message)
        self.point = point
        self.curable = curable


class ElementTestStopped(GrainspanError, RuntimeError):
    """An element test ended before its end.

    Attributes
    ----------
    history : History
        The rows before.
    """

    def __init__(self, message: str, history) -> None:
        super().__init__(message)
        self.history = history


class RunFailed(GrainspanError, RuntimeError):
    """A run of the program ended without its result.

    Attributes
    ----------
    code : int
        Exit code: 1 did not converge, 2 bad input, 3 workers lost, 130 interrupted.
    folder : pathlib.Path
        Output folder; what was accepted before is in it.
    """

    def __init__(self, message: str, code: int, folder) -> None:
        super().__init__(message)
        self.code = code
        self.folder = folder

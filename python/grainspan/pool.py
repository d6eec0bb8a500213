"""A pool of worker processes that answer trials of many points at once."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _arrays, _native
from ._cells import CellText, ContactLike, PackingLike, rve_table
from ._program import executable, runnable
from .errors import InputError
from .packing import Packing
from .result import TrialResult, assembled


class States:
    """Points of a pool, in an order. Slices and index arrays select from them, ``+`` joins them; nothing is copied in the pool."""

    def __init__(self, pool: Pool, numbers: np.ndarray) -> None:
        self._pool = pool
        self.numbers = numbers

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, selection: Any) -> States:
        return States(self._pool, np.atleast_1d(self.numbers[selection]))

    def __add__(self, other: States) -> States:
        if not isinstance(other, States):
            raise InputError(f"States are joined with States, not with {type(other).__name__}")
        if other._pool is not self._pool:
            raise InputError("these states belong to another pool")
        return States(self._pool, np.concatenate([self.numbers, other.numbers]))

    def __repr__(self) -> str:
        return f"<{len(self)} states of a pool>"


class Pool:
    """Worker processes that answer trials: the response of a cell of grains to a deformation from its committed state.

    Every point is a state that the pool keeps. A trial leaves the committed state alone; ``commit`` makes the latest trial the
    committed state, ``rollback`` drops it. Results have the same bits for any number of workers, and those of ``grainspan run``.
    A worker that ends is replaced, and what it worked on is repeated elsewhere.

    Parameters
    ----------
    packings : path, Packing, or sequence of them
        The packings behind the points.
    contact : path, mapping, or sequence of them
        Contact law: keys of the table ``[contact]``, or an input file that has one. One for all packings, or one for each.
    accuracy : {"draft", "default", "tight"}, optional
        Accuracy of the grain solver.
    rve : mapping, optional
        Further keys of the table ``[rve]``.
    workers : int, optional
        Number of worker processes; one per core without.
    wait : {"block", "hybrid", "spin"}, optional
        How both ends wait for messages; the last two trade processor time for latency.
    program : path, optional
        The executable that workers run; that of the package without.

    Examples
    --------
    >>> with grainspan.Pool("packings/discs-400.json", {"modulus": 1e8, "stiffness_ratio": 0.5, "friction": 0.5}) as pool:
    ...     states = pool.states(64)
    ...     result = pool.trial(states, H)
    ...     pool.commit(states)
    """

    def __init__(
        self,
        packings: PackingLike | Sequence[PackingLike],
        contact: ContactLike | Sequence[ContactLike],
        *,
        accuracy: str | None = None,
        rve: Mapping[str, Any] | None = None,
        workers: int | None = None,
        wait: str = "block",
        program: str | os.PathLike[str] | None = None,
    ) -> None:
        several = [packings] if isinstance(packings, (str, os.PathLike, Packing)) else list(packings)
        contacts = [contact] * len(several) if isinstance(contact, (str, os.PathLike, Mapping)) else list(contact)
        if len(contacts) != len(several):
            raise InputError(f"{len(several)} packings, but {len(contacts)} contact tables; give one for all or one for each")
        table = rve_table(accuracy, rve)
        if workers is not None:
            workers = _arrays.whole(workers, "workers", 1)
        place = runnable(program, "`program` has to name the program grainspan") if program is not None else executable()
        with CellText() as text:
            cells = [text.cell(one, law, table) for one, law in zip(several, contacts)]
            self._native = _native.Pool(cells, os.getcwd(), place, workers, wait)

    @property
    def dimension(self) -> int:
        """2 for discs, 3 for spheres."""
        return self._native.dimension

    def states(self, count: int, packing: int = 0) -> States:
        """New points in the initial state of a packing.

        Parameters
        ----------
        count : int
            How many.
        packing : int, optional
            Place of the packing in the list that the pool was opened with.

        Raises
        ------
        InputError
            There is no such packing, or the count is negative, no whole number, or beyond what memory takes.
        """
        count, packing = _arrays.whole(count, "count", 0), _arrays.whole(packing, "packing", 0)
        first = self._native.new_states(packing, count)
        return States(self, np.arange(first, first + count, dtype=np.int64))

    def trial(
        self,
        states: States,
        H: ArrayLike | None = None,
        *,
        F: ArrayLike | None = None,
        tangent: str = "truss_like_slip",
        observables: str | Iterable[str] = (),
        ramp_steps: ArrayLike = 0,
    ) -> TrialResult:
        """Deforms every point from its committed state.

        Parameters
        ----------
        states : States
            The points. A point may stand several times, for example for finite differences; its last trial counts.
        H : array_like, shape (n, d, d) or (d, d)
            Displacement gradients ``F - I`` from the committed configuration of each point.
        F : array_like, optional
            Deformation gradients in place of ``H``. Small strains lose digits this way.
        tangent : str, optional
            Tangent operator, one of ``grainspan.tangents()``; ``"none"`` for the stress alone.
        observables : str or iterable of str, optional
            Further results, of ``grainspan.observables()``.
        ramp_steps : array_like of int, optional
            Increments in which each deformation is applied; 0 lets the cell choose by its ``strain_per_step``. Within the iterations
            of one step of a solver they should not change: the stress is a little different for another number.

        Returns
        -------
        TrialResult

        Raises
        ------
        TrialRefused
            A cell refused its deformation; committed states are unchanged and no trial of the call counts. Its ``point`` is the first
            place of the state in the call.
        WorkersLost
            No workers are left and none can be started.
        """
        self._own(states)
        target = _arrays.gradients(H, F, len(states), self.dimension)
        ramps = _arrays.ramps(ramp_steps, len(states))
        raw = self._native.trial(
            states.numbers.tobytes(), target.tobytes(), tangent, _arrays.names(observables), ramps.tobytes()
        )
        return assembled(_arrays.results(raw, self.dimension))

    def commit(self, states: States) -> None:
        """Makes the latest trials of these points their committed states: all, or none if one has no trial.

        Raises
        ------
        NothingToCommit
            A point has no trial.
        """
        self._own(states)
        self._native.commit(states.numbers.tobytes())

    def rollback(self, states: States) -> None:
        """Drops the trials of these points."""
        self._own(states)
        self._native.rollback(states.numbers.tobytes())

    def snapshot(self, states: States) -> list[bytes]:
        """Committed states of these points as bytes, which stay valid for the same packing and contact law in any process."""
        self._own(states)
        return self._native.snapshot(states.numbers.tobytes())

    def restore(self, states: States, snapshots: Sequence[bytes]) -> None:
        """Replaces the committed states of these points and drops their trials: all, or none in case of an error."""
        self._own(states)
        self._native.restore(states.numbers.tobytes(), list(snapshots))

    @property
    def workers(self) -> list[int]:
        """Process ids of the workers that serve now."""
        return self._native.worker_processes()

    @property
    def statistics(self) -> dict[str, float]:
        """What the pool did so far: counts, and seconds summed over the workers."""
        return dict(self._native.statistics())

    def close(self) -> None:
        """Ends the workers; further calls raise :class:`PoolClosed`. The end of a ``with`` block does the same."""
        self._native.close()

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _own(self, states: States) -> None:
        if not isinstance(states, States):
            raise InputError(f"points are named by the States that Pool.states returns, not by {type(states).__name__}")
        if states._pool is not self:
            raise InputError("these states belong to another pool")

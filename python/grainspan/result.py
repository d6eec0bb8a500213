"""Results of trials."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

#: Bits of ``flags``.
NOT_EQUILIBRATED = 1
TANGENT_FALLBACK = 2
TANGENT_REGULARISED = 4
LARGE_OVERLAP = 8
NO_LOAD_BEARING_CONTACTS = 16
SKIPPED_NULL_TARGET = 32
DAMPING_CHANGED = 64
ELASTIC_INCREMENT = 128
EVENT_INCREMENT = 256
HANDED_OVER = 512


@dataclass(frozen=True)
class TrialResult:
    """Results of n trials of cells of dimension d.

    Attributes
    ----------
    stress : numpy.ndarray
        Cauchy stress, Pa, tension positive, shape (n, d, d).
    tangent : numpy.ndarray or None
        ``C[n, i, j, k, l] = d sigma_ij / d F_kl``, Pa, with F relative to the end of the trial; ``None`` if not requested.
    observables : dict of str to numpy.ndarray
        Always ``void_ratio``, ``coordination_number``, ``unbalanced_force_ratio``, ``max_overlap_ratio`` and ``volume_ratio``, and
        those that were requested; docs/reference/protocol.md describes them.
    flags : numpy.ndarray
        Shortcuts of each trial, one bit each: ``grainspan.NOT_EQUILIBRATED`` ...
    force_evaluations : numpy.ndarray
        Cost of each trial; the same in every run.
    ramp_steps : numpy.ndarray
        Increments in which each deformation was applied.
    seconds : numpy.ndarray
        Time of each trial in its worker; cells that were solved together share it out.
    """

    stress: np.ndarray
    tangent: np.ndarray | None
    observables: dict[str, np.ndarray]
    flags: np.ndarray
    force_evaluations: np.ndarray
    ramp_steps: np.ndarray
    seconds: np.ndarray = field(compare=False)

    def __len__(self) -> int:
        return len(self.stress)

    def has(self, flag: int) -> np.ndarray:
        """For each trial, whether it has a flag, for example ``result.has(grainspan.NOT_EQUILIBRATED)``."""
        return (self.flags & flag) != 0

    def tangent_by_gradient(self, H: np.ndarray) -> np.ndarray:
        """Derivative of the stress by the displacement gradient of the trial.

        The tangent refers to the configuration at the end of the trial. For a linearisation about the gradient ``H`` that was sent,
        ``d sigma_ij / d H_kl = C_ijkm (I + H)^-1_lm``.

        Parameters
        ----------
        H : numpy.ndarray
            The displacement gradients of the trials, shape (n, d, d).

        Returns
        -------
        numpy.ndarray
            Shape (n, d, d, d, d), Pa.
        """
        if self.tangent is None:
            raise ValueError("the trials were made without a tangent; pass tangent='truss_like_slip' or another")
        d = self.stress.shape[-1]
        given = np.asarray(H, dtype=np.float64)
        if given.shape not in (self.stress.shape, (1, d, d), (d, d)):
            raise ValueError(f"gradients of shape {given.shape} do not fit {self.stress.shape}: (points, row, column)")
        inverse = np.linalg.inv(np.eye(d) + given)
        return np.einsum("nijkm,nlm->nijkl", self.tangent, np.broadcast_to(inverse, self.stress.shape))


def assembled(arrays: dict[str, np.ndarray]) -> TrialResult:
    """A result from the arrays of the extension module."""
    arrays = dict(arrays)
    known = {name: arrays.pop(name) for name in ("stress", "flags", "force_evaluations", "ramp_steps")}
    seconds = 1e-9 * arrays.pop("nanoseconds")
    return TrialResult(tangent=arrays.pop("tangent", None), seconds=seconds, observables=arrays, **known)

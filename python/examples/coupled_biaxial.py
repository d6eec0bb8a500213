"""A biaxial test by finite elements of one's own (scikit-fem) whose material is a pool of cells of grains.

Everything that a coupling needs is here: one state per quadrature point, one batch of trials per iteration, a commit when the step has
converged, and smaller steps when a cell refuses its trial. Small strains, so that the elements stay a few lines.

    python coupled_biaxial.py        compares with the same scene run by `grainspan run`
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from skfem import Basis, BilinearForm, ElementQuad1, ElementVector, FacetBasis, LinearForm, MeshQuad, condense, solve

import grainspan


@dataclass(frozen=True)
class Specimen:
    """A block between smooth platens under lateral pressure; SI units."""

    size: tuple[float, float] = (0.05, 0.10)
    elements: tuple[int, int] = (2, 4)
    #: Displacement of the upper platen over all steps, m, downwards.
    shortening: float = 5e-4
    steps: int = 10
    pressure: float = 1e5


@BilinearForm
def stiffness(u, v, w):
    """Virtual work of a change of stress."""
    return np.einsum("ijkl...,kl...,ij...->...", w.moduli, _symmetric(u.grad), v.grad)


@LinearForm
def internal_forces(v, w):
    """Virtual work of the stress."""
    return np.einsum("ij...,ij...->...", w.stress, v.grad)


@LinearForm
def unit_pressure(v, w):
    """Virtual work of a pressure of 1 Pa."""
    return -np.einsum("i...,i...->...", w.n, v)


def _symmetric(gradient):
    return 0.5 * (gradient + np.swapaxes(gradient, 0, 1))


class Coupling:
    """Equilibrium of the specimen, with grains behind its quadrature points."""

    def __init__(self, pool: grainspan.Pool, specimen: Specimen, strain_per_step: float) -> None:
        self.pool, self.specimen, self.strain_per_step = pool, specimen, strain_per_step
        sides = [np.linspace(0.0, length, count + 1) for length, count in zip(specimen.size, specimen.elements)]
        mesh = MeshQuad.init_tensor(*sides)
        element = ElementVector(ElementQuad1())
        # Two by two quadrature points.
        self.basis = Basis(mesh, element, intorder=3)
        self.points = (mesh.nelements, self.basis.X.shape[-1])
        self.states = pool.states(int(np.prod(self.points)))
        width, height = specimen.size
        lateral = mesh.facets_satisfying(lambda x: np.isclose(x[0], 0.0) | np.isclose(x[0], width))
        sides = FacetBasis(mesh, element, facets=lateral)
        self.loads = specimen.pressure * unit_pressure.assemble(sides)
        nodes = mesh.p
        vertical = self.basis.nodal_dofs[1]
        self.top = vertical[np.isclose(nodes[1], height)]
        bottom = vertical[np.isclose(nodes[1], 0.0)]
        corner = self.basis.nodal_dofs[0][np.isclose(nodes[0], 0.0) & np.isclose(nodes[1], 0.0)]
        self.fixed = np.concatenate([self.top, bottom, corner])

    def gradients(self, increment: np.ndarray) -> np.ndarray:
        """Displacement gradients at the quadrature points, (points, 2, 2)."""
        return np.moveaxis(self.basis.interpolate(increment).grad.reshape(2, 2, -1), -1, 0)

    def evaluate(self, increment: np.ndarray, ramps):
        """Out-of-balance force and stiffness for the displacements of a step."""
        gradient = self.gradients(increment)
        H = 0.5 * (gradient + gradient.transpose(0, 2, 1))
        result = self.pool.trial(self.states, H, ramp_steps=ramps)
        moduli = np.moveaxis(result.tangent_by_gradient(H), 0, -1).reshape(2, 2, 2, 2, *self.points)
        stress = np.moveaxis(result.stress, 0, -1).reshape(2, 2, *self.points)
        imbalance = self.loads - internal_forces.assemble(self.basis, stress=stress)
        return imbalance, stiffness.assemble(self.basis, moduli=moduli)

    def ramps(self, predicted: np.ndarray) -> np.ndarray:
        """Increments of each cell, which stay the same in all iterations of a step."""
        largest = np.abs(self.gradients(predicted)).max(axis=(1, 2))
        return np.maximum(1, np.round(largest / self.strain_per_step)).astype(int)

    def step(self, shortening: float, guess: np.ndarray | None, tolerance: float, most_iterations: int = 40):
        """One load step by Newton's method from an extrapolation; the states are committed. Returns displacements and force."""
        increment = np.zeros(self.basis.N) if guess is None else guess.copy()
        increment[self.fixed] = 0.0
        increment[self.top] = -shortening
        free = np.setdiff1d(np.arange(self.basis.N), self.fixed)
        if guess is None:
            imbalance, matrix = self.evaluate(np.zeros(self.basis.N), 0)
            increment = solve(*condense(matrix, imbalance, x=increment, I=free))
        ramps = self.ramps(increment)
        for _ in range(most_iterations):
            imbalance, matrix = self.evaluate(increment, ramps)
            if np.abs(imbalance[free]).max() < tolerance * np.abs(imbalance[self.fixed]).max():
                self.pool.commit(self.states)
                # What the platen exerts on the specimen.
                return increment, -imbalance[self.top].sum()
            increment += solve(*condense(matrix, imbalance, I=free))
        raise RuntimeError("no equilibrium; use more steps")

    def divided(self, shortening: float, guess: np.ndarray | None, tolerance: float, halvings: int = 8):
        """A step, in halves if a cell refuses it. A refusal changes nothing, so the step is simply done again."""
        try:
            return self.step(shortening, guess, tolerance)
        except grainspan.TrialRefused as refused:
            if not refused.curable:
                raise
            if halvings == 0:
                text = f"a cell refuses a shortening of {shortening:.1e} m, and smaller steps do not help: {refused}"
                raise RuntimeError(text) from refused
        half = None if guess is None else 0.5 * guess
        first, _ = self.divided(0.5 * shortening, half, tolerance, halvings - 1)
        second, force = self.divided(0.5 * shortening, first, tolerance, halvings - 1)
        return first + second, force

    def run(self, tolerance: float = 1e-4) -> np.ndarray:
        """The whole test: rows of axial shortening over height, and force of the upper platen, N, tension positive."""
        specimen = self.specimen
        _, force = self.step(0.0, np.zeros(self.basis.N), tolerance)
        rows, increment = [(0.0, force)], None
        size = specimen.shortening / specimen.steps
        for number in range(1, specimen.steps + 1):
            increment, force = self.divided(size, increment, tolerance)
            rows.append((number * size / specimen.size[1], force))
        return np.array(rows)


#: Cells that relax to the last digits and take a strain in few increments: then both iterations end where the solver's tolerance says.
SMOOTH = {"strain_per_step": 1e-3, "tolerance": 1e-9}


def compared(scene: Path, out: Path, workers: int = 1, tolerance: float = 1e-9):
    """The curve of this coupling and that of `grainspan run` for the same specimen, small strains and cells."""
    specimen = Specimen()
    changes = {
        "solver.formulation": "small_strain",
        "solver.force_tolerance": tolerance,
        "solver.displacement_tolerance": 1e-3,
        "loading.max_iterations": 60,
        "loading.increments": specimen.steps,
        # A pressure on the initial geometry, as here.
        "pressure.0.kind": "dead",
        "pressure.1.kind": "dead",
        **{f"rve.{key}": value for key, value in SMOOTH.items()},
    }
    run = grainspan.run(scene, out=out, workers=workers, set=changes, progress=False)
    reference = run.history[["axial_compression", "top_force"]].to_numpy()
    packing = scene.parents[1] / "packings" / "discs-100.json"
    with grainspan.Pool(packing, scene, rve=SMOOTH, workers=workers) as pool:
        return Coupling(pool, specimen, SMOOTH["strain_per_step"]).run(tolerance), reference


if __name__ == "__main__":
    root = Path(__file__).resolve().parents[2]
    with tempfile.TemporaryDirectory() as folder:
        own, reference = compared(root / "scenes" / "biaxial-small.toml", Path(folder) / "out")
    print("shortening   own force, N   grainspan run, N   difference")
    for (strain, force), (_, expected) in zip(own, reference):
        print(f"{strain:10.4f} {force:14.6f} {expected:18.6f} {force / expected - 1:12.1e}")

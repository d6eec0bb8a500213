"""The biaxial test in scikit-fem: the coupling of `coupled_biaxial.py` between rough platens.

python scikit_fem.py OUT.json [WORKERS]
"""

import sys
import time
from pathlib import Path

import biaxial
import numpy as np
import skfem
from skfem import condense, solve

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from coupled_biaxial import Coupling, Specimen, internal_forces, stiffness  # noqa: E402


def main(out: str, workers: int = 1) -> None:
    curve = biaxial.Curve("scikit-fem", skfem.__version__)
    begin = time.perf_counter()
    points = biaxial.ELEMENTS[0] * biaxial.ELEMENTS[1] * 4
    grains = biaxial.Grains(points, workers)
    model = Coupling(grains.pool, Specimen(size=biaxial.SIZE, elements=biaxial.ELEMENTS, pressure=biaxial.PRESSURE), 1.0)
    basis, height = model.basis, biaxial.SIZE[1]
    level = basis.mesh.p[1]
    rough = basis.nodal_dofs[0][np.isclose(level, 0.0) | np.isclose(level, height)]
    fixed = np.union1d(model.fixed, rough)
    free = np.setdiff1d(np.arange(basis.N), fixed)
    increment = np.zeros(basis.N)
    for step in range(biaxial.STEPS + 1):
        increment[fixed] = 0.0
        increment[model.top] = -biaxial.STEP if step else 0.0
        for iteration in range(60):
            gradient = model.gradients(increment)
            stress, moduli = grains.evaluate(0.5 * (gradient + gradient.transpose(0, 2, 1)))
            stress = np.moveaxis(stress, 0, -1).reshape(2, 2, *model.points)
            moduli = np.moveaxis(moduli, 0, -1).reshape(2, 2, 2, 2, *model.points)
            imbalance = model.loads - internal_forces.assemble(basis, stress=stress)
            if np.abs(imbalance[free]).max() < biaxial.TOLERANCE * np.abs(imbalance[fixed]).max():
                break
            increment += solve(*condense(stiffness.assemble(basis, moduli=moduli), imbalance, I=free))
        else:
            raise SystemExit(f"no equilibrium in step {step}")
        grains.commit()
        curve.add(step, -imbalance[model.top].sum(), iteration + 1)
    curve.trials, curve.material_seconds = grains.trials, grains.seconds
    curve.seconds = time.perf_counter() - begin
    curve.write(out)


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:3]))

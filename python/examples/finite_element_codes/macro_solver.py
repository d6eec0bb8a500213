"""The biaxial test by Grainspan's own macro solver: the reference of the other hosts.

python macro_solver.py OUT.json [WORKERS]
"""

import sys
import tempfile
import time
from pathlib import Path

import biaxial
import grainspan


def main(out: str, workers: int = 1) -> None:
    changes = {
        "solver.formulation": "small_strain",
        "solver.strategy": "newton",
        "solver.tangent": "truss_like_slip",
        "solver.force_tolerance": biaxial.TOLERANCE,
        "solver.displacement_tolerance": 1e-6,
        "boundary.0.platen": "rough",
        "boundary.2.platen": "rough",
        "boundary.2.displacement.y": -biaxial.STEP * biaxial.STEPS,
        "pressure.0.kind": "dead",
        "pressure.1.kind": "dead",
        "loading.increments": biaxial.STEPS,
        "loading.max_iterations": 60,
    }
    changes |= {f"rve.{key}": value for key, value in biaxial.RVE.items()}
    curve = biaxial.Curve("Grainspan", grainspan.__version__)
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        run = grainspan.run(biaxial.SCENE, out=Path(folder) / "out", workers=workers, set=changes, progress=False)
        for row in run.history.itertuples():
            curve.add(row.step, row.top_force, row.iterations)
        curve.trials = int(run.history.evaluations.sum())
    curve.seconds = time.perf_counter() - begin
    curve.write(out)


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:3]))

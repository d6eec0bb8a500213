"""The biaxial test in DOLFINx (FEniCSx): stress and moduli are functions on the quadrature points.

python dolfinx_host.py OUT.json [WORKERS]
"""

import ctypes
import sys
import time
from pathlib import Path

import biaxial
import numpy as np

# The wheels of MPI and DOLFINx find each other only with this library loaded first.
library = Path(sys.prefix) / "lib" / "libmpi.so.12"
if library.exists():
    ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)

import basix.ufl  # noqa: E402
import dolfinx  # noqa: E402
import ufl  # noqa: E402
from dolfinx import fem, mesh  # noqa: E402
from mpi4py import MPI  # noqa: E402
from scipy.sparse.linalg import spsolve  # noqa: E402


def main(out: str, workers: int = 1) -> None:
    curve = biaxial.Curve("DOLFINx", dolfinx.__version__)
    begin = time.perf_counter()
    corners = [np.zeros(2), np.array(biaxial.SIZE)]
    domain = mesh.create_rectangle(MPI.COMM_SELF, corners, biaxial.ELEMENTS, mesh.CellType.quadrilateral)
    space = fem.functionspace(domain, ("Lagrange", 1, (2,)))
    measure = ufl.dx(domain, metadata={"quadrature_degree": 2})
    cell = domain.basix_cell()
    on_points = lambda shape: fem.Function(  # noqa: E731
        fem.functionspace(domain, basix.ufl.quadrature_element(cell, value_shape=shape, degree=2))
    )
    stress, moduli = on_points((2, 2)), on_points((2, 2, 2, 2))
    increment = fem.Function(space)
    strain = fem.Expression(ufl.sym(ufl.grad(increment)), basix.make_quadrature(basix.CellType.quadrilateral, 2)[0])
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    i, j, k, l = ufl.indices(4)
    matrix_form = fem.form(moduli[i, j, k, l] * ufl.sym(ufl.grad(u))[k, l] * ufl.grad(v)[i, j] * measure)
    inner = fem.form(ufl.inner(stress, ufl.grad(v)) * measure)
    sides = mesh.locate_entities_boundary(domain, 1, lambda x: np.isclose(x[0], 0.0) | np.isclose(x[0], biaxial.SIZE[0]))
    marks = mesh.meshtags(domain, 1, np.sort(sides), np.ones(len(sides), dtype=np.int32))
    lateral = ufl.ds(domain, subdomain_data=marks)(1)
    loads = fem.assemble_vector(fem.form(-biaxial.PRESSURE * ufl.inner(ufl.FacetNormal(domain), v) * lateral)).array.copy()

    level = space.tabulate_dof_coordinates()[:, 1]
    at = lambda height: np.flatnonzero(np.isclose(level, height))  # noqa: E731
    top = 2 * at(biaxial.SIZE[1]) + 1
    fixed = np.concatenate([2 * at(0.0), 2 * at(0.0) + 1, top - 1, top])
    free = np.setdiff1d(np.arange(2 * len(level)), fixed)
    cells = np.arange(domain.topology.index_map(2).size_local, dtype=np.int32)
    grains = biaxial.Grains(len(cells) * 4, workers)
    for step in range(biaxial.STEPS + 1):
        increment.x.array[fixed] = 0.0
        increment.x.array[top] = -biaxial.STEP if step else 0.0
        for iteration in range(60):
            # Quadrature functions have the same order of cells and points.
            strains = np.asarray(strain.eval(domain, cells)).reshape(-1, 2, 2)
            found = grains.evaluate(strains)
            stress.x.array[:], moduli.x.array[:] = found[0].ravel(), found[1].ravel()
            imbalance = loads - fem.assemble_vector(inner).array
            if np.abs(imbalance[free]).max() < biaxial.TOLERANCE * np.abs(imbalance[fixed]).max():
                break
            matrix = fem.assemble_matrix(matrix_form).to_scipy().tocsr()
            increment.x.array[free] += spsolve(matrix[free][:, free].tocsc(), imbalance[free])
        else:
            raise SystemExit(f"no equilibrium in step {step}")
        grains.commit()
        curve.add(step, -imbalance[top].sum(), iteration + 1)
    curve.trials, curve.material_seconds = grains.trials, grains.seconds
    curve.seconds = time.perf_counter() - begin
    curve.write(out)


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:3]))

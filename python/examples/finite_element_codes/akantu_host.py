"""The biaxial test in Akantu: a material written in Python, which gets all points of the mesh in one call.

python akantu_host.py OUT.json [WORKERS]
"""

import os
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import akantu as aka
import biaxial
import block
import numpy as np


class GrainMaterial(aka.Material):
    """Stress and moduli from a pool of cells. Strains are those from the last committed step."""

    grains = None
    committed = None

    def __init__(self, model, name):
        super().__init__(model, name)
        self.moduli = self.strain = None

    def initMaterial(self):
        super().initMaterial()

    def computeStress(self, element_type, ghost_type):
        gradient = np.array(self.getGradU(element_type, ghost_type)).reshape(-1, 2, 2)
        self.strain = 0.5 * (gradient + gradient.transpose(0, 2, 1))
        if self.committed is None:
            GrainMaterial.committed = np.zeros_like(self.strain)
        stress, self.moduli = self.grains.evaluate(self.strain - self.committed)
        self.getStress(element_type, ghost_type).reshape(-1, 2, 2)[:] = stress

    def computeTangentModuli(self, element_type, tangent, ghost_type):
        # Rows and columns xx, yy, xy; shear strains doubled.
        pairs = [(0, 0), (1, 1), (0, 1)]
        room = tangent.reshape(-1, 3, 3)
        for row, (i, j) in enumerate(pairs):
            for column, (k, l) in enumerate(pairs):
                whole = self.moduli + self.moduli.transpose(0, 2, 1, 3, 4)
                whole = whole + whole.transpose(0, 1, 2, 4, 3)
                room[:, row, column] = 0.25 * whole[:, i, j, k, l]

    def getPushWaveSpeed(self, element):
        # Only dynamics would need it.
        return 1.0


def mesh_file(folder: Path) -> Path:
    """The mesh as Gmsh writes it."""
    nodes, elements = block.nodes(), block.elements()
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(nodes))]
    lines += [f"{place} {x!r} {y!r} 0" for place, (x, y) in enumerate(nodes, 1)]
    lines += ["$EndNodes", "$Elements", str(len(elements))]
    for place, corners in enumerate(elements, 1):
        lines.append(f"{place} 3 2 1 1 " + " ".join(str(corner + 1) for corner in corners))
    path = folder / "block.msh"
    path.write_text("\n".join([*lines, "$EndElements"]) + "\n", encoding="ascii")
    return path


def main(out: str, workers: int = 1) -> None:
    curve = biaxial.Curve("Akantu", version("akantu"))
    begin = time.perf_counter()
    # Akantu takes the moduli of a material for symmetric.
    points = biaxial.ELEMENTS[0] * biaxial.ELEMENTS[1] * 4
    grains = biaxial.Grains(points, workers, tangent="truss_like_released")
    GrainMaterial.grains = grains
    aka.MaterialFactory.getInstance().registerAllocator("grains", lambda _dim, _, model, name: GrainMaterial(model, name))
    mesh = aka.Mesh(2)
    with tempfile.TemporaryDirectory() as folder:
        mesh.read(str(mesh_file(Path(folder))))
        settings = Path(folder) / "material.dat"
        settings.write_text("material grains [\n  name = grains\n  rho = 2600\n]\n", encoding="ascii")
        aka.parseInput(str(settings))
    model = aka.SolidMechanicsModel(mesh)
    model.initFull(_analysis_method=aka._static)
    solver = model.getNonLinearSolver()
    solver.set("max_iterations", 60)
    solver.set("convergence_type", aka.SolveConvergenceCriteria.residual)

    position, displacement = mesh.getNodes(), model.getDisplacement()
    blocked, load = model.getBlockedDOFs(), model.getExternalForce()
    x, y = position[:, 0], position[:, 1]
    width, height = biaxial.SIZE
    bottom, top = np.isclose(y, 0.0), np.isclose(y, height)
    blocked[bottom | top, :] = True
    # Half an element's side at the corners.
    share = biaxial.PRESSURE * height / biaxial.ELEMENTS[1] * np.where(bottom | top, 0.5, 1.0)
    load[:, 0] = np.where(np.isclose(x, 0.0), share, 0.0) - np.where(np.isclose(x, width), share, 0.0)
    for step in range(biaxial.STEPS + 1):
        displacement[top, 1] = -step * biaxial.STEP
        # Akantu compares with the first residual of a step: at rest the small imbalance of the packing, later of the size of reactions.
        solver.set("threshold", biaxial.TOLERANCE if step else 1e-4)
        before = grains.trials
        model.solveStep()
        material = model.getMaterial("grains")
        # The step has ended: what the last call tried is accepted.
        grains.commit()
        GrainMaterial.committed = material.strain
        force = -np.array(model.getInternalForce())[top, 1].sum()
        curve.add(step, force, (grains.trials - before) // len(grains.states))
    curve.trials, curve.material_seconds = grains.trials, grains.seconds
    curve.seconds = time.perf_counter() - begin
    curve.write(out)
    grains.pool.close()


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:3]))
    # Akantu keeps the allocator beyond the end of the interpreter and would end with a segmentation fault.
    os._exit(0)

"""Writes a cell that Yade has saved as a packing file: yade -j1 -n -x export.py (reads 0.yade.gz)"""

import json

from yade import *

O.load("0.yade.gz")
cell = O.cell.hSize
forces = [contact.phys.shearForce.norm() for contact in O.interactions if contact.isReal]
if max(forces) > 0.0:
    raise SystemExit("the cell was prepared with friction: its tangential forces would be lost")
packing = {
    "format": "grainspan-packing",
    "version": 1,
    "dimension": 2,
    "thickness": cell[2, 2],
    # Columns of hSize are the cell vectors.
    "periodicity": [[cell[0, 0], cell[1, 0]], [cell[0, 1], cell[1, 1]]],
    "grains": [[body.state.pos[0], body.state.pos[1], body.shape.radius] for body in O.bodies],
}
contact = next(contact for contact in O.interactions if contact.isReal)
first, second = (O.bodies[index].shape.radius for index in (contact.id1, contact.id2))
law = {
    "modulus": contact.phys.kn * (first + second) / (2.0 * first * second),
    "stiffness_ratio": contact.phys.ks / contact.phys.kn,
    "friction": contact.phys.tangensOfFrictionAngle,
}
with open("packing.json", "w") as file:
    json.dump(packing, file)
with open("law.json", "w") as file:
    json.dump(law, file)

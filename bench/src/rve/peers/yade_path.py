"""Strains a grainspan packing in Yade at a constant rate: yade -j1 -n -x yade_path.py OPTIONS.json

Writes the stress (tension positive, averaged over the cell) at equal strain intervals as CSV, and the processor time of
the run as JSON beside it. Velocities start at zero; contacts start without tangential force.
"""

import json
import math
import sys
import time

from yade import *

with open(sys.argv[1]) as file:
    options = json.load(file)
with open(options["packing"]) as file:
    packing = json.load(file)
flat = packing["dimension"] == 2
rows = packing["periodicity"]
largest = max(grain[-1] for grain in packing["grains"])
# Yade is three-dimensional: a plane cell becomes a layer whose thickness no grain can bridge.
depth = 4.0 * largest
cell = [row + [0.0] for row in rows] + [[0.0, 0.0, depth]] if flat else rows
thickness = depth / packing.get("thickness", 1.0) if flat else 1.0

O.periodic = True
# Columns of hSize are the cell vectors.
O.cell.hSize = Matrix3(*[cell[column][row] for row in range(3) for column in range(3)])
material = O.materials.append(
    FrictMat(
        young=options.get("young", 1.0),
        poisson=options.get("poisson", 0.2),
        density=1.0,
        frictionAngle=math.atan(options["friction"]),
    )
)
for grain in packing["grains"]:
    place = (grain[0], grain[1], 0.5 * depth) if flat else tuple(grain[:3])
    body = sphere(place, grain[-1], material=material)
    if flat:
        body.state.blockedDOFs = "zXY"
    O.bodies.append(body)

if options["law"] == "linear":
    physics = Ip2_FrictMat_FrictMat_FrictPhys(
        kn=MatchMaker(algo="val", val=options["normal_stiffness"]),
        ks=MatchMaker(algo="val", val=options["tangential_stiffness"]),
    )
    law = Law2_ScGeom_FrictPhys_CundallStrack()
else:
    physics = Ip2_FrictMat_FrictMat_MindlinPhys()
    law = Law2_ScGeom_MindlinPhys_Mindlin()

O.dt = options["time_step"]
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb()], allowBiggerThanPeriod=True, verletDist=0.05),
    InteractionLoop([Ig2_Sphere_Sphere_ScGeom()], [physics], [law]),
    NewtonIntegrator(damping=options["damping"]),
]
O.step()  # finds the contacts; nothing has moved yet
start = O.iter

gradient = options["velocity_gradient"]
total = int(round(options["strain"] / (options["rate"] * O.dt)))
interval = max(1, total // options["rows"])
output = open(options["output"], "w")
output.write("strain,xx,yy,zz,xy,yz,xz\n")


def record():
    stress = getStress() * thickness
    values = [stress[0, 0], stress[1, 1], stress[2, 2], stress[0, 1], stress[1, 2], stress[0, 2]]
    strain = options["rate"] * O.dt * (O.iter - start)
    output.write(",".join("%.10e" % value for value in [strain] + values) + "\n")


record()
O.engines = O.engines + [PyRunner(command="record()", iterPeriod=interval)]
O.cell.velGrad = Matrix3(*[options["rate"] * value for row in gradient for value in row])
begin = time.process_time()
O.run(total, True)
spent = time.process_time() - begin
output.close()
with open(options["output"] + ".json", "w") as file:
    json.dump({"cpu_s": spent, "steps": total}, file)

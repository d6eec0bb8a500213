"""Biaxial compression with the FEM x DEM modules that Yade ships, over escript: incumbent.py OPTIONS.json

Writes the mean vertical stress (volume average, tension positive) after every step as CSV, and the time of the steps as JSON.
"""

import builtins
import json
import sys
import time

# The modules were written for Python 2, where this was the name of `open`.
builtins.file = open

# Read first: the modules start Yade, which takes the arguments for its own.
with open(sys.argv[1]) as file:
    options = json.load(file)

from esys.escript import FunctionOnBoundary, Vector, integrate, Solution, whereZero
from esys.finley import Rectangle
from msFEM2D import MultiScale

width, height = options["size"]
columns, rows = options["elements"]
pressure = options["pressure"]
domain = Rectangle(l0=width, l1=height, n0=columns, n1=rows, order=2, integrationOrder=2)
began = time.time()
problem = MultiScale(domain=domain, ng=4 * columns * rows, np=options["processes"], rtol=options["tolerance"], verbose=True)
place = domain.getX()
side = FunctionOnBoundary(domain).getX()
foot, head = whereZero(place[1]), whereZero(place[1] - height)
centre = foot * whereZero(place[0] - 0.5 * width)
held = foot * [0, 1] + head * [0, 1] + centre * [1, 1]
given = head * [0, -options["strain_per_step"] * height]
traction = whereZero(side[0]) * [pressure, 0] + whereZero(side[0] - width) * [-pressure, 0]


def mean_vertical_stress():
    stress = problem.getCurrentStress()
    return integrate(stress[1, 1]) / integrate(stress[1, 1] * 0 + 1.0)


with open("incumbent.csv", "w") as curve:
    curve.write("step,vertical\n0,%.12e\n" % mean_vertical_stress())
    for step in range(1, options["steps"] + 1):
        problem.initialize(f=traction, specified_u_mask=held, specified_u_val=given)
        problem.solve(iter_max=100)
        curve.write("%d,%.12e\n" % (step, mean_vertical_stress()))
        curve.flush()
with open("incumbent.json", "w") as result:
    json.dump({"wall": time.time() - began}, result)
problem.exitSimulation()

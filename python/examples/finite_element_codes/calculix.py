"""The biaxial test in CalculiX, whose materials may be user materials of Abaqus from a shared library: `umat_` of `libgrainspan_pool`.

python calculix.py OUT.json [WORKERS]      the program is `ccx` in GRAINSPAN_CALCULIX; `build-calculix` makes it
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import biaxial
import block
import environment

#: CalculiX makes every tangent symmetric, so it gets one that is: contacts that slid keep no stiffness along their slip.
SYMMETRIC_TANGENT = 15

#: Plane elements become solids of this thickness, m, with twice as many points.
INPUT = """*NODE, NSET=ALL
{nodes}
*ELEMENT, TYPE=CPE4, ELSET=BLOCK
{elements}
*NSET, NSET=BOTTOM
{bottom}
*NSET, NSET=TOP
{top}
*MATERIAL, NAME=@ABAQUS_GRAINSPAN
*USER MATERIAL, CONSTANTS=1
0.
*DEPVAR
5
*SOLID SECTION, ELSET=BLOCK, MATERIAL=@ABAQUS_GRAINSPAN
1.
*BOUNDARY
BOTTOM, 1, 2
*AMPLITUDE, NAME=PATH
0., 0., 1., 0., {end}., 1.
*AMPLITUDE, NAME=CONSTANT
0., 1., {end}., 1.
*STEP, INC=1000
*STATIC, DIRECT
1., {end}.
*CONTROLS, PARAMETERS=FIELD
{tolerance}, 1., , , {tolerance}, 1e-12, 1., 1e-12
*CONTROLS, PARAMETERS=TIME INCREMENTATION
80, 100, 90, 120, 10, 40, , 10
*BOUNDARY, AMPLITUDE=PATH
TOP, 1, 1, 0.
TOP, 2, 2, {shortening}
*DLOAD, AMPLITUDE=CONSTANT
{loads}
*NODE PRINT, NSET=TOP
RF
*END STEP
"""


def input_text() -> str:
    """The input file."""
    counted = lambda rows: "\n".join(f"{place}, {row}" for place, row in enumerate(rows, 1))  # noqa: E731
    listed = lambda numbers: ", ".join(str(number + 1) for number in numbers)  # noqa: E731
    elements = block.elements()
    left = [place for place in range(1, len(elements) + 1) if place % block.COLUMNS == 1]
    right = [place for place in range(1, len(elements) + 1) if place % block.COLUMNS == 0]
    # Sides of an element are counted from the one below, counter-clockwise.
    loads = [f"{place}, P4, {biaxial.PRESSURE}" for place in left] + [f"{place}, P2, {biaxial.PRESSURE}" for place in right]
    return INPUT.format(
        nodes=counted(f"{x!r}, {y!r}, 0." for x, y in block.nodes()),
        elements=counted(listed(corners) for corners in elements),
        bottom=listed(block.bottom()),
        top=listed(block.top()),
        end=biaxial.STEPS + 1,
        tolerance=f"{biaxial.TOLERANCE:.1E}",
        shortening=f"{-biaxial.STEP * biaxial.STEPS:.6E}",
        loads="\n".join(loads),
    )


def main(out: str, workers: int = 1) -> None:
    program = Path(os.environ.get("GRAINSPAN_CALCULIX", "ccx"))
    said = subprocess.run([program, "-v"], capture_output=True, text=True, check=False).stdout
    curve = biaxial.Curve("CalculiX", (re.findall(r"Version ([\d.]+)", said) or ["?"])[0])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "biaxial.inp").write_text(input_text(), encoding="ascii")
        # CalculiX writes material names in capitals, and makes the name of the library of it.
        (folder / "libGRAINSPAN.so").symlink_to(environment.library())
        variables = environment.variables(folder, workers) | {
            "GRAINSPAN_STRAINS": "small",
            "GRAINSPAN_TANGENT": str(SYMMETRIC_TANGENT),
            "LD_LIBRARY_PATH": f"{folder}:{os.environ.get('LD_LIBRARY_PATH', '')}",
            "OMP_NUM_THREADS": str(workers),
            "CCX_NPROC_RESULTS": str(workers),
        }
        log = folder / "log.txt"
        begin = time.perf_counter()
        with log.open("w", encoding="utf-8") as room:
            result = subprocess.run(
                [program, "biaxial"], cwd=folder, stdout=room, stderr=subprocess.STDOUT, env=variables, check=False
            )
        curve.seconds = time.perf_counter() - begin
        environment.ended("CalculiX", result, log)
        text = (folder / "biaxial.dat").read_text(encoding="ascii")
        tables = re.split(r"forces \(fx,fy,fz\) for set TOP and time.*\n", text)[1:]
        rows = [line.split() for line in (folder / "biaxial.sta").read_text(encoding="ascii").splitlines()]
        iterations = [int(row[3]) for row in rows if row and row[0] == "1"]
        for step, table in enumerate(tables):
            forces = [line.split() for line in table.splitlines() if line.strip()]
            curve.add(step, sum(float(force[2]) for force in forces), iterations[step])
        # As the library is called: twice as many points as in the plane.
        curve.trials = sum(curve.iterations) * biaxial.ELEMENTS[0] * biaxial.ELEMENTS[1] * 8
    curve.write(out)


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:3]))

"""The biaxial test in OpenGeoSys, whose solid models may come from any library that MGIS can read: `libgrainspan_pool`.

python opengeosys.py OUT.json [WORKERS]
"""

import re
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree

import biaxial
import block
import environment

#: Four-node quadrilaterals and lines in the numbers of VTK.
QUADRILATERAL, LINE = 9, 3

PROJECT = """<?xml version="1.0" encoding="UTF-8"?>
<OpenGeoSysProject>
  <meshes>
    <mesh>block.vtu</mesh> <mesh>bottom.vtu</mesh> <mesh>top.vtu</mesh> <mesh>left.vtu</mesh> <mesh>right.vtu</mesh>
  </meshes>
  <processes><process>
    <name>equilibrium</name>
    <type>SMALL_DEFORMATION</type>
    <integration_order>2</integration_order>
    <constitutive_relation>
      <type>MFront</type>
      <library>{library}</library>
      <behaviour>GrainCell</behaviour>
    </constitutive_relation>
    <specific_body_force>0 0</specific_body_force>
    <process_variables><process_variable>displacement</process_variable></process_variables>
    <secondary_variables><secondary_variable name="sigma"/></secondary_variables>
  </process></processes>
  <media><medium><phases><phase>
    <type>Solid</type>
    <properties><property><name>density</name><type>Constant</type><value>2600</value></property></properties>
  </phase></phases></medium></media>
  <time_loop>
    <processes><process ref="equilibrium">
      <nonlinear_solver>newton</nonlinear_solver>
      <convergence_criterion><type>Residual</type><norm_type>INFINITY_N</norm_type><abstol>{tolerance}</abstol></convergence_criterion>
      <time_discretization><type>BackwardEuler</type></time_discretization>
      <time_stepping>
        <type>FixedTimeStepping</type> <t_initial>0</t_initial> <t_end>{end}</t_end>
        <timesteps><pair><repeat>{end}</repeat><delta_t>1</delta_t></pair></timesteps>
      </time_stepping>
    </process></processes>
    <output>
      <type>VTK</type> <prefix>step</prefix> <suffix>_{{:timestep}}</suffix> <data_mode>Ascii</data_mode>
      <compress_output>false</compress_output>
      <timesteps><pair><repeat>1</repeat><each_steps>1</each_steps></pair></timesteps>
      <variables><variable>displacement</variable><variable>NodalForces</variable></variables>
    </output>
  </time_loop>
  <parameters>
    <parameter><name>zero</name><type>Constant</type><value>0</value></parameter>
    <parameter><name>at_rest</name><type>Constant</type><values>0 0</values></parameter>
    <parameter><name>from_left</name><type>Constant</type><value>{pressure}</value></parameter>
    <parameter><name>from_right</name><type>Constant</type><value>-{pressure}</value></parameter>
    <parameter><name>whole</name><type>Constant</type><value>-{shortening}</value></parameter>
    <parameter><name>platen</name><type>CurveScaled</type><curve>path</curve><parameter>whole</parameter></parameter>
  </parameters>
  <curves><curve><name>path</name><coords>0 1 {end}</coords><values>0 0 1</values></curve></curves>
  <process_variables><process_variable>
    <name>displacement</name> <components>2</components> <order>1</order> <initial_condition>at_rest</initial_condition>
    <boundary_conditions>{conditions}</boundary_conditions>
  </process_variable></process_variables>
  <nonlinear_solvers><nonlinear_solver>
    <name>newton</name> <type>Newton</type> <max_iter>60</max_iter> <linear_solver>direct</linear_solver>
  </nonlinear_solver></nonlinear_solvers>
  <linear_solvers><linear_solver>
    <name>direct</name> <eigen><solver_type>SparseLU</solver_type></eigen>
  </linear_solver></linear_solvers>
</OpenGeoSysProject>
"""

CONDITION = "<boundary_condition><mesh>{0}</mesh><type>{1}</type><component>{2}</component><parameter>{3}</parameter></boundary_condition>"
CONDITIONS = [
    ("bottom", "Dirichlet", 0, "zero"),
    ("bottom", "Dirichlet", 1, "zero"),
    ("top", "Dirichlet", 0, "zero"),
    ("top", "Dirichlet", 1, "platen"),
    ("left", "Neumann", 0, "from_left"),
    ("right", "Neumann", 0, "from_right"),
]


def mesh_file(path: Path, nodes, elements, kind: int, bulk: list[int] | None) -> None:
    """A mesh as a text file of VTK. `bulk`: for a part of the boundary the numbers of its nodes in the whole mesh."""

    def numbers(name: str, values, kind: str = "Int64", more: str = "") -> str:
        words = " ".join(str(value) for value in values)
        return f'<DataArray type="{kind}" Name="{name}" format="ascii" {more}>{words}</DataArray>\n'

    count = len(elements[0])
    ids = numbers("bulk_node_ids", bulk, "UInt64") if bulk else ""
    path.write_text(
        '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64"><UnstructuredGrid>\n'
        f'<Piece NumberOfPoints="{len(nodes)}" NumberOfCells="{len(elements)}">\n<PointData>{ids}</PointData><CellData/>\n<Points>'
        + numbers("Points", (f"{x!r} {y!r} 0" for x, y in nodes), "Float64", 'NumberOfComponents="3"')
        + "</Points>\n<Cells>"
        + numbers("connectivity", (node for element in elements for node in element))
        + numbers("offsets", (count * (place + 1) for place in range(len(elements))))
        + numbers("types", [kind] * len(elements), "UInt8")
        + "</Cells>\n</Piece></UnstructuredGrid></VTKFile>\n",
        encoding="ascii",
    )


def write_input(folder: Path) -> Path:
    """Meshes and project file; returns the latter."""
    nodes = block.nodes()
    mesh_file(folder / "block.vtu", nodes, block.elements(), QUADRILATERAL, None)
    for name in ("bottom", "top", "left", "right"):
        part = getattr(block, name)()
        lines = [(place, place + 1) for place in range(len(part) - 1)]
        mesh_file(folder / f"{name}.vtu", [nodes[node] for node in part], lines, LINE, part)
    project = folder / "biaxial.prj"
    text = PROJECT.format(
        library=environment.library(),
        # A nodal force of the platens is half of theirs on an element's side.
        tolerance=biaxial.TOLERANCE * 0.5 * biaxial.PRESSURE * biaxial.SIZE[0],
        pressure=biaxial.PRESSURE,
        shortening=biaxial.STEP * biaxial.STEPS,
        end=biaxial.STEPS + 1,
        conditions="".join(CONDITION.format(*one) for one in CONDITIONS),
    )
    project.write_text(text, encoding="utf-8")
    return project


def top_force(path: Path) -> float:
    """Force of the upper platen from a results file."""
    arrays = {array.get("Name"): array for array in ElementTree.parse(path).getroot().iter("DataArray")}
    forces = [float(word) for word in arrays["NodalForces"].text.split()]
    return sum(forces[2 * node + 1] for node in block.top())


def main(out: str, workers: int = 1) -> None:
    curve = biaxial.Curve("OpenGeoSys", version("ogs"))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        project, log = write_input(folder), folder / "log.txt"
        begin = time.perf_counter()
        with log.open("w", encoding="utf-8") as room:
            command = [str(Path(sys.executable).with_name("ogs")), str(project), "-o", str(folder)]
            variables = environment.variables(folder, workers) | {"OGS_ASM_THREADS": str(workers)}
            result = subprocess.run(command, stdout=room, stderr=subprocess.STDOUT, env=variables, check=False)
        curve.seconds = time.perf_counter() - begin
        environment.ended("OpenGeoSys", result, log)
        said = log.read_text(encoding="utf-8")
        # Step 0 is the output before all.
        for step, text in enumerate(re.split(r"Time step #\d+ started", said)[2:]):
            curve.add(step, top_force(folder / f"step_{step + 1}.vtu"), len(re.findall(r"Iteration #\d+ started", text)))
        curve.material_seconds = sum(float(one) for one in re.findall(r"Assembly took ([-+.e\d]+) s", said))
        # As the library is called: once per point and iteration.
        curve.trials = sum(curve.iterations) * biaxial.ELEMENTS[0] * biaxial.ELEMENTS[1] * 4
    curve.write(out)


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:3]))

//! Shipped scenes, shortened so that a run takes about a second: together they know all procedures, formulations of stress and
//! strain, both grain solvers, both built-in engines, links, regions, averages over neighbours, several stages, and scenes that keep to an error.

/// A scene and what is changed in it.
#[derive(Clone, Copy, Debug)]
pub struct ShortScene {
    /// Names folders.
    pub name: &'static str,
    /// File in `scenes/`.
    pub file: &'static str,
    /// Overrides.
    pub set: &'static [&'static str],
}

const fn scene(name: &'static str, file: &'static str, set: &'static [&'static str]) -> ShortScene {
    ShortScene { name, file, set }
}

/// All of them.
pub const SHORT_SCENES: [ShortScene; 25] = [
    scene("one", "biaxial-small", &["mesh.elements=[1, 1]", "loading.increments=6"]),
    scene("two", "biaxial-small", &["mesh.elements=[1, 2]", "loading.increments=5"]),
    scene("four", "biaxial-small", &["mesh.elements=[2, 2]", "loading.increments=4"]),
    scene(
        "turned-and-weak",
        "biaxial-weak-element",
        &["mesh.elements=[2, 3]", "loading.increments=6", "error_estimate.most_strained=0.2"],
    ),
    scene("periodic", "simple-shear", &["mesh.elements=[2, 2]", "loading.increments=6"]),
    scene(
        "turned-head",
        "biaxial-small",
        &[
            "mesh.elements=[2, 2]",
            "boundary=[{ set = 'bottom', displacement = { x = 0.0, y = 0.0 } }]",
            "rigid_body=[{ set = 'top', displacement = { y = -2e-4 }, rotation = { z = 2e-3 } }]",
            "loading.increments=8",
        ],
    ),
    scene(
        "wave",
        "shear-column",
        &[
            "mesh.elements=[1, 12]",
            "mesh.size=[0.0125, 0.15]",
            "loading.duration=2e-3",
            "dynamics.output_interval=1e-4",
        ],
    ),
    scene("averaged", "biaxial-nonlocal", &["loading.duration=0.012", "dynamics.output_interval=1e-3"]),
    scene(
        "averaged-back",
        "biaxial-nonlocal",
        &["mesh.elements=[2, 5]", "nonlocal.adjoint=true", "loading.duration=0.01", "dynamics.output_interval=1e-3"],
    ),
    scene(
        "averaged-newton",
        "biaxial-nonlocal-newton",
        &[
            "mesh.elements=[2, 3]",
            "region.0.to=[0.02, 0.06]",
            "nonlocal.radius=0.04",
            "stage.1.loading.increments=6",
            "stage.1.boundary.0.displacement.y=-6e-4",
        ],
    ),
    scene("relaxed", "biaxial-relaxation", &["loading.increments=8", "mesh.elements=[2, 2]"]),
    scene("spheres", "single-hexahedron-shear", &["rve.accuracy=draft", "loading.increments=8"]),
    scene(
        "two-stages",
        "compression-shear",
        &[
            "stage.0.loading.increments=3",
            "stage.1.loading.increments=5",
            "probe.3.reference='shear'",
            "output.points=[2]",
            "profile=[{ name = 'rows', kind = 'shear_strain', axis = 'y', bins = 2, reference = 'shear' }]",
        ],
    ),
    scene("arc-length", "biaxial-arc-length", &["mesh.elements=[2, 2]", "loading.increments=8"]),
    scene(
        "stabilised",
        "biaxial-small",
        &[
            "mesh.elements=[1, 2]",
            "loading.increments=6",
            "loading.max_iterations=1",
            "loading.stabilise_after=1",
            "solver.capped_change=1e-4",
        ],
    ),
    scene(
        "committed-iterates",
        "biaxial-small",
        &[
            "mesh.elements=[1, 2]",
            "boundary.2.displacement.y=-3e-3",
            "loading.increments=8",
            "loading.commit_iterates_after=2",
        ],
    ),
    scene(
        "total-lagrangian",
        "biaxial-small",
        &["mesh.elements=[1, 2]", "solver.formulation=total_lagrangian", "loading.increments=6"],
    ),
    scene(
        "small-strain",
        "biaxial-small",
        &["mesh.elements=[1, 2]", "solver.formulation=small_strain", "loading.increments=6"],
    ),
    scene(
        "iterative-equations",
        "biaxial-small",
        &["mesh.elements=[2, 2]", "solver.equations=iterative", "loading.increments=6"],
    ),
    scene(
        "summed",
        "biaxial-small",
        &[
            "mesh.elements=[2, 2]",
            "boundary=[{ set = 'bottom', displacement = { x = 0.0, y = 0.0 } }, { set = 'top', displacement = { x = 0.0 } }]",
            "sum=[{ name = 'head', terms = [{ set = 'top', component = 'y', coefficient = 1.0 }, { set = 'left', \
             component = 'y', coefficient = 0.1 }], value = -3e-4 }]",
            "loading.increments=8",
        ],
    ),
    scene(
        "undrained",
        "geotechnics/undrained-biaxial",
        &[
            "packing=../../packings/discs-100.json",
            "contact.modulus=1e8",
            "mesh.elements=[1, 2]",
            "stage.0.loading.increments=2",
            "stage.1.loading.increments=5",
            "stage.1.boundary.0.displacement.y=-3e-4",
        ],
    ),
    // Prepared again, to the same bits, by a run that is continued.
    scene(
        "ground-at-rest",
        "geotechnics/ground",
        &[
            "packing=../../packings/discs-100.json",
            "contact.modulus=1e8",
            "mesh.elements=[1, 2]",
            "mesh.size=[2.0, 4.0]",
            "boundary.2.displacement.x=-0.004",
            "loading.increments=6",
        ],
    ),
    scene("framed", "biaxial-small", &["mesh.elements=[1, 1]", "pool.engine=boundary-frame", "loading.increments=6"]),
    scene(
        "event-driven",
        "biaxial-small",
        &[
            "mesh.elements=[1, 1]",
            "rve.solver=event_driven",
            "boundary.2.displacement.y=-2e-5",
            "loading.increments=12",
        ],
    ),
    // No accuracy is named: the run keeps to the default error.
    scene(
        "to-an-error",
        "biaxial",
        &[
            "mesh.elements=[1, 1]",
            "packing=../packings/discs-100.json",
            "contact.modulus=1e8",
            "boundary.2.displacement.y=-5e-4",
            "output.grains=[0]",
            "loading.increments=6",
        ],
    ),
];

//! What is run: a specimen before and after the peak, a wall, a wave and a cyclic shear test.

/// A scene of the study.
pub(super) struct EconomyScene {
    /// Name in the tables.
    pub(super) name: &'static str,
    /// Column of `history.csv` whose error is measured.
    pub(super) column: &'static str,
    /// Packing of its cells, as a file.
    pub(super) packing: &'static str,
    text: &'static str,
    /// Settings of the study; the shorter ones when seconds must do.
    pub(super) settings: &'static [&'static str],
    pub(super) quick: &'static [&'static str],
}

impl EconomyScene {
    /// Whether no equations are solved, so that keys of `[solver]` about iterations have no meaning.
    pub(super) fn is_dynamic(&self) -> bool {
        self.text.contains("procedure = \"dynamic\"")
    }

    /// The scene file, whose packing is `packing.json` next to it.
    pub(super) fn text(&self) -> String {
        let line = |line: &str| {
            let line = match line.split(" =").next() {
                Some("packing") => "packing = \"packing.json\"",
                Some("packings") => "packings = [\"packing.json\"]",
                _ => line,
            };
            line.to_owned() + "\n"
        };
        self.text.lines().map(line).collect()
    }
}

/// The packing of most of them.
const DISCS_100: &str = include_str!("../../../packings/discs-100.json");

/// That of some, whose cells have more contacts that slide, open or close.
const DISCS_400: &str = include_str!("../../../packings/discs-400.json");

/// A row of elements between two fixed ends; the lower one is shaken once.
const WAVE: &str = r#"
name = "wave"
packing = "packing.json"
procedure = "dynamic"
[mesh]
generator = "block"
size = [0.0125, 0.25]
elements = [1, 20]
element = "q4_single"
[contact]
law = "linear"
modulus = 1.0e8
stiffness_ratio = 0.5
friction = 0.5
[rve]
accuracy = "default"
[[boundary]]
set = "bottom"
displacement = { x = 1.0e-6 }
history = { sine = { frequency = 600.0 } }
[[boundary]]
set = "bottom"
displacement = { y = 0.0 }
[[boundary]]
set = "top"
displacement = { x = 0.0, y = 0.0 }
[[periodic]]
from = "left"
to = "right"
jump = { x = 0.0, y = 0.0 }
[loading]
duration = 1.0e-3
[dynamics]
output_interval = 1.0e-4
[solver]
formulation = "corotational"
[output]
fields_every = 0
observables = []
[[probe]]
name = "force"
kind = "reaction"
set = "bottom"
component = "x"
"#;

/// One element between two platens that shear it to and fro.
const CYCLES: &str = r#"
name = "cycles"
packing = "packing.json"
[mesh]
generator = "block"
size = [0.05, 0.05]
elements = [2, 2]
element = "q4"
[contact]
law = "linear"
modulus = 1.0e8
stiffness_ratio = 0.5
friction = 0.5
[rve]
accuracy = "default"
[[boundary]]
set = "bottom"
displacement = { x = 0.0, y = 0.0 }
[[boundary]]
set = "top"
displacement = { y = 0.0 }
[[boundary]]
set = "top"
displacement = { x = 2.5e-6 }
history = { sine = { frequency = 1.0 } }
[[periodic]]
from = "left"
to = "right"
jump = { x = 0.0, y = 0.0 }
[loading]
duration = 3.0
increments = 120
[output]
fields_every = 0
observables = []
[[probe]]
name = "force"
kind = "reaction"
set = "top"
component = "x"
"#;

const BIAXIAL: &str = include_str!("../../../scenes/biaxial-small.toml");

/// All scenes.
pub(super) const SCENES: [EconomyScene; 7] = [
    EconomyScene {
        name: "biaxial-before-the-peak",
        column: "stress_ratio",
        packing: DISCS_100,
        text: BIAXIAL,
        settings: &["rve.accuracy=\"default\"", "loading.increments=10", "boundary.2.displacement.y=-5e-4"],
        quick: &["loading.increments=1", "mesh.elements=[1, 1]", "boundary.2.displacement.y=-1e-5"],
    },
    EconomyScene {
        name: "biaxial-past-the-peak",
        column: "stress_ratio",
        packing: DISCS_100,
        text: BIAXIAL,
        settings: &["rve.accuracy=\"default\"", "loading.increments=30", "boundary.2.displacement.y=-3e-3"],
        quick: &["loading.increments=1", "mesh.elements=[1, 1]", "boundary.2.displacement.y=-1e-5"],
    },
    EconomyScene {
        name: "retaining-wall",
        column: "wall_force",
        packing: DISCS_100,
        text: include_str!("../../../scenes/geotechnics/wall-active.toml"),
        settings: &[
            "rve.accuracy=\"default\"",
            "mesh.elements=[10, 1, 4]",
            "loading.increments=10",
            "boundary.3.displacement.x=-1e-3",
        ],
        quick: &["mesh.elements=[2, 1, 1]", "loading.increments=1", "boundary.3.displacement.x=-1e-6"],
    },
    EconomyScene {
        name: "wave",
        column: "force",
        packing: DISCS_100,
        text: WAVE,
        settings: &[],
        quick: &["mesh.elements=[1, 2]", "loading.duration=1e-5", "dynamics.output_interval=1e-5"],
    },
    EconomyScene {
        name: "wave-400",
        column: "force",
        packing: DISCS_400,
        text: WAVE,
        settings: &[],
        quick: &["mesh.elements=[1, 2]", "loading.duration=1e-5", "dynamics.output_interval=1e-5"],
    },
    EconomyScene {
        name: "cyclic-shear",
        column: "force",
        packing: DISCS_100,
        text: CYCLES,
        settings: &[],
        quick: &["mesh.elements=[1, 1]", "loading.duration=0.05", "loading.increments=2"],
    },
    EconomyScene {
        name: "cyclic-shear-400",
        column: "force",
        packing: DISCS_400,
        text: CYCLES,
        settings: &[],
        quick: &["mesh.elements=[1, 1]", "loading.duration=0.05", "loading.increments=2"],
    },
];

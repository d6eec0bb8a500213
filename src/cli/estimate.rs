//! Estimate of wall time and memory of a run, to the order of magnitude, from measured figures.

use macro_solver::mesh::Dimension;
use macro_solver::problem::Procedure;
use scene_reader::Scene;

/// Force evaluations of one point evaluation, measured on biaxial tests between the first steps to an error of 0.5 % and those after the peak.
const FORCE_EVALUATIONS: [f64; 2] = [60.0, 1500.0];

/// Force evaluations that bring a cell to the stress of its Gauss point: slopes and ground of 400 discs, cells of spheres.
const PREPARATION_EVALUATIONS: [f64; 2] = [5e3, 1e5];

/// Strain per step of the grains at which they were measured: that of the default error and of `accuracy = "draft"`.
const STRAIN_PER_STEP: f64 = 5e-6;

/// Processor time of a force evaluation per grain, s, in the plane and in space; measured with AVX2, tangents included.
const SECONDS_PER_GRAIN: [f64; 2] = [2.5e-8, 8e-8];

/// Bytes of a snapshot per grain, in the plane and in space.
const BYTES_PER_GRAIN: [f64; 2] = [150.0, 330.0];

/// States of a point that the macro process holds: committed and trial, and those on their way.
const STATES: f64 = 3.5;

/// Bytes of the macro process for a point: tangents, fields, records.
const BYTES_PER_POINT: f64 = 4e3;

/// Bytes of all workers per grain of a point: states in use and kept, orders and factors of its tangents.
const WORKER_BYTES_PER_GRAIN: f64 = 1.0e3;

/// Bytes of any process before it holds a point.
const BYTES_PER_PROCESS: f64 = 2.2e7;

/// Bytes of a worker per grain of its cell: the cells it solves side by side, and the factors of a tangent. Measured with 400 discs, 1000 and 4096
/// spheres: 55, 55 and 44 kB.
const BYTES_PER_GRAIN_OF_A_CELL: f64 = 5e4;

/// Bytes of the macro process for each pair of a point and one that it averages (`[nonlocal]`): the table while it is made.
const BYTES_PER_AVERAGED_PAIR: f64 = 60.0;

/// Bytes of the macro process for each entry of the stiffness between elements that averages bring about: block, its place in the matrix,
/// matrix, factors.
const BYTES_PER_COUPLED_ENTRY: f64 = 40.0;

/// Estimated cost of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Estimate {
    /// Processor time of all workers, s: least and most; `None` for motions, whose steps are counted when they run.
    pub(crate) seconds: Option<[f64; 2]>,
    /// Cells that are prepared for their depth first, and the processor time of that, s.
    pub(crate) preparation: Option<(usize, [f64; 2])>,
    /// Memory of the macro process, bytes.
    pub(crate) bytes: f64,
    /// Memory of all workers without what each process needs, bytes.
    pub(crate) worker_bytes: f64,
    /// Memory that each worker needs in addition, bytes.
    pub(crate) bytes_per_worker: f64,
}

impl Estimate {
    /// Of a scene whose steps are not cut back, with the given least and most evaluations.
    pub(crate) fn of(scene: &Scene, evaluations: [usize; 2]) -> Self {
        let problem = &scene.problem;
        let definition = scene.definition();
        let (grains, space) = (definition.number() as f64, usize::from(definition.dimension() == 3));
        let motionless = problem.stages.iter().all(|stage| stage.procedure == Procedure::Implicit);
        let one = grains * SECONDS_PER_GRAIN[space];
        // With smaller steps of the grains, ramps take more of them: all evaluations where strains are large, few where they are small.
        let finer = (STRAIN_PER_STEP / definition.options().strain_per_step()).max(1.0);
        let more = [finer.sqrt(), finer];
        let seconds = std::array::from_fn(|end| evaluations[end] as f64 * FORCE_EVALUATIONS[end] * more[end] * one);
        let preparation = scene
            .preparation()
            .map(|planned| (planned.cells, PREPARATION_EVALUATIONS.map(|count| planned.cells as f64 * count * one)));
        let unknowns = problem.mesh.degrees_of_freedom() as f64;
        // Entries of a factor: about n log n in the plane and n^(4/3) in space.
        let factor = match problem.mesh.dimension {
            Dimension::Plane => 8.0 * unknowns * unknowns.max(2.0).log2() * 4.0,
            Dimension::Space => 8.0 * 12.0 * unknowns.powf(4.0 / 3.0),
        };
        let coupling = problem.coupling_size();
        let averages =
            coupling.pairs as f64 * BYTES_PER_AVERAGED_PAIR + coupling.entries as f64 * BYTES_PER_COUPLED_ENTRY;
        let points = problem.point_count() as f64;
        let states = points * (STATES * grains * BYTES_PER_GRAIN[space] + BYTES_PER_POINT);
        let bytes = states + factor + averages + BYTES_PER_PROCESS;
        let worker_bytes = points * grains * WORKER_BYTES_PER_GRAIN;
        let bytes_per_worker = BYTES_PER_PROCESS + grains * BYTES_PER_GRAIN_OF_A_CELL;
        Self { seconds: motionless.then_some(seconds), preparation, bytes, worker_bytes, bytes_per_worker }
    }

    /// Time and memory for people, on a machine with this many cores.
    pub(crate) fn text(&self, cores: usize) -> String {
        let workers = self.worker_bytes + cores as f64 * self.bytes_per_worker;
        let memory = format!("{} of memory, {} of it in the workers", size(self.bytes + workers), size(workers));
        let range = |seconds: [f64; 2]| {
            let [least, most] = seconds.map(|seconds| duration(seconds / cores as f64));
            format!("{least} to {most}")
        };
        let text = match self.seconds {
            Some(seconds) => {
                let time = range(seconds);
                format!("very roughly {time} with {cores} workers, {memory}; steps that are cut back come on top")
            }
            None => format!("very roughly {memory}; the time depends on the number of time steps or iterations"),
        };
        match self.preparation {
            Some((cells, seconds)) => {
                format!("{text}; first {} to bring {cells} cells to their stress", range(seconds))
            }
            None => text,
        }
    }
}

fn duration(seconds: f64) -> String {
    match seconds {
        short if short < 100.0 => format!("{short:.1} s"),
        minutes if minutes < 6000.0 => format!("{:.0} min", minutes / 60.0),
        hours if hours < 360_000.0 => format!("{:.0} h", hours / 3600.0),
        days if days < 3.2e7 => format!("{:.0} days", days / 86_400.0),
        years => format!("{:.0} years", years / 3.156e7),
    }
}

fn size(bytes: f64) -> String {
    match bytes {
        small if small < 1e9 => format!("{:.0} MB", (small / 1e6).max(1.0)),
        large if large < 1e12 => format!("{:.1} GB", large / 1e9),
        huge => format!("{:.0} TB", huge / 1e12),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `scenes/biaxial.toml` takes 7 s of processor time on a machine with AVX-512, 59 MB of the macro process and 74 MB of a single worker; 198 MB
    /// with two.
    #[test]
    fn the_estimate_of_the_shipped_scene_brackets_what_was_measured() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/biaxial.toml");
        let scene = Scene::load(&path, &[]).unwrap();
        let steps: usize = scene.problem.stages.iter().map(|stage| stage.control.increments).sum();
        let points = scene.problem.point_count();
        let estimate = Estimate::of(&scene, [2 * steps * points, 6 * steps * points]);
        let [least, most] = estimate.seconds.unwrap();
        assert!(least < 7.0 && 7.0 < most && most < 100.0 * least, "{least} to {most}");
        for (workers, measured) in [(1.0, 133e6), (2.0, 198e6)] {
            let all = estimate.bytes + estimate.worker_bytes + workers * estimate.bytes_per_worker;
            assert!((0.67..1.5).contains(&(all / measured)), "{workers}: {all}");
        }
        assert!(estimate.text(2).contains("with 2 workers"), "{}", estimate.text(2));
    }

    /// With averages the macro process of this scene took 613 MB on 24 x 60 elements (5760 points), and 251 MB without.
    #[test]
    fn averages_over_neighbours_count() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/biaxial-nonlocal-newton.toml");
        let bytes = |enabled: bool| {
            let mut overrides = vec!["mesh.elements=[24,60]".to_owned(), "nonlocal.radius=0.01".to_owned()];
            overrides.push(format!("stage.1.nonlocal.enabled={enabled}"));
            Estimate::of(&Scene::load(&path, &overrides).unwrap(), [100, 1000]).bytes
        };
        let [with, without] = [bytes(true), bytes(false)];
        assert!((0.5..2.0).contains(&(with / 613e6)), "{with}");
        assert!((0.5..2.0).contains(&((with - without) / 362e6)), "{with} {without}");
    }

    /// 576 cells of 400 discs took 100 s of two busy cores.
    #[test]
    fn cells_that_are_prepared_count() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/geotechnics/slope-at-rest.toml");
        let estimate = Estimate::of(&Scene::load(&path, &[]).unwrap(), [100, 1000]);
        let (cells, [least, most]) = estimate.preparation.unwrap();
        assert_eq!(cells, 576);
        assert!(least < 100.0 && 200.0 < most, "{least} to {most}");
        assert!(estimate.text(2).contains("to bring 576 cells to their stress"), "{}", estimate.text(2));
    }

    /// `scenes/biaxial-small.toml` to 2 % took 0.7, 3.6 and 30 s of one core.
    #[test]
    fn smaller_steps_of_the_grains_take_longer() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/biaxial.toml");
        let most = |accuracy: &str| {
            let scene = Scene::load(&path, &[format!("rve.accuracy={accuracy}")]).unwrap();
            Estimate::of(&scene, [100, 1000]).seconds.unwrap()
        };
        let [draft, usual, tight] = ["draft", "default", "tight"].map(most);
        assert!((usual[1] / draft[1] - 5.0).abs() < 1e-9 && (tight[1] / draft[1] - 50.0).abs() < 1e-9);
        assert!(tight[0] / draft[0] > 7.0);
    }

    #[test]
    fn times_and_sizes_have_units_that_people_grasp() {
        let times = [1.0, 600.0, 7200.0, 1e6, 1e10].map(duration);
        assert_eq!(times, ["1.0 s", "10 min", "2 h", "12 days", "317 years"]);
        assert_eq!([1.0, 5e8, 2e10, 3e13].map(size), ["1 MB", "500 MB", "20.0 GB", "30 TB"]);
    }
}

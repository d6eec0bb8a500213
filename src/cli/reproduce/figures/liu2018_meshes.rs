//! [Liu2018] Figs. 4 to 7: meshes against a simulation of all grains. Part of J-1.

use super::liu2018::{biaxial, ratios_of_points};
use crate::cli::reproduce::field::Fields;
use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::Finished;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2018-meshes",
    source: "[Liu2018] Figs. 4 to 7",
    shows: "stress ratio, that of every point, contacts, anisotropy and strain for meshes from 1 x 1 on, against all grains by four boundaries",
    run_time: ("15 s", "4 min"),
    entries: &[("J-1", "")],
    runs,
    evaluate,
};

/// The quantity of Fig. 7, and that of the whole test.
const INCREMENT: &str = "equivalent_strain_increment";
const STRAIN: &str = "shear_strain";

/// The mesh of the paper's studies.
const OF_STUDIES: (usize, usize) = (2, 4);

/// Meshes whose points are drawn one by one, with the figure of the paper and the part of the name of the picture.
const DRAWN: [((usize, usize), &str, &str); 2] = [(OF_STUDIES, "6a", "points-2x4"), ((4, 8), "6b", "points-4x8")];

/// Strains up to which all grains are compared with elements: to the peak of ours, and as far as the paper calls both very close.
const OF_GRAINS: [f64; 2] = [0.04, 0.05];

/// Strain at which the paper looks for the points with the highest and the lowest stress ratio.
const APART: f64 = 0.09;

/// How all grains are bounded: name of the run, the boundary in words, and settings of its test.
const BOUNDARIES: [(&str, &str, &[&str]); 3] = [
    (TIED, "periodic boundary grains", &[]),
    ("platens", "plates and soft sides", &["frame.constraint='platens'"]),
    (
        SERVO,
        "periodic boundary grains by the servo",
        &["frame.control={ servo = { gain = 1.0 } }", "frame.servo_tolerance=0.1"],
    ),
];

/// The boundary of the paper, exactly.
const TIED: &str = "tied";

/// The boundary of the paper as it is brought about there.
const SERVO: &str = "servo";

/// The one that walls alone have.
const WALLS: &str = "walls";

/// Assemblies of all grains by their letters in the paper, frames across and up, and whether the paper size alone has them.
const ASSEMBLIES: [(&str, [u32; 2], bool); 2] = [("A", [1, 2], false), ("B", [2, 4], true)];

fn assemblies(size: Size) -> impl Iterator<Item = (&'static str, [u32; 2])> {
    let of_size = ASSEMBLIES.into_iter().filter(move |(_, _, is_large)| !is_large || size == Size::Paper);
    of_size.map(|(letter, frames, _)| (letter, frames))
}

fn assembly_name(letter: &str, boundary: &str) -> String {
    format!("grains-{}-{boundary}", letter.to_lowercase())
}

/// Boundaries of an assembly other than walls. The servo takes ten times as long and is shown on the small one.
fn boundaries(letter: &str) -> impl Iterator<Item = &'static (&'static str, &'static str, &'static [&'static str])> {
    BOUNDARIES.iter().filter(move |(name, ..)| *name != SERVO || letter == "A")
}

/// Gauss points of a mesh, four in each element.
fn point_count((across, up): (usize, usize)) -> usize {
    4 * across * up
}

fn meshes(size: Size) -> &'static [(usize, usize)] {
    match size {
        Size::Small => &[(1, 1), (1, 2), (2, 4)],
        Size::Paper => &[(1, 1), (1, 2), (2, 4), (4, 8)],
    }
}

fn name((across, up): (usize, usize)) -> String {
    format!("mesh-{across}x{up}")
}

fn runs(size: Size) -> Vec<Run> {
    let scene = "scenes/liu2018/biaxial.toml";
    let mesh = |&(across, up): &(usize, usize)| {
        // Past the peak finer meshes have snaps that no step passes; the curve ends where the run does.
        let run = Run::new(name((across, up)), scene, Command::Stopping, size)
            .set(format!("mesh.elements=[{across}, {up}]"))
            .set(format!("output.fields=['{INCREMENT}']"));
        if DRAWN.iter().any(|(drawn, ..)| *drawn == (across, up)) {
            let points: Vec<String> = (0..point_count((across, up))).map(|point| point.to_string()).collect();
            return run.set(format!("output.points=[{}]", points.join(", ")));
        }
        run
    };
    let grains = |(letter, [across, up]): (&'static str, [u32; 2])| {
        let walls =
            Run::new(assembly_name(letter, WALLS), "scenes/liu2018/grains-biaxial.toml", Command::Specimen, size)
                .set(format!("tiles=[{across}, {up}]"));
        let bounded = boundaries(letter).map(move |(name, _, settings)| {
            // The pictures of Fig. 7 are those of the boundary of the paper.
            let command = if *name == TIED { Command::Contacts(At::Ends) } else { Command::Element(None) };
            let run =
                Run::new(assembly_name(letter, name), "scenes/liu2018/grains-frame-biaxial.toml", command, size)
                    .set(format!("frame.tiles=[{across}, {up}]"));
            settings.iter().fold(run, |run, setting| run.set(*setting))
        });
        bounded.chain([walls])
    };
    meshes(size).iter().map(mesh).chain(assemblies(size).flat_map(grains)).collect()
}

fn evaluate(results: &Results, size: Size) -> Result<Outcome, ReproduceError> {
    let mut collected = Collected::new();
    for &mesh in meshes(size) {
        collected.add_mesh(results, mesh)?;
    }
    collected.compare_meshes(size);
    let points = collected.add_points(results, size)?;
    let highest = collected.highest();
    let of_studies =
        meshes(size).iter().position(|mesh| *mesh == OF_STUDIES).map(|place| collected.curves[place].clone());
    let mut drawn = Vec::new();
    for (letter, _) in assemblies(size) {
        drawn.extend(collected.add_assembly(results, letter, of_studies.as_ref(), highest)?);
    }
    collected.ratio.published("[Liu2018]: largest value 0.39 at 7.3 %", [[0.073, 0.39]]);
    collected.anisotropy.published("[Liu2018]: 0.27 at 7.3 %, 2 x 4 elements", [[0.073, 0.27]]);
    let map = |title: &str, quantity: &str, panels| Map { title: title.into(), quantity: quantity.into(), panels };
    let increment = map(
        "[Liu2018] Fig. 7: meshes, elements and compression",
        "incremental equivalent strain of the last step",
        collected.increments,
    );
    let strain = map("Meshes, elements and compression", "shear strain since the start", collected.strains);
    let charts = [
        ("", collected.ratio),
        ("contacts", collected.contacts),
        ("anisotropy", collected.anisotropy),
        ("spread", collected.deviation),
    ];
    Ok(Outcome {
        charts: charts.into_iter().chain(points).collect(),
        maps: vec![("map", strain), ("increment", increment)],
        drawn,
        comparisons: collected.comparisons,
        notes: results.notes(),
    })
}

/// The charts and rows as they grow from mesh to mesh and from assembly to assembly.
struct Collected {
    ratio: Chart,
    contacts: Chart,
    anisotropy: Chart,
    deviation: Chart,
    /// Stress ratio over compression of each mesh.
    curves: Vec<Curve>,
    /// Standard deviation of the stress ratio over the points of each mesh.
    deviations: Vec<Curve>,
    strains: Vec<Panel>,
    increments: Vec<Panel>,
    comparisons: Vec<Comparison>,
}

impl Collected {
    fn new() -> Self {
        let x = ("axial compression", Scale::Linear);
        let chart = |title: &str, y: &str| Chart::new(title, x, (y, Scale::Linear));
        Self {
            ratio: chart("[Liu2018] Fig. 4: meshes", "|(s11 - s22) / (s11 + s22)|"),
            contacts: chart("[Liu2018] Fig. 5a: meshes", "coordination number"),
            anisotropy: chart("[Liu2018] Fig. 5b: meshes", "anisotropy of the contacts"),
            deviation: chart(
                "[Liu2018] Fig. 6: spread of |(s11 - s22) / (s11 + s22)|",
                "standard deviation over the points",
            ),
            curves: Vec::new(),
            deviations: Vec::new(),
            strains: Vec::new(),
            increments: Vec::new(),
            comparisons: Vec::new(),
        }
    }

    /// Largest stress ratio of all meshes.
    fn highest(&self) -> f64 {
        self.curves.iter().flatten().map(|point| point[1]).fold(0.0, f64::max)
    }

    fn add_mesh(&mut self, results: &Results, mesh: (usize, usize)) -> Result<(), ReproduceError> {
        let run = results.run(&name(mesh))?;
        let biaxial = biaxial(run)?;
        let top = peak(&biaxial.ratio)?;
        let label = format!("{} x {} elements", mesh.0, mesh.1);
        let increment = last_field(run, mesh, INCREMENT)?;
        self.comparisons.extend([
            Comparison::new(
                format!("peak stress ratio, {label}"),
                "-",
                Theirs::Value(0.39),
                "[Liu2018] section 4.3.2 (2 x 4)",
                top[1],
                Tolerance::Absolute(0.03),
            ),
            Comparison::reported(format!("strain at the peak, {label}"), "-", top[0]),
            Comparison::new(
                format!("strain at the largest anisotropy less that at the peak, {label}"),
                "-",
                Theirs::Value(0.0),
                "[Liu2018] section 4.2, band of J-1",
                peak(&biaxial.anisotropy)?[0] - top[0],
                Tolerance::Absolute(0.01),
            ),
            Comparison::reported(
                format!("incremental equivalent strain of the last step, largest over mean, {label}"),
                "-",
                concentration(&increment),
            ),
        ]);
        self.ratio.curve(&label, biaxial.ratio.clone());
        self.contacts.curve(&label, biaxial.contacts);
        self.anisotropy.curve(&label, biaxial.anisotropy);
        self.deviation.curve(&label, biaxial.deviation.clone());
        self.curves.push(biaxial.ratio);
        self.deviations.push(biaxial.deviation);
        self.strains.push(last_field(run, mesh, STRAIN)?);
        self.increments.push(increment);
        Ok(())
    }

    /// What changes from mesh to mesh.
    fn compare_meshes(&mut self, size: Size) {
        self.comparisons.push(Comparison::new(
            "largest difference of two meshes up to 5 % strain, over the peak",
            "-",
            Theirs::Value(0.0),
            "[Liu2018] section 4.2, band of J-1",
            spread(&self.curves) / self.highest(),
            Tolerance::Absolute(0.03),
        ));
        for (&(across, up), own) in meshes(size).iter().zip(&self.deviations) {
            self.comparisons.push(Comparison::reported(
                format!("spread of the stress ratio over the points, 5 to 10 % strain, {across} x {up} elements"),
                "-",
                mean_between(own, 0.05, 0.1),
            ));
        }
        if let [.., coarse, fine] = &self.deviations[..]
            && size == Size::Paper
        {
            self.comparisons.push(Comparison::holds(
                "the spread over the points is larger on 4 x 8 elements than on 2 x 4",
                "[Liu2018] section 4.2",
                mean_between(fine, 0.0, 0.1) > mean_between(coarse, 0.0, 0.1),
            ));
        }
        if let [.., coarse, fine] = &self.increments[..] {
            self.comparisons.push(Comparison::holds(
                "the incremental equivalent strain of the last step is more localised on the finest mesh than on the next",
                "[Liu2018] section 4.2, Fig. 7",
                concentration(fine) > concentration(coarse),
            ));
        }
    }

    /// Rows of single Gauss points, and a chart of them for each mesh of which the paper draws one.
    fn add_points(&mut self, results: &Results, size: Size) -> Result<Vec<(&'static str, Chart)>, ReproduceError> {
        let mut charts = Vec::new();
        for (mesh, figure, part) in DRAWN {
            if let Some(place) = meshes(size).iter().position(|own| *own == mesh) {
                let ratios = ratios_of_points(results.run(&name(mesh))?, point_count(mesh))?;
                self.comparisons.extend(of_points(mesh, &ratios));
                charts.push((part, points_chart(figure, mesh, &ratios, &self.curves[place])));
            }
        }
        Ok(charts)
    }

    /// Curves and rows of an assembly within each boundary, and the picture of its force chains within that of the paper.
    fn add_assembly(
        &mut self,
        results: &Results,
        letter: &str,
        of_studies: Option<&Curve>,
        highest: f64,
    ) -> Result<Vec<(String, String)>, ReproduceError> {
        let (mut drawn, mut of_boundaries) = (Vec::new(), Vec::new());
        for (name, words, _) in boundaries(letter) {
            let run = results.run(&assembly_name(letter, name))?;
            let curve = bounded_grains(run)?;
            let is_tied = *name == TIED;
            let is_as_printed = is_tied || *name == SERVO;
            self.comparisons.extend(of_grains(letter, words, &curve, of_studies, highest, is_as_printed)?);
            if is_tied {
                let last = run.table()?.column("increment")?.last().copied().unwrap_or(0.0);
                let stem = format!("increment-{last:04}");
                let picture = run.picture(&format!("contacts/{stem}-force-chains.svg"))?;
                let panel = if letter == "A" { "7e" } else { "7f" };
                let title = format!("[Liu2018] Fig. {panel}: assembly {letter}");
                drawn.push((format!("grains-{}", letter.to_lowercase()), picture.replace(&stem, &title)));
            }
            of_boundaries.push(curve.clone());
            self.ratio.curve(&format!("all grains, assembly {letter}, {words}"), curve);
        }
        if let [tied, _, servo] = &of_boundaries[..] {
            self.comparisons.push(Comparison::new(
                format!("largest difference of the servo from opposite grains that move as one up to 4 % strain, over the peak, assembly {letter}"),
                "-",
                Theirs::Value(0.0),
                "[Liu2018] section 3.2.2, eqs. 33 to 36",
                apart(&[tied.clone(), servo.clone()], 0.04) / highest,
                Tolerance::Absolute(0.03),
            ));
        }
        let walls = grains(results.run(&assembly_name(letter, WALLS))?)?;
        self.comparisons.extend(of_grains(letter, "smooth walls", &walls, of_studies, highest, false)?);
        self.ratio.curve(&format!("all grains, assembly {letter}, smooth walls"), walls);
        Ok(drawn)
    }
}

/// Highest and lowest stress ratio of the points at the strain at which the paper looks for them.
fn of_points(mesh: (usize, usize), ratios: &[Curve]) -> Vec<Comparison> {
    let row = |(which, curve): (&str, &Curve)| {
        let quantity = format!("{which} stress ratio of a point at 9 % strain, {} x {} elements", mesh.0, mesh.1);
        Comparison::reported(quantity, "-", value_at(curve, APART))
    };
    outermost(ratios, APART)
        .into_iter()
        .flat_map(|pair| ["lowest", "highest"].into_iter().zip(pair))
        .map(row)
        .collect()
}

/// The stress ratios of all points, those that are the lowest and the highest at one strain, and that of the body.
fn points_chart(figure: &str, mesh: (usize, usize), ratios: &[Curve], body: &Curve) -> Chart {
    let x = ("axial compression", Scale::Linear);
    let y = ("|(s11 - s22) / (s11 + s22)|", Scale::Linear);
    let title = format!("[Liu2018] Fig. {figure}: points of {} x {} elements", mesh.0, mesh.1);
    let mut chart = Chart::new(&title, x, y);
    chart.curve(&format!("all {} points", ratios.len()), there_and_back(ratios));
    if let Some([low, high]) = outermost(ratios, APART) {
        chart.curve("highest at 9 % strain", high.clone());
        chart.curve("lowest at 9 % strain", low.clone());
    }
    chart.curve("the body", body.clone());
    chart
}

/// Curves that begin in the same state as one line, along each and back: a chart names every line that it draws.
fn there_and_back(curves: &[Curve]) -> Curve {
    curves.iter().flat_map(|curve| curve.iter().chain(curve.iter().rev())).copied().collect()
}

/// The curves with the lowest and the highest value at a strain, of those that reach it; `None` if fewer than two do.
fn outermost(curves: &[Curve], strain: f64) -> Option<[&Curve; 2]> {
    let mut reaching: Vec<(f64, &Curve)> =
        curves.iter().map(|curve| (value_at(curve, strain), curve)).filter(|(value, _)| value.is_finite()).collect();
    reaching.sort_by(|one, other| one.0.total_cmp(&other.0));
    match reaching[..] {
        [(_, low), .., (_, high)] => Some([low, high]),
        _ => None,
    }
}

/// Peak of an assembly of all grains, and its difference from the mesh of the studies over the peak of the meshes. Both are held against
/// the paper if the assembly is bounded as there.
fn of_grains(
    letter: &str,
    boundary: &str,
    grains: &Curve,
    of_studies: Option<&Curve>,
    highest: f64,
    is_as_printed: bool,
) -> Result<Vec<Comparison>, ReproduceError> {
    let top = peak(grains)?;
    let row = |quantity: String, theirs: f64, source: &'static str, ours: f64| {
        if is_as_printed {
            Comparison::new(quantity, "-", Theirs::Value(theirs), source, ours, Tolerance::Absolute(0.03))
        } else {
            Comparison::reported(quantity, "-", ours)
        }
    };
    let who = format!("all grains, assembly {letter}, {boundary}");
    let mut rows = vec![
        row(format!("peak stress ratio, {who}"), 0.39, "[Liu2018] Fig. 4", top[1]),
        Comparison::reported(format!("strain at the peak, {who}"), "-", top[0]),
    ];
    for strain in OF_GRAINS {
        let quantity = format!(
            "largest difference from 2 x 4 elements up to {:.0} % strain, over the peak, {who}",
            100.0 * strain
        );
        let ours = |mesh: &Curve| apart(&[mesh.clone(), grains.clone()], strain) / highest;
        rows.extend(of_studies.map(|mesh| row(quantity, 0.0, "[Liu2018] section 4.2, band of J-1", ours(mesh))));
    }
    Ok(rows)
}

/// Largest value of the elements over their mean; the elements of a panel are equally large at the start.
fn concentration(panel: &Panel) -> f64 {
    let values = || panel.patches.iter().map(|patch| patch.1);
    values().fold(f64::NEG_INFINITY, f64::max) / (values().sum::<f64>() / panel.patches.len() as f64)
}

/// A field of the elements at the last step with fields, by the mesh and the compression of that step.
fn last_field(run: &Finished, mesh: (usize, usize), field: &str) -> Result<Panel, ReproduceError> {
    let last = Fields::steps(run).last().copied().unwrap_or(0);
    let compression = value_at(&run.table()?.curve("step", "axial_compression")?, last as f64);
    let fields = Fields::read(run, last)?;
    let patches = fields.outlines()?.into_iter().zip(fields.element_values(field)?).collect();
    Ok(Panel { name: format!("{} x {}, {:.1} %", mesh.0, mesh.1, 100.0 * compression), patches })
}

/// Largest difference between two curves at the same strain up to 5 %, of those that reach it; NaN if fewer than two do.
fn spread(curves: &[Curve]) -> f64 {
    apart(curves, 0.05)
}

/// The same up to another strain.
fn apart(curves: &[Curve], strain: f64) -> f64 {
    let reaches = |curve: &&Curve| curve.last().is_some_and(|point| point[0] >= strain * (1.0 - 1e-9));
    let whole: Vec<&Curve> = curves.iter().filter(reaches).collect();
    if whole.len() < 2 {
        return f64::NAN;
    }
    let at = |strain: f64| {
        let values = whole.iter().map(move |curve| value_at(curve, strain)).filter(|value| value.is_finite());
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    };
    (1..=25).map(|step| at(0.04 * strain * f64::from(step))).map(|(low, high)| high - low).fold(0.0, f64::max)
}

/// The compression of an assembly bounded by grains: stress ratio over the compression since the isotropic increment.
fn bounded_grains(run: &Finished) -> Result<Curve, ReproduceError> {
    let table = run.table()?;
    let stress = table.column("sigma_xx")?.into_iter().zip(table.column("sigma_yy")?);
    let height = table.column("F_yy")?;
    // Row 0 is the packing as cut, row 1 the isotropic state.
    let start = height.get(1).copied().unwrap_or(f64::NAN);
    let compression = height.iter().map(|now| 1.0 - now / start);
    Ok(compression.zip(stress).map(|(x, (xx, yy))| [x, liu_ratio(yy / xx)]).skip(1).collect())
}

/// The biaxial stage of the specimen between walls: stress ratio over the compression since its begin.
fn grains(run: &Finished) -> Result<Curve, ReproduceError> {
    let table = run.table()?.stage("biaxial")?;
    let stress = table.column("wall_sigma_xx")?.into_iter().zip(table.column("wall_sigma_yy")?);
    let strain = table.column("strain_yy")?;
    let compression = strain.iter().map(|strain_yy| 1.0 - (1.0 + strain_yy) / (1.0 + strain[0]));
    Ok(compression.zip(stress).map(|(x, (xx, yy))| [x, liu_ratio(yy / xx)]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_that_stop_early_are_not_compared() {
        let up_to = |end: f64, level: f64| -> Curve { vec![[0.0, 0.0], [0.5 * end, level], [end, level]] };
        assert!((spread(&[up_to(0.1, 0.4), up_to(0.1, 0.3)]) - 0.1).abs() < 1e-12);
        assert!(spread(&[up_to(0.1, 0.4), up_to(0.01, 0.3)]).is_nan());
        assert!((spread(&[up_to(0.1, 0.4), up_to(0.02, 0.1), up_to(0.1, 0.4)])).abs() < 1e-12);
    }

    #[test]
    fn the_outermost_points_are_those_that_reach_the_strain() {
        let up_to = |end: f64, level: f64| -> Curve { vec![[0.0, 0.0], [0.5 * end, level], [end, level]] };
        let curves = [up_to(0.1, 0.3), up_to(0.02, 0.9), up_to(0.1, 0.2), up_to(0.1, 0.4)];
        assert_eq!(outermost(&curves, APART), Some([&curves[2], &curves[3]]));
        assert_eq!(outermost(&curves[..2], APART), None);
    }

    #[test]
    fn points_are_one_line_that_returns_to_the_state_of_all() {
        let line = there_and_back(&[vec![[0.0, 0.0], [1.0, 2.0]], vec![[0.0, 0.0], [1.0, 3.0]]]);
        let ends: Vec<f64> = line.iter().map(|point| point[1]).collect();
        assert_eq!(ends, [0.0, 2.0, 2.0, 0.0, 0.0, 3.0, 3.0, 0.0]);
    }

    #[test]
    fn points_are_written_of_the_meshes_whose_points_are_drawn() {
        let settings = |run: &str| -> Vec<String> {
            let runs = runs(Size::Paper).into_iter().filter(|own| own.name == run);
            runs.flat_map(|own| own.settings).filter(|setting| setting.starts_with("output.points")).collect()
        };
        assert!(settings("mesh-1x2").is_empty());
        assert!(settings("mesh-2x4")[0].ends_with(", 31]") && settings("mesh-4x8")[0].ends_with(", 127]"));
        let assemblies =
            |size| runs(size).into_iter().map(|run| run.name).filter(|name| name.starts_with("grains")).collect();
        let small: Vec<String> = assemblies(Size::Small);
        assert_eq!(small, ["grains-a-tied", "grains-a-platens", "grains-a-servo", "grains-a-walls"]);
        let paper: Vec<String> = assemblies(Size::Paper);
        assert_eq!(paper[4..], ["grains-b-tied", "grains-b-platens", "grains-b-walls"]);
    }
}

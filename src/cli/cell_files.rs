//! Files of one state of a cell: grains, contacts, force chains, rose diagrams and displacement fluctuations.

use super::force_distribution::ForceDistribution;
use charts::{Arrows, ChartError, ForceChains, ForceLine, GrainMap, Rose, SpatialChains, SpatialLine, Stereonet};
use macro_solver::output::{Field, OutputError, write_atomically, write_lines, write_particles};
use rve_server::homogenization::picture::{CellPicture, ContactLine};
use rve_server::space::{apply, inverse, transpose};
use std::fmt::Write as _;
use std::path::Path;

/// Sectors of a rose diagram; those of a direction and its opposite are alike.
const SECTORS: usize = 36;

/// Writes the grains as a cloud; `more` are fields in addition to radius, rotation, contacts and rattlers.
///
/// # Errors
/// See [`write_particles`].
pub(super) fn write_grains(path: &Path, picture: &CellPicture, more: Vec<Field>) -> Result<(), OutputError> {
    let mut contacts = vec![0.0; picture.centres.len()];
    for grain in picture.contacts.iter().flat_map(|contact| contact.grains) {
        contacts[grain as usize] += 1.0;
    }
    let rotation = match picture.dimension {
        2 => Field::scalar("rotation", picture.rotations.iter().map(|rotation| rotation[2]).collect()),
        _ => Field::vector("rotation", &picture.rotations),
    };
    let mut fields = vec![
        Field::scalar("radius", picture.radii.clone()),
        rotation,
        Field::scalar("contacts", contacts),
        Field::scalar("rattler", picture.rattlers.iter().map(|&rattler| f64::from(u8::from(rattler))).collect()),
    ];
    fields.extend(more);
    write_particles(path, &picture.centres, &fields)
}

/// Writes the contacts as lines from centre to centre.
///
/// # Errors
/// See [`write_lines`].
pub(super) fn write_contacts(path: &Path, picture: &CellPicture) -> Result<(), OutputError> {
    let lines: Vec<[[f64; 3]; 2]> = picture.contacts.iter().map(|contact| [contact.from, contact.to]).collect();
    let of = |name: &str, value: fn(&ContactLine) -> f64| {
        Field::scalar(name, picture.contacts.iter().map(value).collect())
    };
    let fields = [
        of("normal_force", |contact| contact.normal_force),
        of("tangential_force", |contact| contact.tangential_force),
        of("force", |contact| contact.normal_force.hypot(contact.tangential_force)),
        of("sliding", |contact| f64::from(u8::from(contact.is_sliding))),
        of("overlap", |contact| contact.overlap),
        Field::vector("force_on_first", &picture.contacts.iter().map(|contact| contact.force).collect::<Vec<_>>()),
    ];
    write_lines(path, &lines, &fields)
}

/// The contacts as CSV text, a row for each.
pub(super) fn contacts_csv(picture: &CellPicture) -> String {
    let mut text =
        "grain_1,grain_2,x_1,y_1,z_1,x_2,y_2,z_2,normal_force,tangential_force,overlap,sliding,force_x,force_y,force_z\n"
            .to_owned();
    for contact in &picture.contacts {
        let [first, second] = contact.grains;
        let listed = |numbers: &mut dyn Iterator<Item = f64>| {
            numbers.map(|number| format!("{number:e}")).collect::<Vec<_>>().join(",")
        };
        let ends = listed(&mut contact.from.into_iter().chain(contact.to));
        let sizes = listed(&mut [contact.normal_force, contact.tangential_force, contact.overlap].into_iter());
        let (sliding, force) = (u8::from(contact.is_sliding), listed(&mut contact.force.into_iter()));
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{first},{second},{ends},{sizes},{sliding},{force}");
    }
    text
}

/// Endings of all files that [`write_all`] may write, behind the stem.
pub(super) const ENDINGS: [&str; 10] = [
    "-grains.vtp",
    "-contacts.vtp",
    "-contacts.csv",
    "-force-distribution.csv",
    "-force-distribution.svg",
    "-force-chains.svg",
    "-rotations.svg",
    "-normals.svg",
    "-normal-forces.svg",
    "-fluctuations.svg",
];

/// Writes everything about a state into a folder that exists, under names that begin with `stem`: `.vtp` of grains and contacts, the
/// contacts and the distribution of their forces as CSV, force chains, and directions of contacts and forces: rose diagrams of discs, nets
/// of spheres. Discs have a picture of their rotations. With displacement fluctuations `.vtp` has them too, and discs a picture.
///
/// # Errors
/// A file cannot be written.
pub(super) fn write_all(
    folder: &Path,
    stem: &str,
    picture: &CellPicture,
    fluctuations: Option<&[[f64; 3]]>,
) -> Result<(), OutputError> {
    let file = |ending: &str| folder.join(format!("{stem}-{ending}"));
    let more = fluctuations.map(|all| Field::vector("displacement_fluctuation", all));
    write_grains(&file("grains.vtp"), picture, more.into_iter().collect())?;
    write_contacts(&file("contacts.vtp"), picture)?;
    write_atomically(&file("contacts.csv"), contacts_csv(picture).as_bytes())?;
    let write = |ending: &str, text: String| write_atomically(&file(ending), text.as_bytes());
    let distribution = ForceDistribution::of(picture);
    write("force-distribution.csv", distribution.to_csv())?;
    write("force-distribution.svg", drawn(&file("force-distribution.svg"), distribution.to_svg(stem))?)?;
    if picture.dimension == 2 {
        write("force-chains.svg", force_chains(stem, picture).to_svg())?;
        write("rotations.svg", rotations(stem, picture).to_svg())?;
        write("normals.svg", normals(stem, picture).to_svg())?;
        write("normal-forces.svg", forces(stem, picture).to_svg())?;
        if let Some(fluctuations) = fluctuations {
            write("fluctuations.svg", arrows(stem, picture, fluctuations).to_svg())?;
        }
    } else {
        write("force-chains.svg", spatial_chains(stem, picture).to_svg())?;
        let [normals, forces] = nets(stem, picture);
        write("normals.svg", normals.to_svg())?;
        write("normal-forces.svg", forces.to_svg())?;
    }
    Ok(())
}

/// The text of a chart, or the refusal of its file.
fn drawn(file: &Path, chart: Result<String, ChartError>) -> Result<String, OutputError> {
    chart.map_err(|error| OutputError::write(file, std::io::Error::other(error)))
}

/// The force chains of a cell of spheres: contacts from the grain that lies within the cell, those across its border on one side.
fn spatial_chains(title: &str, picture: &CellPicture) -> SpatialChains {
    let cell = [0, 1, 2].map(|row| picture.cell[row]);
    let line = |contact: &ContactLine| {
        let moved = into_cell(cell, contact.from);
        let to = [0, 1, 2].map(|axis| moved[axis] + contact.to[axis] - contact.from[axis]);
        SpatialLine { from: moved, to, force: -contact.normal_force, is_sliding: contact.is_sliding }
    };
    SpatialChains {
        title: title.to_owned(),
        cell,
        mean_radius: picture.radii.iter().sum::<f64>() / picture.radii.len().max(1) as f64,
        lines: picture.contacts.iter().map(line).collect(),
    }
}

/// The image of a place within the cell that begins at the origin.
fn into_cell(rows: [[f64; 3]; 3], place: [f64; 3]) -> [f64; 3] {
    let columns = transpose(&rows);
    let whole = apply(&inverse(&columns), place).map(f64::floor);
    let moved = apply(&columns, whole);
    [0, 1, 2].map(|axis| place[axis] - moved[axis])
}

/// Contact normals on the sphere, as density over that of evenly spread ones, and mean normal force by direction, N.
fn nets(title: &str, picture: &CellPicture) -> [Stereonet; 2] {
    let mut sums = vec![(0.0, 0.0); Stereonet::CELLS];
    for contact in &picture.contacts {
        let normal = [0, 1, 2].map(|axis| contact.to[axis] - contact.from[axis]);
        if let Some(cell) = Stereonet::cell(normal) {
            sums[cell].0 += 1.0;
            sums[cell].1 -= contact.normal_force;
        }
    }
    let even = picture.contacts.len() as f64 / Stereonet::CELLS as f64;
    let net = |title: String, quantity: &str, value: &dyn Fn(&(f64, f64)) -> f64| Stereonet {
        title,
        quantity: quantity.to_owned(),
        values: sums.iter().map(value).collect(),
    };
    let density = |(count, _): &(f64, f64)| count / even;
    [
        net(format!("{title}: contact normals"), "contacts over those of an even spread", &density),
        net(format!("{title}: mean normal force"), "compression, N", &|(count, sum)| sum / count),
    ]
}

/// Displacement fluctuations of discs.
pub(super) fn arrows(title: &str, picture: &CellPicture, fluctuations: &[[f64; 3]]) -> Arrows {
    let (outline, grains) = in_plane(picture);
    Arrows {
        title: title.to_owned(),
        quantity: "displacement fluctuations".to_owned(),
        outline,
        grains,
        arrows: fluctuations.iter().map(|fluctuation| plane(*fluctuation)).collect(),
    }
}

/// Rotations of discs since the start, as colours.
pub(super) fn rotations(title: &str, picture: &CellPicture) -> GrainMap {
    let (outline, grains) = in_plane(picture);
    GrainMap {
        title: format!("{title}: rotation of the grains"),
        quantity: "rotation since the start, counter-clockwise".to_owned(),
        unit: "rad".to_owned(),
        outline,
        grains,
        values: picture.rotations.iter().map(|rotation| rotation[2]).collect(),
    }
}

/// The force chains of discs. Grains of a periodic cell are drawn within it; a contact across its border is drawn at both sides. Another body
/// is drawn as it lies.
pub(super) fn force_chains(title: &str, picture: &CellPicture) -> ForceChains {
    let (outline, grains) = in_plane(picture);
    let mut lines = Vec::new();
    for contact in &picture.contacts {
        let branch = [0, 1].map(|axis| contact.to[axis] - contact.from[axis]);
        let [first, second] = contact.grains.map(|grain| grains[grain as usize].0);
        let line = |from: [f64; 2], to: [f64; 2]| ForceLine {
            from,
            to,
            force: -contact.normal_force,
            is_sliding: contact.is_sliding,
        };
        let end = [0, 1].map(|axis| first[axis] + branch[axis]);
        lines.push(line(first, end));
        if (end[0] - second[0]).hypot(end[1] - second[1]) > 1e-9 * branch[0].hypot(branch[1]) {
            lines.push(line([0, 1].map(|axis| second[axis] - branch[axis]), second));
        }
    }
    ForceChains { title: title.to_owned(), outline, grains, lines }
}

/// Outline, centres and radii of discs as they are drawn, m: those of a periodic cell within it.
fn in_plane(picture: &CellPicture) -> (Vec<[f64; 2]>, Vec<([f64; 2], f64)>) {
    let grains = picture.centres.iter().map(|centre| plane(*centre)).zip(picture.radii.iter().copied());
    if !picture.outline.is_empty() {
        return (picture.outline.iter().map(|corner| plane(*corner)).collect(), grains.collect());
    }
    let [a, b] = [plane(picture.cell[0]), plane(picture.cell[1])];
    let area = a[0] * b[1] - a[1] * b[0];
    let wrapped = |[x, y]: [f64; 2]| {
        let along = ((x * b[1] - y * b[0]) / area).floor();
        let across = ((a[0] * y - a[1] * x) / area).floor();
        [x - along * a[0] - across * b[0], y - along * a[1] - across * b[1]]
    };
    (
        vec![[0.0; 2], a, [a[0] + b[0], a[1] + b[1]], b],
        grains.map(|(centre, radius)| (wrapped(centre), radius)).collect(),
    )
}

fn plane([x, y, _]: [f64; 3]) -> [f64; 2] {
    [x, y]
}

/// Number of contacts and sum of their compression by sector.
fn by_sector(picture: &CellPicture) -> Vec<(f64, f64)> {
    let mut sectors = vec![(0.0, 0.0); SECTORS];
    for contact in &picture.contacts {
        let angle = (contact.to[1] - contact.from[1]).atan2(contact.to[0] - contact.from[0]);
        let share = angle.rem_euclid(std::f64::consts::PI) / std::f64::consts::PI;
        // The remainder of a small negative angle rounds to the whole.
        let sector = ((share * (SECTORS / 2) as f64) as usize).min(SECTORS / 2 - 1);
        for side in [sector, sector + SECTORS / 2] {
            sectors[side].0 += 1.0;
            sectors[side].1 -= contact.normal_force;
        }
    }
    sectors
}

/// How many contacts lie in each direction.
fn normals(title: &str, picture: &CellPicture) -> Rose {
    Rose {
        title: format!("{title}: contact normals"),
        quantity: "contacts in 10 degrees".to_owned(),
        values: by_sector(picture).into_iter().map(|(count, _)| count).collect(),
    }
}

/// Mean normal force of the contacts of each direction.
fn forces(title: &str, picture: &CellPicture) -> Rose {
    let mean = |(count, sum): (f64, f64)| if count > 0.0 { sum / count } else { 0.0 };
    Rose {
        title: format!("{title}: mean normal force"),
        quantity: "compression, N".to_owned(),
        values: by_sector(picture).into_iter().map(mean).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::earlier_files::remove_numbered;

    /// Two discs with one contact at 35 degrees, across the right border of a cell of 4 m x 4 m.
    fn two_discs() -> CellPicture {
        let (sin, cos) = 35_f64.to_radians().sin_cos();
        let from = [3.5, 1.0, 0.0];
        CellPicture {
            dimension: 2,
            cell: vec![[4.0, 0.0, 0.0], [0.0, 4.0, 0.0]],
            outline: Vec::new(),
            centres: vec![from, [3.5 + 2.0 * cos - 4.0, 1.0 + 2.0 * sin, 0.0]],
            radii: vec![1.0, 1.1],
            rotations: vec![[0.0, 0.0, 0.25], [0.0; 3]],
            rattlers: vec![true, true],
            contacts: vec![ContactLine {
                grains: [0, 1],
                from,
                to: [3.5 + 2.0 * cos, 1.0 + 2.0 * sin, 0.0],
                normal_force: -12.0,
                tangential_force: 5.0,
                force: [-12.0 * cos - 5.0 * sin, -12.0 * sin + 5.0 * cos, 0.0],
                overlap: 0.1,
                is_sliding: true,
            }],
        }
    }

    #[test]
    fn one_contact_fills_the_two_sectors_of_its_direction() {
        let picture = two_discs();
        let filled = |rose: Rose| {
            let values = rose.values.into_iter().enumerate();
            values.filter(|(_, value)| *value > 0.0).collect::<Vec<_>>()
        };
        assert_eq!(filled(normals("one", &picture)), [(3, 1.0), (21, 1.0)], "30 to 40 and 210 to 220 degrees");
        assert_eq!(filled(forces("one", &picture)), [(3, 12.0), (21, 12.0)]);
    }

    #[test]
    fn a_contact_across_the_border_is_drawn_at_both_sides() {
        let chains = force_chains("one", &two_discs());
        let [one, other] = chains.lines[..] else { panic!("two lines: {chains:?}") };
        assert_eq!((one.force, one.is_sliding), (12.0, true));
        assert!((one.from[0] - 3.5).abs() < 1e-12 && one.to[0] > 4.0 && other.from[0] < 0.0);
        assert!((other.to[0] - (one.to[0] - 4.0)).abs() < 1e-12 && (other.to[1] - one.to[1]).abs() < 1e-12);
        // Moved by a whole cell, the contact is one of the inside.
        let mut inside = two_discs();
        inside.contacts[0].from[0] = 1.0;
        inside.contacts[0].to[0] -= 2.5;
        inside.centres = vec![inside.contacts[0].from, inside.contacts[0].to];
        assert_eq!(force_chains("one", &inside).lines.len(), 1);
    }

    #[test]
    fn a_body_is_drawn_as_it_lies() {
        let mut frame = two_discs();
        frame.centres[1] = frame.contacts[0].to;
        frame.outline = vec![frame.centres[0], frame.centres[1], [0.0, 9.0, 0.0]];
        let chains = force_chains("one", &frame);
        assert_eq!(chains.outline[2], [0.0, 9.0]);
        let [line] = chains.lines[..] else { panic!("one line: {chains:?}") };
        assert!(line.to[0] > 4.0 && chains.grains[1].0 == line.to, "beyond where a cell would end: {line:?}");
        assert_eq!(rotations("one", &frame).values, [0.25, 0.0]);
    }

    /// Two spheres with a vertical contact, across the lower border of a skewed cell.
    #[test]
    fn a_contact_in_space_is_drawn_from_within_the_cell_and_fills_one_cell_of_the_net() {
        let mut picture = two_discs();
        picture.dimension = 3;
        picture.cell = vec![[4.0, 0.0, 0.0], [1.0, 4.0, 0.0], [0.0, 0.0, 4.0]];
        picture.contacts[0] = ContactLine { from: [0.5, -0.5, 9.0], to: [0.5, -2.5, 9.0], ..picture.contacts[0] };
        let [line] = spatial_chains("one", &picture).lines[..] else { panic!("one line") };
        let near =
            |found: [f64; 3], expected: [f64; 3]| (0..3).all(|axis| (found[axis] - expected[axis]).abs() < 1e-12);
        assert!(near(line.from, [1.5, 3.5, 1.0]) && near(line.to, [1.5, 1.5, 1.0]) && line.force == 12.0, "{line:?}");
        let [normals, forces] = nets("one", &picture);
        let cell = Stereonet::cell([0.0, 1.0, 0.0]).unwrap();
        assert_eq!((normals.values[cell], forces.values[cell]), (Stereonet::CELLS as f64, 12.0));
        assert_eq!(normals.values.iter().filter(|value| **value > 0.0).count(), 1);
        assert_eq!(forces.values.iter().filter(|value| value.is_finite()).count(), 1);
    }

    #[test]
    fn the_files_of_a_state_hold_its_one_contact() {
        let folder = tempfile::tempdir().unwrap();
        let fluctuations = [[1e-3, 0.0, 0.0], [-1e-3, 0.0, 0.0]];
        write_all(folder.path(), "increment-0007", &two_discs(), Some(&fluctuations)).unwrap();
        let file =
            |ending: &str| std::fs::read_to_string(folder.path().join(format!("increment-0007-{ending}"))).unwrap();
        let csv = file("contacts.csv");
        assert_eq!(csv.lines().count(), 2);
        assert!(csv.lines().nth(1).unwrap().contains(",-1.2e1,5e0,1e-1,1,"), "{csv}");
        let lines = vtkio::Vtk::import(folder.path().join("increment-0007-contacts.vtp")).unwrap();
        let vtkio::model::DataSet::PolyData { pieces, .. } = lines.data else { panic!("not poly data") };
        let piece = pieces[0].load_piece_data(None).unwrap();
        assert_eq!(piece.lines.unwrap().num_cells(), 1);
        let names: Vec<&str> = piece.data.cell.iter().map(|attribute| attribute.name()).collect();
        assert_eq!(names, ["normal_force", "tangential_force", "force", "sliding", "overlap", "force_on_first"]);
        for svg in ["force-chains.svg", "normals.svg", "normal-forces.svg", "fluctuations.svg"] {
            assert!(file(svg).contains("increment-0007"));
        }
        assert!(folder.path().join("increment-0007-grains.vtp").is_file());
        // A later test removes all of them.
        remove_numbered(folder.path(), "increment", &ENDINGS).unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

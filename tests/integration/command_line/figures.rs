//! Probes of parts, profiles, tables of Gauss points and files of cells, as one short run writes them.

use crate::harness::commands::succeeded;
use crate::harness::table::Table;
use std::fs;
use std::path::Path;
use vtkio::Vtk;
use vtkio::model::DataSet;

/// The small scene in two stages, with everything that a figure may need.
const MORE: &str = "
[[stage]]
name = \"settle\"
loading = { increments = 1 }

[[stage]]
name = \"compress\"
loading = { increments = 3 }

[[stage.boundary]]
set = \"top\"
platen = \"smooth\"
displacement = { y = -3.0e-4 }

[[probe]]
name = \"compression\"
kind = \"compression\"
from = \"bottom\"
to = \"top\"
component = \"y\"
reference = \"compress\"

[[probe]]
name = \"volume\"
kind = \"volume_change\"

[[probe]]
name = \"volume_of_stage\"
kind = \"volume_change\"
reference = \"compress\"

[[probe]]
name = \"porosity\"
kind = \"porosity\"

[[probe]]
name = \"void_ratio_of_one\"
kind = \"void_ratio\"
part = { element = 2, point = 1 }

[[probe]]
name = \"sigma_bar\"
kind = \"sigma_bar\"

[[probe]]
name = \"major\"
kind = \"principal_stress\"
component = \"major\"

[[probe]]
name = \"shear_mean\"
kind = \"shear_strain\"

[[probe]]
name = \"shear_least\"
kind = \"shear_strain\"
statistic = \"minimum\"

[[probe]]
name = \"shear_most\"
kind = \"shear_strain\"
statistic = \"maximum\"

[[probe]]
name = \"shear_spread\"
kind = \"shear_strain\"
statistic = \"standard_deviation\"

[[probe]]
name = \"lower_half\"
kind = \"fabric_anisotropy\"
part = { from = [0.0, 0.0], to = [0.05, 0.05] }

[[probe]]
name = \"band\"
kind = \"band_inclination\"

[[probe]]
name = \"increment\"
kind = \"equivalent_strain_increment\"
part = { point = 3 }

[[profile]]
name = \"rows\"
kind = \"porosity\"
axis = \"y\"
bins = 8
";

/// The increment of point 3 as probe and column is the norm of the change of its deformation gradient from row to row, and elements have
/// the mean over their points.
fn increments_are_those_of_the_deformation(out: &Path, probe: &[f64]) {
    let point = Table::read(&out.join("points/point-0003.csv"));
    let deformation = point.columns(["F_xx", "F_xy", "F_yx", "F_yy"]);
    let increment = point.column("equivalent_strain_increment");
    for row in 1..5 {
        let pairs = deformation[row].iter().zip(&deformation[row - 1]);
        let change = pairs.map(|(now, before)| (now - before).powi(2)).sum::<f64>().sqrt();
        for found in [increment[row], probe[row]] {
            assert!((found - change).abs() < 1e-14, "row {row}: {found} {change}");
        }
    }
    assert!(probe[0] < 1e-3 && probe[3] > 5e-4, "{probe:?}");
    let fields = Vtk::import(out.join("fields/step-0004.vtu")).unwrap();
    let DataSet::UnstructuredGrid { pieces, .. } = fields.data else { panic!("not a mesh") };
    let piece = pieces[0].load_piece_data(None).unwrap();
    assert_eq!(piece.data.cell.last().unwrap().name(), "equivalent_strain_increment");
    let units = fs::read_to_string(out.join("units.json")).unwrap();
    let units: serde_json::Value = serde_json::from_str(&units).unwrap();
    assert_eq!(units["fields"]["equivalent_strain_increment"], "-");
    assert_eq!(units["points"]["equivalent_strain_increment"], "-");
}

/// Names of the fields of the grains of point 0 after a step.
fn fields_of_grains(out: &Path, step: usize) -> Vec<String> {
    let grains = Vtk::import(out.join(format!("grains/point-0000-step-{step:04}.vtp"))).unwrap();
    let DataSet::PolyData { pieces, .. } = grains.data else { panic!("not poly data") };
    let grains = pieces[0].load_piece_data(None).unwrap();
    grains.data.point.iter().map(|attribute| attribute.name().to_owned()).collect()
}

#[test]
fn a_short_run_writes_what_figures_are_drawn_from() {
    let place = tempfile::tempdir().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scene = fs::read_to_string(root.join("scenes/biaxial-small.toml")).unwrap();
    let scene = scene.replace("../packings", root.join("packings").to_str().unwrap());
    let scene = scene.replace("displacement = { y = -5.0e-4 }", "displacement = { y = 0.0 }");
    let head = scene.split("[[probe]]").next().unwrap().replace(
        "grains = [0]",
        "grains = [0]\npoints = [9, 3]\ngrains_from = 'compress'\nfields = ['equivalent_strain_increment']",
    );
    let path = place.path().join("figures.toml");
    fs::write(&path, format!("{head}{MORE}")).unwrap();
    let out = place.path().join("out");
    succeeded(&["run", path.to_str().unwrap(), "--workers", "1", "--out", out.to_str().unwrap(), "--quiet"]);

    let history = Table::read(&out.join("history.csv"));
    let last = |name: &str| history.last(name);
    assert_eq!(history.column("step"), [0.0, 1.0, 2.0, 3.0, 4.0]);
    assert_eq!(history.column("compression")[..2], [0.0, 0.0], "the stage has not begun");
    assert!((last("compression") - 3.0e-4 / 0.1).abs() < 1e-12);
    let of_stage = (1.0 + last("volume")) / (1.0 + history.column("volume")[1]) - 1.0;
    assert!((last("volume_of_stage") - of_stage).abs() < 1e-12);
    assert!(last("shear_least") < last("shear_mean") && last("shear_mean") < last("shear_most"));
    assert!(last("shear_spread") > 0.0 && last("shear_spread") < last("shear_most") - last("shear_least"));
    assert!(last("major") < -1.1e5 && last("sigma_bar") > 0.1 && last("lower_half") > 0.0);
    // No band before anything has strained; at the end one of -62.9 degrees through this small body.
    let band = history.column("band");
    assert!(band[..2].iter().all(|angle| angle.is_nan()), "{band:?}");
    assert!((last("band") + 62.9).abs() < 5.0, "{band:?}");

    let rows = Table::read(&out.join("profiles/rows.csv"));
    assert_eq!(rows.count(), 5 * 8, "eight rows of points at five steps");
    assert!((rows.column("coordinate")[0] - 0.1 / 16.0).abs() < 1e-15);
    // At the start all bins have the same volume, so that the mean over them is that over the body.
    let mean = rows.column("value")[..8].iter().sum::<f64>() / 8.0;
    assert!((mean - history.column("porosity")[0]).abs() < 1e-12);

    let point = Table::read(&out.join("points/point-0009.csv"));
    for (one, other) in point.column("void_ratio").iter().zip(&history.column("void_ratio_of_one")) {
        assert!((one - other).abs() < 1e-14, "element 2, point 1: {one} {other}");
    }
    assert!(
        point.column("sigma_yy")[4] < -1.1e5
            && point.column("fabric_xx")[4] > 0.0
            && point.column("sigma_zz")[4] == 0.0
    );
    increments_are_those_of_the_deformation(&out, &history.column("increment"));

    let lines = Vtk::import(out.join("grains/contacts-0000-step-0004.vtp")).unwrap();
    let DataSet::PolyData { pieces, .. } = lines.data else { panic!("not poly data") };
    let piece = pieces[0].load_piece_data(None).unwrap();
    assert!(piece.lines.unwrap().num_cells() > 100, "some two contacts for each of 100 discs");
    assert_eq!(piece.data.cell[0].name(), "normal_force");
    let fixed = ["radius", "rotation", "contacts", "rattler"];
    assert_eq!(fields_of_grains(&out, 1), fixed, "the stage that fluctuations are counted from has not begun");
    assert_eq!(fields_of_grains(&out, 4), [&fixed[..], &["displacement_fluctuation"]].concat());
    assert!(out.join("grains/contacts-0000.pvd").is_file());
}

//! `grainspan specimen` and `grainspan pack` as a user runs them: defaults, tables, closing lines, exit codes.

use crate::harness::Site;
use crate::harness::table::Table;
use claims::Claim;
use std::path::Path;
use std::process::Output;

fn run(site: &Site, arguments: &[&str]) -> (i32, String, Output) {
    let output = site.program(arguments).stdout(std::process::Stdio::piped()).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code().unwrap(), text, output)
}

fn column(table: &str, name: &str) -> Vec<f64> {
    Table::of(table).column(name)
}

/// The shipped scene, shortened: what it starts from is told, the table is written, any number of threads gives the same bytes,
/// and a stage that did not come to balance ends with exit code 1 and its reason.
#[test]
fn the_shipped_specimen_runs_and_says_where_it_starts() {
    let site = Site::new();
    let short = ["--set", "stage.0.steps=3000", "--set", "stage.1.steps=1500", "--set", "stage.1.rows=5"];
    let mut tables = Vec::new();
    for threads in ["1", "2"] {
        let (out, pictures) = (site.path(&format!("{threads}.csv")), site.path(&format!("pictures-{threads}")));
        let mut arguments = vec!["specimen", "scenes/specimen-biaxial.toml", "--threads", threads];
        arguments.extend(["--out", out.to_str().unwrap(), "--pictures", pictures.to_str().unwrap()]);
        arguments.extend(short);
        let (code, text, _) = run(&site, &arguments);
        assert_eq!(code, 1, "{text}");
        assert!(text.contains("stages without equilibrium at the end: 1"), "{text}");
        assert!(text.contains("stress at the start, from the contacts between grains: xx -1."), "{text}");
        assert!(text.contains("contacts kept their history") && text.contains("the copies lean by 2.8 %"), "{text}");
        assert!(pictures.join("grains-0005.vtp").exists() && pictures.join("grains.pvd").exists());
        tables.push(std::fs::read_to_string(out).unwrap());
    }
    assert_eq!(tables[0], tables[1]);
    assert_eq!(tables[0].lines().count(), 1 + 1 + 5);
    let strain = column(&tables[0], "strain_yy");
    assert!(strain.windows(2).all(|pair| pair[1] < pair[0]), "{strain:?}");
    // What the packing had stored went with its border, before the walls had done any work.
    let parts = ["elastic_energy", "friction_work", "damping_work"].map(|name| column(&tables[0], name));
    for (row, missing) in column(&tables[0], "missing_energy").iter().enumerate() {
        let all: f64 = parts.iter().map(|part| part[row]).sum();
        assert!(missing.abs() < 2e-2 * all, "row {row}: {missing} of {all} J");
    }
}

/// Between walls and to balance, with rolling resistance and contact damping and nothing else set.
#[test]
fn a_specimen_with_rolling_and_damping_comes_to_balance() {
    let site = Site::new();
    let test = site.path("rolling.toml");
    let packing = Path::new(env!("CARGO_MANIFEST_DIR")).join("packings/discs-100.json");
    let text = format!(
        "packing = \"{}\"\ntiles = [1, 1]\n[contact]\nlaw = \"linear\"\nmodulus = 1e8\nstiffness_ratio = 0.5\nfriction = 0.5\n\
         density = 2650.0\ndamping = 0.2\nrolling_stiffness = 1.0\nrolling_friction = 0.1\n[[stage]]\nname = \"isotropic\"\n\
         steps = 60000\nuntil_balance = 1e-3\nstress = {{ xx = -1e5, yy = -1e5 }}\nrows = 1\n",
        packing.display()
    );
    std::fs::write(&test, text).unwrap();
    let (code, text, output) = run(&site, &["specimen", test.to_str().unwrap()]);
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("warnings: none"), "{text}");
    let table = String::from_utf8(output.stdout).unwrap();
    let (stress, missing) = (column(&table, "wall_sigma_yy"), column(&table, "missing_energy"));
    assert!((stress.last().unwrap() / -1e5 - 1.0).abs() < 1e-3, "{table}");
    assert!(missing.last().unwrap().abs() < 1e-2 * column(&table, "elastic_energy").last().unwrap(), "{table}");
}

/// A layer between glued walls, sheared at constant stress, written to `file`.
fn sheared_layer(site: &Site, steps: u64) -> String {
    let file = site.path("layer.toml");
    let packing = Path::new(env!("CARGO_MANIFEST_DIR")).join("packings/discs-100.json");
    let text = format!(
        "packing = \"{}\"\ntiles = [1, 2]\nperiodic = [\"x\"]\n[contact]\nlaw = \"linear\"\nmodulus = 1e8\nstiffness_ratio = 0.5\n\
         friction = 0.5\n[walls]\nglue_depth = 1e-4\nservo_gain = 0.2\n[[region]]\nfrom = [0.0, 0.4]\nto = [1.0, 0.7]\nnumber = 3\n\
         [profile]\naxis = \"y\"\nalong = \"x\"\nlayers = 6\nfrom = \"shear\"\nwindow = 3\n\
         [[stage]]\nname = \"press\"\nsteps = 3000\nrows = 1\nstress = {{ yy = -1e5 }}\n\
         [[stage]]\nname = \"shear\"\nsteps = {steps}\nrows = 20\nglue = [\"y\"]\nshear = {{ xy = 0.02 }}\nstress = {{ yy = -1e5 }}\n",
        packing.display()
    );
    std::fs::write(&file, text).unwrap();
    file.to_str().unwrap().to_owned()
}

/// Columns of shear come last and are those of the walls; grains that a region has lost are told.
#[test]
fn a_sheared_layer_has_columns_of_its_own() {
    let site = Site::new();
    let test = sheared_layer(&site, 20_000);
    let (code, text, output) = run(&site, &["specimen", &test, "--units"]);
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("3 grains were removed from regions"), "{text}");
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(
        table.lines().next().unwrap().ends_with("missing_energy [J],shear_xy,wall_sigma_xy [Pa],shear_work [J]"),
        "{table}"
    );
    let (strain, stress) = (column(&table, "shear_xy"), column(&table, "wall_sigma_xy [Pa]"));
    let last = strain.len() - 1;
    assert!((strain[last] / 0.02 - 1.0).abs() < 0.02 && strain[0] == 0.0, "{strain:?}");
    assert!(stress[last] > 1e4 && stress[last] < 1e5, "{stress:?}");
    let (work, wall) = (column(&table, "shear_work [J]"), column(&table, "wall_work [J]"));
    assert!(work[last] > 0.0 && work[0] == 0.0 && work[last] < 3.0 * wall[last].abs(), "{work:?}, {wall:?}");
}

/// Tangential forces of a packing whose contacts have no springs along them are dropped, and that is said.
#[test]
fn a_specimen_without_tangential_springs_says_what_it_drops() {
    let site = Site::new();
    let test = sheared_layer(&site, 200);
    let set = ["--set", "contact.stiffness_ratio=0", "--set", "stage.0.steps=200", "--set", "stage.1.rows=1"];
    let (code, text, _) = run(&site, &[&["specimen", &test][..], &set].concat());
    assert_eq!(code, 0, "{text}");
    assert!(
        text.contains("; 0 contacts kept their history") && text.contains("leaves no tangential springs"),
        "{text}"
    );
}

const PICTURES: &str = "pictures of a specimen that is killed and resumed, against an undisturbed one";

/// a run that is killed goes on from its checkpoint to the bytes of an undisturbed one, in another number of threads, with its pictures;
/// another test is refused, and a run that has ended leaves no checkpoint.
#[test]
fn a_killed_specimen_goes_on_to_the_same_bytes() {
    let site = Site::new();
    let test = sheared_layer(&site, 60_000);
    let (whole, broken) = (site.path("whole.csv"), site.path("broken.csv"));
    let (checkpoint, pictures) = (site.path("checkpoint"), site.path("pictures"));
    let (whole_layers, layers) = (site.path("whole-layers"), site.path("layers"));
    let (code, text, _) = run(
        &site,
        &[
            &["specimen", &test, "--threads", "1", "--out", whole.to_str().unwrap()][..],
            &["--profiles", whole_layers.to_str().unwrap()],
            &[
                "--pictures",
                site.path("whole-pictures").to_str().unwrap(),
                "--fluctuations-from",
                "shear",
                "--contacts",
            ],
        ]
        .concat(),
    );
    assert_eq!(code, 0, "{text}");
    let mut arguments = vec!["specimen", &test, "--out", broken.to_str().unwrap(), "--checkpoint-every", "5000"];
    arguments.extend(["--checkpoint", checkpoint.to_str().unwrap(), "--pictures", pictures.to_str().unwrap()]);
    arguments.extend(["--profiles", layers.to_str().unwrap(), "--fluctuations-from", "shear", "--contacts"]);
    let file = checkpoint.join("checkpoint.bin");
    let mut child = site.program(&arguments).stderr(std::process::Stdio::null()).spawn().unwrap();
    let begun = std::time::Instant::now();
    while !file.exists() {
        assert!(begun.elapsed().as_secs() < 300 && child.try_wait().unwrap().is_none(), "no checkpoint was written");
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    child.kill().unwrap();
    assert!(!child.wait().unwrap().success() && !broken.exists(), "it ended before it was killed");

    arguments.push("--resume");
    let changed = ["--set", "contact.friction=0.4"];
    let (code, text, _) = run(&site, &[&arguments[..], &changed[..]].concat());
    assert!(code == 2 && text.contains("another test") && text.contains("friction"), "{code}: {text}");
    let (code, text, _) = run(&site, &[&arguments[..], &["--units"][..]].concat());
    assert!(code == 2 && text.contains("--units: the run was begun otherwise"), "{code}: {text}");
    let (code, text, _) = run(&site, &[&arguments[..], &["--threads", "2"][..]].concat());
    assert!(code == 0 && !text.contains("no checkpoint"), "{code}: {text}");
    Claim::of("A-10", "table of a specimen that is killed and resumed, against an undisturbed one")
        .holds(std::fs::read_to_string(&broken).unwrap() == std::fs::read_to_string(&whole).unwrap());
    let series = std::fs::read_to_string(pictures.join("grains.pvd")).unwrap();
    assert_eq!(series.matches("<DataSet").count(), 21, "{series}");
    for table in ["profile.csv", "band.csv"] {
        let read = |folder: &Path| std::fs::read_to_string(folder.join(table)).unwrap();
        Claim::of("A-10", "profile and band of a specimen that is killed and resumed, against an undisturbed one")
            .holds(read(&layers) == read(&whole_layers));
    }
    for last in ["fluctuations.svg", "force-chains.svg", "rotations.svg"] {
        let read = |folder: &Path| std::fs::read_to_string(folder.join(format!("grains-0020-{last}"))).unwrap();
        let ours = read(&pictures);
        Claim::of("A-10", PICTURES).holds(ours == read(&site.path("whole-pictures")));
        assert!(ours.matches("<circle").count() > 50, "{last}");
    }
    let read = |folder: &Path| std::fs::read(folder.join("contacts-0020.vtp")).unwrap();
    Claim::of("A-10", PICTURES).holds(read(&pictures) == read(&site.path("whole-pictures")));
    assert_eq!(std::fs::read_to_string(pictures.join("contacts.pvd")).unwrap().matches("<DataSet").count(), 21);
    assert!(!pictures.join("grains-0000-fluctuations.svg").exists(), "the stage has not begun");
    the_layers_shear_as_the_walls_do(&whole_layers, &std::fs::read_to_string(&whole).unwrap());
    assert!(!file.exists(), "a run that has ended leaves no checkpoint");
    let (code, text, _) = run(&site, &["specimen", &test, "--resume"]);
    assert!(code == 2 && text.contains("--checkpoint"), "{text}");
}

/// A picture that cannot be written ends the run. Its checkpoints are those before the row without a picture, so that the run goes on to the
/// pictures and the bytes of an undisturbed one; it went on with one picture too few.
#[test]
fn a_specimen_goes_on_behind_a_picture_that_could_not_be_written() {
    let site = Site::new();
    let test = sheared_layer(&site, 20_000);
    let [whole, broken, pictures, checkpoint] =
        ["whole.csv", "broken.csv", "pictures", "checkpoint"].map(|name| site.path(name).display().to_string());
    let arguments = |out| {
        let files = ["specimen", &test, "--out", out, "--pictures", &pictures, "--checkpoint", &checkpoint];
        [&files[..], &["--checkpoint-every", "500", "--set", "stage.1.rows=200", "--resume"]].concat()
    };
    let mut child = site.program(&arguments(&broken)).stderr(std::process::Stdio::piped()).spawn().unwrap();
    let begun = std::time::Instant::now();
    while !site.path("pictures/grains-0001.vtp").exists() {
        assert!(begun.elapsed().as_secs() < 300 && child.try_wait().unwrap().is_none(), "nothing was drawn");
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    let in_the_way = site.path("pictures/grains-0150.vtp");
    std::fs::create_dir(&in_the_way).unwrap();
    let output = child.wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && text.contains("grains-0150.vtp"), "{text}");
    std::fs::remove_dir(&in_the_way).unwrap();
    let (code, text, _) = run(&site, &arguments(&broken));
    assert!(code == 0 && !text.contains("no checkpoint"), "{code}: {text}");
    let series = std::fs::read_to_string(site.path("pictures/grains.pvd")).unwrap();
    assert_eq!(series.matches("<DataSet").count(), 201, "{series}");
    let (code, text, _) = run(&site, &arguments(&whole));
    assert_eq!(code, 0, "{text}");
    assert!(std::fs::read(&broken).unwrap() == std::fs::read(&whole).unwrap());
}

/// The interfaces of the layers add up to most of the motion between the outermost layers, which are glued or close to it, and the
/// growth over three rows is a difference of the shear strains.
fn the_layers_shear_as_the_walls_do(layers: &Path, table: &str) {
    let profile = std::fs::read_to_string(layers.join("profile.csv")).unwrap();
    let [step, coordinate, strain, growth] =
        ["step", "coordinate", "shear_strain", "shear_strain_growth"].map(|name| column(&profile, name));
    let rows = 20;
    let interfaces = step.len() / rows;
    assert!(interfaces == 5 && step.len() == 5 * rows, "{profile}");
    let row = |number: usize| number * interfaces..(number + 1) * interfaces;
    let mean = strain[row(19)].iter().sum::<f64>() / interfaces as f64;
    let walls = *column(table, "shear_xy").last().unwrap();
    assert!((mean / walls - 1.0).abs() < 0.3, "{mean} {walls}");
    for place in 0..interfaces {
        let expected = strain[row(19)][place] - strain[row(16)][place];
        assert!((growth[row(19)][place] - expected).abs() < 1e-12, "{place}");
        assert!(place == 0 || coordinate[row(19)][place] > coordinate[row(19)][place - 1]);
    }
    let band = std::fs::read_to_string(layers.join("band.csv")).unwrap();
    assert_eq!(band.lines().count(), 1 + rows, "{band}");
}

/// What cannot be run is refused before anything moves, with the place and the remedy.
#[test]
fn specimens_that_are_not_sound_are_refused() {
    let site = Site::new();
    let scene = "scenes/specimen-biaxial.toml";
    for (change, words) in [
        ("stage.0.steps=0", "stage.0.steps must be at least 1, not 0"),
        ("motion.safety=1.5", "motion.safety = 1.5 must lie between 0 and 1"),
        ("tiles=[1]", "needs 2 whole numbers"),
        ("contact.damping=-1.0", "contact.damping must be at least 0 and at most 1000, not -1"),
        ("stage.1.shear={xy=0.1}", "set walls.friction, or glue = [\"y\"]"),
        ("region=[{from=[0.0, 0.0], to=[1.0, 1.0], share=2.0}]", "share = 2 must be above 0 and at most 1"),
        ("region=[{from=[0.0, 0.0], to=[0.1, 0.1], number=400}]", "400 grains are to be removed, but the box holds"),
        ("walls.glue_depth=1e-4", "walls.glue_depth is not used"),
        (
            "contact.stiffness_ratio=0\n--set\nwalls.friction=0.3",
            "walls.friction is not used: contact.stiffness_ratio = 0",
        ),
        ("contact.stiffness_ratio=0\n--set\nstage.1.friction=0.3", "stage 2: friction is not used"),
        ("straighten=true", "straighten is not used"),
        ("stage.1.name=isotropic", "stage 2: there is a stage 'isotropic' before it"),
    ] {
        let arguments: Vec<&str> = ["specimen", scene, "--set"].into_iter().chain(change.split('\n')).collect();
        let (code, text, _) = run(&site, &arguments);
        assert!(code == 2 && text.contains(words), "{change}: {code}, {text}");
    }
    let of_a_run = site.path("run").display().to_string();
    std::fs::create_dir(&of_a_run).unwrap();
    std::fs::write(site.path("run/run.jsonl"), "").unwrap();
    for (flags, words) in [
        (["--profiles", "layers", "--quiet"], "no table [profile]"),
        (["--pictures", "grains", "--fluctuations-from=pull"], "there is no stage 'pull'"),
        (["--pictures", &of_a_run, "--quiet"], "this is the folder of a run"),
        (["--profiles", &of_a_run, "--quiet"], "this is the folder of a run"),
        (["--out", &of_a_run, "--quiet"], "this is a folder, not a file"),
    ] {
        let (code, text, _) = run(&site, &[&["specimen", scene][..], &flags[..]].concat());
        assert!(code == 2 && text.contains(words) && text.contains("hint:"), "{flags:?}: {text}");
    }
    let (code, text, _) = run(&site, &["specimen", scene, "--threads", "0"]);
    assert!(code == 2 && text.contains("--threads"), "{text}");
    let leaning = ["--set", "cut=\"tiles\"", "--set", "periodic=[\"y\"]", "--set", "stage.0.stress={xx=-1.5e5}"];
    let more = ["--set", "stage.1.strain={}"];
    let (code, text, _) = run(&site, &[&["specimen", scene][..], &leaning[..], &more[..]].concat());
    assert!(
        code == 2 && text.contains("leans by 0.02") && text.contains("use a packing whose cell is upright"),
        "{text}"
    );
}

/// A recipe with rolling resistance is accepted by its own report, and the file is what it says.
#[test]
fn a_recipe_with_rolling_resistance_is_met() {
    let site = Site::new();
    let (recipe, file) = (site.path("rolling.toml"), site.path("rolling.json"));
    let text = "number = 40\nseed = 2\npressure = 1e5\nthickness = 5e-4\ntolerance = 1e-4\nstress_tolerance = 1e-3\n[grading]\n\
                distribution = \"uniform\"\nsmallest_radius = 1.625e-4\nlargest_radius = 3.375e-4\n[contact]\nlaw = \"linear\"\n\
                modulus = 1e8\nstiffness_ratio = 0.5\nfriction = 0.5\nrolling_stiffness = 1.0\nrolling_friction = 0.1\n";
    std::fs::write(&recipe, text).unwrap();
    let (code, text, _) = run(&site, &["pack", recipe.to_str().unwrap(), "--out", file.to_str().unwrap()]);
    assert_eq!(code, 0, "{text}");
    let packing: serde_json::Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    assert_eq!(packing["version"], 2);
    let [contacts, moments] = ["contacts", "rolling_moments"].map(|key| packing[key].as_array().unwrap().len());
    assert!(contacts > 20 && contacts == moments, "{contacts} contacts, {moments} moments");
}

/// A cell and the same lattice by a second vector that leans by the first: a strain of the periodic sides is that of the body in both.
#[test]
fn periodic_sides_that_lean_strain_the_same_body() {
    let site = Site::new();
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("packings/discs-100.json");
    let mut packing: serde_json::Value = serde_json::from_slice(&std::fs::read(shipped).unwrap()).unwrap();
    let mut tables = Vec::new();
    for name in ["upright", "leaning"] {
        let file = site.path(&format!("{name}.json"));
        std::fs::write(&file, packing.to_string()).unwrap();
        let test = format!(
            "packing = \"{}\"\ntiles = [1, 1]\nperiodic = [\"x\", \"y\"]\n[contact]\nlaw = \"linear\"\nmodulus = 1e8\n\
             stiffness_ratio = 0.5\nfriction = 0.5\n[[stage]]\nname = \"squeeze\"\nsteps = 4000\nstrain = {{ xx = -0.005 }}\n\
             rows = 1\n[[stage]]\nname = \"shear\"\nsteps = 4000\nshear = {{ xy = 0.002 }}\nrows = 1\n",
            file.display()
        );
        let (path, out) = (site.path(&format!("{name}.toml")), site.path(&format!("{name}.csv")));
        std::fs::write(&path, test).unwrap();
        let (code, text, _) = run(&site, &["specimen", path.to_str().unwrap(), "--out", out.to_str().unwrap()]);
        assert_eq!(code, 0, "{text}");
        tables.push(std::fs::read_to_string(out).unwrap());
        let first: Vec<f64> = serde_json::from_value(packing["periodicity"][0].clone()).unwrap();
        for (axis, part) in first.iter().enumerate() {
            packing["periodicity"][1][axis] = (packing["periodicity"][1][axis].as_f64().unwrap() + part).into();
        }
        for contact in packing["contacts"].as_array_mut().unwrap() {
            contact[2] = (contact[2].as_i64().unwrap() - contact[3].as_i64().unwrap()).into();
        }
    }
    for name in ["sigma_xx", "sigma_yy", "sigma_xy"] {
        let [upright, leaning] = [0, 1].map(|which: usize| column(&tables[which], name));
        for (row, (one, other)) in upright.iter().zip(&leaning).enumerate() {
            assert!((one - other).abs() < 2e3, "{name}, row {row}: {one} and {other} Pa");
        }
    }
}

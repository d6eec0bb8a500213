//! What counts the instructions of a whole process.

use anyhow::{Context, bail};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// What to do where nothing counts.
const REMEDY: &str = "nothing here counts instructions: `perf stat -e instructions:u true` has no counter (usual in virtual machines, or \
                      kernel.perf_event_paranoid is above 2) and `valgrind --tool=callgrind` does not run; \
                      Debian: apt-get install --no-install-recommends valgrind";

/// A program with its arguments.
#[derive(Clone, Debug)]
pub(super) struct Invocation {
    pub(super) program: PathBuf,
    pub(super) arguments: Vec<OsString>,
}

/// What a process executed, and what it said.
#[derive(Clone, Debug)]
pub(super) struct Counted {
    /// In user space, of all its threads.
    pub(super) instructions: u64,
    pub(super) output: String,
}

/// Counts instructions in user space from the start of a process to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Counter {
    /// The counter of the processor, read by `perf stat`.
    Processor,
    /// Every instruction is decoded by Valgrind. It knows no AVX-512: the program takes its AVX2 functions.
    Callgrind,
}

impl Counter {
    /// The first that works here, that of the processor before Valgrind.
    ///
    /// # Errors
    /// None does; the error names the remedy.
    pub(super) fn find(folder: &Path) -> anyhow::Result<Self> {
        let nothing = Invocation { program: "true".into(), arguments: Vec::new() };
        let works = |counter: &Self| counter.count(&nothing, folder).is_ok_and(|counted| counted.instructions > 0);
        [Self::Processor, Self::Callgrind].into_iter().find(works).context(REMEDY)
    }

    /// Name in the report.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Processor => "counter of the processor (perf stat -e instructions:u)",
            Self::Callgrind => {
                "valgrind --tool=callgrind, which knows no AVX-512: the program takes its AVX2 functions"
            }
        }
    }

    /// Runs a program to its end. Files of the counter are written to `folder`.
    ///
    /// # Errors
    /// It cannot be started or ends with a failure, or the counter says nothing.
    pub(super) fn count(self, invocation: &Invocation, folder: &Path) -> anyhow::Result<Counted> {
        let file = folder.join("instructions.txt");
        let mut command = match self {
            Self::Processor => {
                let mut command = Command::new("perf");
                command.args(["stat", "-x", ",", "-e", "instructions:u", "-o"]).arg(&file).arg("--");
                command
            }
            Self::Callgrind => {
                let mut command = Command::new("valgrind");
                command.args(["--tool=callgrind", "--callgrind-out-file=/dev/null"]);
                command.arg(option("--log-file=", &file));
                command
            }
        };
        command.arg(&invocation.program).args(&invocation.arguments).stdin(Stdio::null());
        let ended = command.output().with_context(|| format!("starting {}", command.get_program().display()))?;
        if !ended.status.success() {
            let said = String::from_utf8_lossy(&ended.stderr);
            bail!("{} ended with {}: {}", invocation.program.display(), ended.status, said.trim());
        }
        let said = fs::read_to_string(&file).with_context(|| format!("what {} counted", self.name()))?;
        let counted = match self {
            Self::Processor => of_perf(&said),
            Self::Callgrind => of_callgrind(&said),
        };
        let instructions = counted.with_context(|| format!("no count in what the counter said: {}", said.trim()))?;
        Ok(Counted { instructions, output: String::from_utf8_lossy(&ended.stdout).into_owned() })
    }
}

fn option(name: &str, value: &Path) -> OsString {
    let mut option = OsString::from(name);
    option.push(value);
    option
}

/// The count in what `perf stat -x ,` writes: value, unit, event, ...; `<not supported>` is none. A count that was scaled up, because the
/// counter was lent to others for a while, is an estimate and none either: the fifth field is the share of time, per cent.
fn of_perf(said: &str) -> Option<u64> {
    let line = said.lines().find(|line| line.contains("instructions"))?;
    let fields: Vec<&str> = line.split(',').collect();
    let share: f64 = fields.get(4)?.parse().ok()?;
    if share < 100.0 { None } else { fields.first()?.parse().ok() }
}

/// The count in the log of Callgrind: `==PID== Collected : COUNT`.
fn of_callgrind(said: &str) -> Option<u64> {
    let line = said.lines().find(|line| line.contains("Collected :"))?;
    line.rsplit(':').next()?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn perf_counts_unless_the_counter_is_missing_or_was_shared() {
        let head = "# started on Wed Nov 25 01:59:07 2026\n\n";
        let line = "24877862,,instructions:u,5012345,100.00,1.02,insn per cycle\n";
        assert_eq!(of_perf(&format!("{head}{line}")), Some(24_877_862));
        assert_eq!(of_perf(&format!("{head}<not supported>,,instructions:u,0,100.00,,\n")), None);
        assert_eq!(of_perf(&format!("{head}<not counted>,,instructions:u,0,0.00,,\n")), None);
        assert_eq!(of_perf("24877862,,instructions:u,5012345,49.90,,\n"), None);
        assert_eq!(of_perf(head), None);
    }

    #[test]
    fn callgrind_counts_in_its_log() {
        let log = "==2717== Callgrind, a call-graph generating cache profiler\n==2717== Events    : Ir\n\
                   ==2717== Collected : 24877862\n==2717== \n==2717== I   refs:      24,877,862\n";
        assert_eq!(of_callgrind(log), Some(24_877_862));
        assert_eq!(of_callgrind("==2717== Callgrind, a call-graph generating cache profiler\n"), None);
    }

    #[test]
    fn the_remedy_names_a_package() {
        assert!(REMEDY.contains("apt-get install") && REMEDY.contains("valgrind"));
    }
}

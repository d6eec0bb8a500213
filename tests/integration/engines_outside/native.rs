//! An engine written in C against the header of `adapters/c`: compiled and linked here with the system's compiler.

use crate::harness::engines::skip;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The compiled example, or why there is none.
fn example() -> &'static Result<PathBuf, String> {
    static BUILT: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    BUILT.get_or_init(|| build("grainspan-example-c", &source(), &[]))
}

/// Another build of the example whose trials are refused beyond this strain; `None` where there is none.
pub(crate) fn with_largest_strain(strain: &str) -> Option<PathBuf> {
    let name = format!("grainspan-example-c-{strain}");
    is_there().then(|| build(&name, &source(), &[&format!("-DLARGEST_STRAIN={strain}")]).unwrap())
}

/// The example with snapshots that hold nothing; `None` where there is none.
pub(crate) fn without_states(folder: &Path) -> Option<PathBuf> {
    if !is_there() {
        return None;
    }
    let text = std::fs::read_to_string(source()).unwrap();
    let copy = "memcpy(out, of_trial ? rve->trial : rve->committed, sizeof rve->committed);";
    assert!(text.contains(copy), "the example writes its state otherwise");
    let emptied = folder.join("stateless.c");
    std::fs::write(&emptied, text.replace(copy, "memset(out, of_trial * 0, sizeof rve->committed);")).unwrap();
    Some(build("grainspan-example-c-stateless", &emptied, &[]).unwrap())
}

fn source() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("adapters/c/elastic.c")
}

fn build(name: &str, source: &Path, options: &[&str]) -> Result<PathBuf, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = Path::new(env!("CARGO_BIN_EXE_grainspan")).parent().expect("the program lies in a folder");
    let library = folder.join("libgrainspan_worker_c.a");
    if !library.exists() {
        return Err(format!("{} was not built: cargo build -p grainspan-worker-c", library.display()));
    }
    let program = folder.join(name);
    let compiled = Command::new("cc")
        .args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-O2", "-I"])
        .arg(root.join("adapters/c"))
        .args(options)
        .args([source, &library])
        .args(["-lm", "-lpthread", "-ldl", "-o"])
        .arg(&program)
        .output()
        .map_err(|error| format!("there is no C compiler: {error}"))?;
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    Ok(program)
}

/// Whether the example can be run; says so when it cannot.
pub(crate) fn is_there() -> bool {
    match example() {
        Ok(_) => true,
        Err(reason) => {
            skip("c", "the C example", reason);
            false
        }
    }
}

/// The example, without its role.
pub(crate) fn command() -> Command {
    Command::new(example().as_ref().expect("asked for only where it is there"))
}

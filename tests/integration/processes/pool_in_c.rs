//! The pool from C: the example of `pool-c` is compiled with the system's compiler, linked with the static library, and run.

use crate::harness::engines::skip;
use std::fs;
use std::path::Path;
use std::process::Command;

/// What is left out where a compiler or a library is missing.
const NAME: &str = "the pool from C";

#[test]
fn the_example_in_c_is_sound() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = env!("CARGO_BIN_EXE_grainspan");
    let library = Path::new(program).with_file_name("libgrainspan_pool.a");
    if !library.exists() {
        return skip("c", NAME, &format!("{} was not built: cargo build -p grainspan-pool-c", library.display()));
    }
    let folder = tempfile::tempdir().unwrap();
    let example = folder.path().join("example");
    let compiled = Command::new("cc")
        .args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-O2", "-I"])
        .arg(root.join("pool-c"))
        .args([&root.join("pool-c/example.c"), &library])
        .args(["-lm", "-lpthread", "-ldl", "-o"])
        .arg(&example)
        .output();
    let compiled = match compiled {
        Ok(compiled) => compiled,
        Err(error) => return skip("c", NAME, &format!("there is no C compiler: {error}")),
    };
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    let cell = folder.path().join("cell.toml");
    let packing = root.join("packings/discs-100.json");
    let text = format!(
        "packing = '{}'\ncontact = {{ modulus = 1e8, stiffness_ratio = 0.5, friction = 0.5 }}\nrve = {{ accuracy = 'draft' }}\n",
        packing.display()
    );
    fs::write(&cell, text).unwrap();
    let ended = Command::new(&example).args([Path::new(program), &cell]).output().unwrap();
    let said = String::from_utf8_lossy(&ended.stdout);
    // Pools take workers of their own build only.
    let remedy = "if sources have changed since the library was built, `cargo build --release -p grainspan-pool-c`";
    assert!(ended.status.success(), "{said}{}\n{remedy}", String::from_utf8_lossy(&ended.stderr));
    assert!(said.contains("inside out") && said.ends_with("sound\n"), "{said}");
}

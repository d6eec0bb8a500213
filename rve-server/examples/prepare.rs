//! Prepares a packing from its description, without the command line program.
//!
//! `cargo run --release -p grainspan-rve-server --example prepare -- PACKING.toml PACKING.json`

#![expect(clippy::print_stderr, reason = "a program for people")]

use rve_server::packing::{Packing, PackingRecipe, generate_any};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [recipe, out] = arguments.as_slice() else {
        return Err("usage: prepare PACKING.toml PACKING.json".into());
    };
    let recipe = PackingRecipe::from_toml(&std::fs::read_to_string(recipe)?)?;
    let (packing, report) = generate_any(&recipe, &mut |progress| eprintln!("{progress:?}"))?;
    match packing {
        Packing::Discs(packing) => packing.write(out.as_ref())?,
        Packing::Spheres(packing) => packing.write(out.as_ref())?,
    }
    eprintln!("{report:#?}");
    Ok(())
}

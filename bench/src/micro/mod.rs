//! `grainspan bench micro NAME [ARGUMENT]...`: the cost of one part alone, printed as lines or CSV; no folder, no charts. They are for
//! work on that part; published figures come from the studies.

mod assembly_cost;
mod cell_memory;
mod lane_cost;
mod operator_cost;
mod operator_sweep;
mod pack_cost;
mod processor_time;
mod small_increments;

use anyhow::bail;
use std::fmt::Write;

/// One microbenchmark.
struct Micro {
    /// Name on the command line.
    name: &'static str,
    /// Its arguments, as help shows them.
    usage: &'static str,
    /// One line for the list.
    about: &'static str,
    /// Measures and prints.
    run: fn(&[String]) -> anyhow::Result<()>,
}

/// All of them, in the order of the list.
const ALL: [Micro; 7] = [
    Micro {
        name: "assembly_cost",
        usage: "[CASE]...",
        about: "assembly and global equations for one iteration, with an elastic law at every Gauss point",
        run: assembly_cost::run,
    },
    Micro {
        name: "cell_memory",
        usage: "[PACKING] [CELLS]",
        about: "memory of a live cell and size of its snapshot",
        run: cell_memory::run,
    },
    Micro {
        name: "lane_cost",
        usage: "PACKING [CELLS] [hertz]",
        about: "one DEM step, cells one by one and in lanes; compares the bits of both",
        run: lane_cost::run,
    },
    Micro {
        name: "operator_cost",
        usage: "[PACKING] [STRAIN_BEFORE] [REPEATS] [OPERATOR]...",
        about: "tangent operators against an increment of 1e-3",
        run: operator_cost::run,
    },
    Micro {
        name: "operator_sweep",
        usage: "[PACKING]",
        about: "accuracy of operators: moduli (T-7), symmetry (T-4), size of the perturbation (T-8)",
        run: operator_sweep::run,
    },
    Micro {
        name: "pack_cost",
        usage: "RECIPE [NUMBER] [trace] [OUT.json]",
        about: "stages of a preparation",
        run: pack_cost::run,
    },
    Micro {
        name: "small_increments",
        usage: "[drift CYCLES] [PACKING]...",
        about: "cycles and pulses of small strain by relaxation and by the event-driven solver: evaluations, time, error, drift",
        run: small_increments::run,
    },
];

/// Runs the microbenchmark that the first argument names; without arguments returns the list of all.
///
/// # Errors
/// There is no such microbenchmark, an argument is not understood, or the measured part fails.
pub(crate) fn run(arguments: &[String]) -> anyhow::Result<String> {
    let Some((name, rest)) = arguments.split_first() else { return Ok(list()) };
    let Some(one) = ALL.iter().find(|one| one.name == name) else {
        bail!("there is no microbenchmark `{name}`; `grainspan bench micro` lists them");
    };
    (one.run)(rest)?;
    Ok(String::new())
}

fn list() -> String {
    let mut text = String::new();
    for Micro { name, usage, about, .. } in &ALL {
        writeln!(text, "{name} {usage}\n    {about}").expect("writing to a String cannot fail");
    }
    text
}

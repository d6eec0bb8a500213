//! Prints the wire layout as JSON: the file that adapters in other languages read.
//!
//! `cargo run -p grainspan-protocol --example wire_layout > adapters/python/grainspan_worker/wire_layout.json`

#![expect(clippy::print_stdout, reason = "an example talks to people")]

fn main() {
    // A description is data: it goes to standard output.
    println!(
        "{}",
        serde_json::to_string_pretty(&protocol::layout::wire_layout()).expect("JSON values can be written")
    );
}

//! Values that a definition leaves open: the adapters read the same ones as the built-in engine.

use super::foreign;
use protocol::Definition;
use rve_server::contact::ContactTable;
use rve_server::definition::{AnyDefinition, Packing, RveOptions};
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

/// Reads a definition from standard input, and again without the keys that the arguments name; prints the values of both.
const READ: &str = "
import json, sys
from grainspan_worker.definition import Definition

made_of = Definition.read(sys.stdin.buffer.read())

def values():
    contact = [made_of.law, made_of.density, made_of.rotations_free, made_of.cohesion, made_of.stiffness_ratio]
    return contact + [made_of.strain_per_step, made_of.tolerance, made_of.max_steps, made_of.largest_target]

given = values()
for key in sys.argv[1:]:
    for table in (made_of.contact, made_of.options):
        table.pop(key, None)
print(json.dumps([given, values()]))
";

/// What the adapters make of a definition, and of the same without some keys.
fn as_adapters_read(made_of: &Definition, left_out: &[&str]) -> [Vec<Value>; 2] {
    let mut reader = Command::new(foreign::python())
        .args(["-c", READ])
        .args(left_out)
        .env("PYTHONPATH", foreign::package())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    reader.stdin.take().unwrap().write_all(&made_of.bytes).unwrap();
    let ended = reader.wait_with_output().unwrap();
    assert!(ended.status.success(), "its reason is above");
    serde_json::from_slice(&ended.stdout).unwrap()
}

/// The same values by the built-in engine.
fn as_built_in(contact: &ContactTable, options: &RveOptions) -> Vec<Value> {
    let ratio = contact.stiffness_ratio.unwrap_or(0.0);
    let contact = [json!("linear"), json!(contact.density), json!(true), json!(contact.cohesion), json!(ratio)];
    let numbers = [
        json!(options.strain_per_step()),
        json!(options.tolerance()),
        json!(options.max_steps()),
        json!(options.largest_target()),
    ];
    [&contact[..], &numbers].concat()
}

#[test]
fn adapters_have_the_defaults_of_the_built_in_engine() {
    if !foreign::is_there("reference") {
        return;
    }
    let packing = Path::new(env!("CARGO_MANIFEST_DIR")).join("packings/discs-100.json");
    let contact: ContactTable = toml::from_str("modulus = 1e8\nfriction = 0.5").unwrap();
    // Keys that hold their default, which a definition may leave out.
    let open = ["law", "density", "rotations", "cohesion", "stiffness_ratio"];
    for (text, more) in [
        ("", &["accuracy"][..]),
        ("accuracy = 'draft'", &[]),
        ("accuracy = 'tight'", &[]),
        ("criterion = 'energy'", &["accuracy"]),
        ("strain_per_step = 3e-6\ntolerance = 4e-3\nmax_steps = 7\nlargest_target = 0.05", &["accuracy"]),
    ] {
        let options: RveOptions = toml::from_str(text).unwrap();
        let expected = as_built_in(&contact, &options);
        let made_of = AnyDefinition::new(Packing::read(&packing).unwrap(), contact.clone(), options).to_protocol();
        for found in as_adapters_read(&made_of, &[&open[..], more].concat()) {
            assert_eq!(found, expected, "{text}");
        }
    }
}

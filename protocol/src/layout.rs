//! The wire layout as data, for workers in other languages: names, places and types of every field, and the numbers of
//! every code.
//!
//! Other languages read this description instead of repeating it, so a change of a wire type cannot leave them behind
//! unnoticed: a test compares the description that ships with the adapters with the one that this module makes.

use crate::PROTOCOL_VERSION;
use crate::observed::Observables;
use crate::snapshot::SNAPSHOT_FORMAT;
use crate::tangent_kind::TangentKind;
use crate::transport::frame::{FrameHeader, FrameKind, MAGIC};
use crate::transport::shared_memory::ICEORYX2_VERSION;
use crate::transport::shared_memory::services::{EXCHANGE, TO_MACRO, TO_WORKER};
use crate::transport::shared_memory::{CREDITS, WINDOW};
use crate::trial::TrialFlags;
use crate::wire::{ReplyStatus, TrialJob, TrialReply};
use bytemuck::Zeroable;
use serde_json::{Value, json};

/// Describes fields as `[name, offset in bytes, type of one element, number of elements]`.
macro_rules! structure {
    ($type:ty { $($($field:ident).+ : $element:ty),* $(,)? }) => {{
        let zero = <$type>::zeroed();
        let fields = vec![$(json!([
            stringify!($($field).+).replace(' ', ""),
            std::mem::offset_of!($type, $($field).+),
            stringify!($element),
            size_of_val(&zero.$($field).+) / size_of::<$element>(),
        ])),*];
        json!({ "size": size_of::<$type>(), "fields": fields })
    }};
}

/// The description, in the form in which the adapters read it.
pub fn wire_layout() -> Value {
    json!({
        "protocol": PROTOCOL_VERSION,
        "iceoryx2": ICEORYX2_VERSION,
        "magic": MAGIC,
        "snapshot_format": SNAPSHOT_FORMAT,
        "services": { "exchange": EXCHANGE, "to_macro": TO_MACRO, "to_worker": TO_WORKER },
        "credits": CREDITS,
        "window": WINDOW,
        "frame_kinds": {
            "control": FrameKind::Control as u32,
            "jobs": FrameKind::Jobs as u32,
            "replies": FrameKind::Replies as u32,
            "credit": FrameKind::Credit as u32,
            "close": FrameKind::Close as u32,
        },
        "statuses": {
            "done": ReplyStatus::Done as u32,
            "failed": ReplyStatus::Failed as u32,
            "need_state": ReplyStatus::NeedState as u32,
            "need_definition": ReplyStatus::NeedDefinition as u32,
        },
        "tangents": numbers(&TangentKind::ALL.map(|kind| (kind as u32, kind.keyword()))),
        "flags": numbers(&TrialFlags::NAMED.map(|(flag, word)| (flag.0, word))),
        "observables": numbers(&Observables::NAMED.map(|(observable, word)| (observable.0, word))),
        "header": structure!(FrameHeader { magic: u32, version: u32, kind: u32, count: u32, length: u64, sender: u64 }),
        "job": structure!(TrialJob {
            job: u64,
            point: u64,
            definition: u8,
            state: u8,
            target: f64,
            tangent: u32,
            ramp_steps: u32,
            observables: u32,
            attempt: u32,
            state_length: u64,
            friction_reduction: f64,
        }),
        "reply": structure!(TrialReply {
            job: u64,
            point: u64,
            state: u8,
            status: u32,
            flags: u32,
            tangent_kind: u32,
            replayed: u32,
            state_length: u64,
            error_length: u64,
            overhead_nanoseconds: u64,
            checksum: u64,
            cost.force_evaluations: u64,
            cost.ramp_steps: u64,
            cost.solve_nanoseconds: u64,
            cost.tangent_nanoseconds: u64,
            scalars.void_ratio: f64,
            scalars.coordination_number: f64,
            scalars.unbalanced_force_ratio: f64,
            scalars.max_overlap_ratio: f64,
            scalars.volume_ratio: f64,
            observed.first_piola: f64,
            observed.fabric: f64,
            observed.fabric_anisotropy: f64,
            observed.coordination_number_no_rattlers: f64,
            observed.sliding_fraction: f64,
            observed.elastic_energy: f64,
            observed.frictional_dissipation: f64,
            observed.damping_work: f64,
            observed.mean_rotation: f64,
            stress: f64,
            tangent: f64,
        }),
    })
}

/// Words with their numbers.
fn numbers(named: &[(u32, &str)]) -> Value {
    named.iter().map(|(number, word)| ((*word).to_owned(), json!(number))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observed::OptionalResult;

    /// No field is forgotten: the fields of each structure fill it without a gap.
    #[test]
    fn described_fields_fill_their_structures() {
        let layout = wire_layout();
        for name in ["header", "job", "reply"] {
            let mut end = 0;
            for field in layout[name]["fields"].as_array().unwrap() {
                let element = match field[2].as_str().unwrap() {
                    "u8" => 1,
                    "u32" => 4,
                    "u64" | "f64" => 8,
                    other => panic!("{other} is no element type"),
                };
                assert_eq!(field[1].as_u64().unwrap(), end, "{name}.{}", field[0]);
                end += element * field[3].as_u64().unwrap();
            }
            assert_eq!(layout[name]["size"].as_u64().unwrap(), end, "{name}");
        }
    }

    /// The words of the optional results are the names of their fields, in order.
    #[test]
    fn optional_results_are_fields_of_replies() {
        let layout = wire_layout();
        let fields = layout["reply"]["fields"].as_array().unwrap();
        let observed: Vec<&str> =
            fields.iter().filter_map(|field| field[0].as_str()?.strip_prefix("observed.")).collect();
        assert_eq!(observed, OptionalResult::ALL.map(OptionalResult::keyword));
    }

    /// The adapters ship the description of this very program. After a change of the wire types:
    /// `cargo run -p grainspan-protocol --example wire_layout > adapters/python/grainspan_worker/wire_layout.json`
    #[test]
    fn adapters_ship_this_layout() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../adapters/python/grainspan_worker/wire_layout.json");
        let shipped: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
        assert_eq!(shipped, wire_layout(), "the adapters' wire layout is out of date; see this test's comment");
    }
}

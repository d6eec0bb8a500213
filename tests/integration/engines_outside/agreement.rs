//! Engines outside this program against the built-in one: crystals and a random packing.

use super::claims::discs;
use super::conversation::{Conversation, Partner};
use super::foreign;
use claims::Claim;
use protocol::{Definition, RveSolver, StateId, Tensor2, TrialOptions};
use rve_server::contact::ContactTable;
use rve_server::definition::{GrainDefinition, PackingFile};
use rve_server::engine::GrainRve;
use rve_server::space::Discs;

#[test]
fn reference_engine_agrees() {
    if foreign::is_there("reference") {
        let mut talk = Conversation::begin(Partner::Process(|| foreign::command("reference")));
        crystals(&mut talk, 1e-6);
        random_packing(&mut talk, 0.01);
    }
}

#[test]
fn yade_agrees() {
    if foreign::is_there("yade") {
        let mut talk = Conversation::begin(Partner::Process(|| foreign::command("yade")));
        crystals(&mut talk, 1e-6);
        random_packing(&mut talk, 0.01);
    }
}

#[test]
fn lammps_agrees() {
    if foreign::is_there("lammps") {
        let mut talk = Conversation::begin(Partner::Process(|| foreign::command("lammps")));
        crystals(&mut talk, 1e-6);
        random_packing(&mut talk, 0.01);
    }
}

/// sigma of the triangular and the square crystal (D-1, D-2) under compression and shear, sticking contacts. Both
/// engines see the same crystal of 4 x 4 grains: Yade and LAMMPS know one image of a pair.
fn crystals(talk: &mut Conversation, tolerance: f64) {
    for (quantity, rows) in [
        (
            "largest error of the stress, triangular crystal, against the built-in engine",
            [[1.0, 0.0], [0.5, 0.75f64.sqrt()]],
        ),
        ("largest error of the stress, square crystal, against the built-in engine", [[1.0, 0.0], [0.0, 1.0]]),
    ] {
        let made_of = crystal(rows);
        talk.define(&made_of);
        let mut built_in = GrainRve::<Discs>::from_protocol(&made_of).unwrap();
        for target in [[[0.0, 0.0], [0.0, -1e-5]], [[-1e-5, 0.0], [0.0, 0.0]], [[0.0, 1e-5], [1e-5, 0.0]]] {
            let job = talk.job(&made_of, StateId::NONE, target);
            let said = talk.ask_one(job, b"");
            let expected = built_in.trial(&Tensor2::from_plane(target), &TrialOptions::default()).unwrap();
            let scale = expected.stress.0.iter().fold(0.0f64, |most, value| most.max(value.abs()));
            for (found, expected) in said.reply.stress.0.iter().zip(&expected.stress.0) {
                Claim::of("A-8", quantity).error((found - expected) / scale).within(tolerance);
            }
        }
    }
}

/// The packing as its file gives it, with the tangential forces that the file lists: nothing has moved yet.
fn as_packed(talk: &mut Conversation, made_of: &Definition, built_in: &mut GrainRve<Discs>) {
    let job = talk.job(made_of, StateId::NONE, [[0.0; 2]; 2]);
    let found = talk.ask_one(job, b"").reply.stress;
    let expected = built_in.trial(&Tensor2::ZERO, &TrialOptions::default()).unwrap().stress;
    let scale = expected.0.iter().fold(0.0f64, |most, value| most.max(value.abs()));
    for (found, expected) in found.0.iter().zip(&expected.0) {
        Claim::of("A-8", "largest error of the stress, 100 discs as packed, against the built-in engine")
            .error((found - expected) / scale)
            .within(1e-9);
    }
}

fn crystal(rows: [[f64; 2]; 2]) -> Definition {
    let (cells, overlap) = (4usize, 1e-4);
    let pressed = rows.map(|row| row.map(|value| value * (1.0 - overlap)));
    let mut grains = Vec::new();
    for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i as f64 + 0.3, j as f64 + 0.2))) {
        grains.push(vec![i * pressed[0][0] + j * pressed[1][0], i * pressed[0][1] + j * pressed[1][1], 0.5]);
    }
    let packing = PackingFile::<Discs> {
        format: PackingFile::FORMAT.into(),
        version: PackingFile::VERSION,
        dimension: 2,
        thickness: 1.0,
        periodicity: pressed.map(|row| row.map(|value| value * cells as f64)),
        grains: grains.into_iter().map(|grain| grain.try_into().unwrap()).collect(),
        contacts: Vec::new(),
        rolling_moments: Vec::new(),
        provenance: serde_json::Value::Null,
    };
    let options = toml::from_str("accuracy = \"tight\"\nstrain_per_step = 1e-6").unwrap();
    GrainDefinition { packing, contact: ContactTable::linear(1.0, 0.5, 1e9), options }.to_protocol()
}

/// Four steps of biaxial compression of 100 discs; `tolerance` on the major stress relative to the built-in engine's.
fn random_packing(talk: &mut Conversation, tolerance: f64) {
    let made_of = discs();
    talk.define(&made_of);
    let mut built_in = GrainRve::<Discs>::from_protocol(&made_of).unwrap();
    as_packed(talk, &made_of, &mut built_in);
    let (mut state, mut bytes) = (StateId::NONE, Vec::new());
    for step in 0..4 {
        let target = [[4e-4, 0.0], [0.0, -1e-3]];
        let job = talk.job(&made_of, state, target);
        let said = talk.ask_one(job, &bytes);
        let expected = built_in.trial(&Tensor2::from_plane(target), &TrialOptions::default()).unwrap();
        built_in.commit().unwrap();
        (state, bytes) = (said.reply.state, said.state);
        let (found, expected) = (said.reply.stress.get(1, 1), expected.stress.get(1, 1));
        let error = (found / expected - 1.0).abs();
        eprintln!("step {step}: {found:.0} Pa, built-in {expected:.0} Pa, {:.2} %", 100.0 * error);
        Claim::of("A-8", "axial stress of 100 discs to 0.4 % compression, Pa, against the built-in engine")
            .value(found, expected)
            .within(tolerance);
    }
}

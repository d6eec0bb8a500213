//! A table of C functions as an engine.
#![expect(unsafe_code, reason = "the boundary to C: see the crate documentation")]

use crate::table::{Answer, Cell, EngineTable, TrialOptions};
use protocol::{
    Capabilities, Cost, Definition, DefinitionId, OptionalResult, RveEngine, RveError, RveSolver, Scalars,
    SnapshotKind, TangentKind, Tensor2, TrialFlags, TrialOptions as WireOptions, TrialResult, nanoseconds_since,
    snapshot,
};
use rve_server::contact::ContactTable;
use rve_server::definition::{DefinedSpace, EngineFeature, GrainDefinition, PackingFile, RveOptions};
use rve_server::error::DefinitionError;
use rve_server::space::{Discs, Spheres};
use serde_json::Value;
use std::ffi::{CString, c_char, c_int, c_void};
use std::time::Instant;

/// Room for a reason, bytes.
const REASON: usize = 512;

/// What the functions of C that can refuse return; every other number is a refusal that no smaller step cures.
const OK: c_int = 0;
const TOO_LARGE: c_int = 2;

type Create = unsafe extern "C" fn(*const Cell, *mut c_char, usize) -> *mut c_void;
type Trial =
    unsafe extern "C" fn(*mut c_void, *const f64, *const TrialOptions, *mut Answer, *mut c_char, usize) -> c_int;
type Act = unsafe extern "C" fn(*mut c_void);
type Snapshot = unsafe extern "C" fn(*const c_void, c_int, *mut u8, usize) -> usize;
type Restore = unsafe extern "C" fn(*mut c_void, *const u8, usize, *mut c_char, usize) -> c_int;

/// The functions of a table, none of them null.
#[derive(Clone, Copy, Debug)]
struct Functions {
    create: Create,
    trial: Trial,
    commit: Act,
    rollback: Act,
    snapshot: Snapshot,
    restore: Restore,
    release: Act,
}

/// An engine behind a table.
#[derive(Clone, Debug)]
pub(crate) struct ForeignEngine {
    name: String,
    version: String,
    dimensions: Vec<u32>,
    laws: Vec<String>,
    largest_target: f64,
    /// Optional results that it delivers.
    observables: Vec<String>,
    /// What it follows of the parts of definitions that not every engine follows.
    features: Vec<String>,
    functions: Functions,
}

impl ForeignEngine {
    /// Reads a table; `None` when it is null or not complete.
    ///
    /// # Safety
    /// `table` is null or a table whose texts are C strings or null.
    pub(crate) unsafe fn read(table: *const EngineTable) -> Option<Self> {
        // SAFETY: as promised by the caller.
        let table = unsafe { table.as_ref() }?;
        let functions = Functions {
            create: table.create?,
            trial: table.trial?,
            commit: table.commit?,
            rollback: table.rollback?,
            snapshot: table.snapshot?,
            restore: table.restore?,
            release: table.release?,
        };
        let named = |served: &[(u32, &str)]| {
            served.iter().filter(|(flag, _)| *flag != 0).map(|(_, name)| (*name).to_owned()).collect()
        };
        let dimensions = [(table.plane, 2), (table.space, 3)];
        Some(Self {
            // SAFETY: as promised by the caller.
            name: unsafe { crate::text(table.name) }?,
            // SAFETY: as promised by the caller.
            version: unsafe { crate::text(table.version) }?,
            dimensions: dimensions.iter().filter(|(flag, _)| *flag != 0).map(|(_, dimension)| *dimension).collect(),
            laws: named(&[(table.linear, "linear"), (table.hertz_mindlin, "hertz_mindlin")]),
            largest_target: table.largest_target,
            // SAFETY: as promised by the caller.
            observables: list(unsafe { crate::text(table.observables) }),
            // SAFETY: as promised by the caller.
            features: list(unsafe { crate::text(table.features) }),
            functions,
        })
    }

    /// What is wrong with its numbers and words, if anything: a word that nobody knows would be left aside without a sign.
    pub(crate) fn defect(&self) -> Option<String> {
        // Also where it is not a number.
        let is_positive = self.largest_target > 0.0;
        if !is_positive {
            let text = "largest_target of the engine must be positive: the largest |F - I| of one trial, INFINITY without a limit";
            return Some(text.to_owned());
        }
        let results = OptionalResult::ALL.map(OptionalResult::keyword);
        let features = EngineFeature::ALL.map(EngineFeature::keyword);
        unknown_word("observables", &self.observables, &results)
            .or_else(|| unknown_word("features", &self.features, &features))
    }
}

/// What to say about the first word of a list of the engine that does not exist.
fn unknown_word(list: &str, words: &[String], known: &[&str]) -> Option<String> {
    let unknown = words.iter().find(|word| !known.contains(&word.as_str()))?;
    Some(format!("unknown word `{unknown}` in `{list}` of the engine; there are {}", known.join(", ")))
}

impl RveEngine for ForeignEngine {
    fn capabilities(&self) -> Capabilities {
        Capabilities {
            engine: self.name.clone(),
            version: self.version.clone(),
            dimensions: self.dimensions.clone(),
            tangents: vec![TangentKind::None],
            laws: self.laws.clone(),
            snapshot: SnapshotKind::State,
            deterministic: true,
            side_by_side: 1,
            reduces_friction: false,
            observables: self.observables.clone(),
            features: self.features.clone(),
        }
    }

    fn create(&mut self, definition: &Definition) -> Result<Box<dyn RveSolver>, RveError> {
        let parts = Parts::read(definition)?;
        let (known, moments) = (PackingFile::VERSION, EngineFeature::RollingMoments.keyword());
        if parts.version != known && !self.features.iter().any(|word| word == moments) {
            let reason = format!(
                "engine `{}` reads packings of version {known}, this one is of version {}: take a packing without rolling_moments",
                self.name, parts.version
            );
            return Err(RveError::Definition(reason));
        }
        if !self.dimensions.contains(&parts.dimension) {
            let reason = format!("engine `{}` does not serve {} dimensions", self.name, parts.dimension);
            return Err(RveError::Definition(reason));
        }
        let law = parts.contact.law.keyword();
        if !self.laws.iter().any(|served| served == law) {
            let reason = format!("engine `{}` does not serve the law `{law}`", self.name);
            return Err(RveError::Definition(reason));
        }
        let mut reason = [0u8; REASON];
        let cell = parts.cell();
        // SAFETY: the cell borrows from `parts`, which outlives the call; the buffer has the size that is passed.
        let rve = unsafe { (self.functions.create)(&cell, reason.as_mut_ptr().cast(), REASON) };
        if rve.is_null() {
            return Err(RveError::Definition(words(&reason)));
        }
        Ok(Box::new(ForeignRve {
            rve,
            definition: definition.id(),
            dimension: parts.dimension,
            largest_target: parts
                .options
                .largest_target
                .map_or(self.largest_target, |given| given.min(self.largest_target)),
            has_trial: false,
            engine: self.clone(),
        }))
    }
}

/// An RVE made by a table's `create`.
struct ForeignRve {
    rve: *mut c_void,
    definition: DefinitionId,
    dimension: u32,
    /// That of the engine, or a smaller one of the definition.
    largest_target: f64,
    has_trial: bool,
    engine: ForeignEngine,
}

// SAFETY: the worker loop owns the RVE and calls it from its own thread only; the header promises C no more than that.
unsafe impl Send for ForeignRve {}

impl ForeignRve {
    fn sealed(&self, of_trial: bool, out: &mut Vec<u8>) {
        let mut payload = self.definition.0.to_vec();
        let which = c_int::from(of_trial);
        let write = self.engine.functions.snapshot;
        // SAFETY: no bytes may be written into a capacity of 0.
        let size = unsafe { write(self.rve, which, std::ptr::NonNull::dangling().as_ptr(), 0) };
        payload.resize(16 + size, 0);
        // SAFETY: the buffer has the capacity that is passed.
        let written = unsafe { write(self.rve, which, payload[16..].as_mut_ptr(), size) };
        payload.truncate(16 + written.min(size));
        snapshot::seal(&self.engine.name, &payload, out);
    }

    /// What the engine need not look at itself.
    fn check(&self, target: &Tensor2) -> Result<(), RveError> {
        protocol::target::check(target, self.dimension as usize)?;
        let norm = target.0.iter().map(|component| component * component).sum::<f64>().sqrt();
        if norm > self.largest_target {
            return Err(RveError::TargetTooLarge { norm, limit: self.largest_target });
        }
        Ok(())
    }
}

impl RveSolver for ForeignRve {
    fn trial(&mut self, target: &Tensor2, options: &WireOptions) -> Result<TrialResult, RveError> {
        self.rollback();
        self.check(target)?;
        if options.tangent != TangentKind::None {
            return Err(RveError::Unsupported(format!("the tangent `{}`", options.tangent.keyword())));
        }
        RveError::refuse_reduced_friction(options)?;
        let begun = Instant::now();
        let request = TrialOptions {
            ramp_steps: options.ramp_steps,
            observables: options.observables.0,
            ..TrialOptions::default()
        };
        let (mut answer, mut reason) = (Answer::blank(), [0u8; REASON]);
        // SAFETY: the RVE is alive; all buffers are ours and have the sizes that the header gives them.
        let outcome = unsafe {
            (self.engine.functions.trial)(
                self.rve,
                target.0.as_ptr(),
                &request,
                &mut answer,
                reason.as_mut_ptr().cast(),
                REASON,
            )
        };
        match outcome {
            OK => {}
            TOO_LARGE => return Err(RveError::StepTooLarge(words(&reason))),
            _ => return Err(RveError::Unsupported(words(&reason))),
        }
        self.has_trial = true;
        Ok(TrialResult {
            stress: Tensor2(answer.stress),
            tangent: None,
            scalars: Scalars {
                void_ratio: answer.void_ratio,
                coordination_number: answer.coordination_number,
                unbalanced_force_ratio: answer.unbalanced_force_ratio,
                max_overlap_ratio: answer.max_overlap_ratio,
                volume_ratio: answer.volume_ratio,
            },
            observed: answer.observed,
            cost: Cost {
                force_evaluations: answer.force_evaluations,
                ramp_steps: answer.ramp_steps,
                solve_nanoseconds: nanoseconds_since(begun),
                tangent_nanoseconds: 0,
            },
            flags: TrialFlags(answer.flags),
        })
    }

    fn commit(&mut self) -> Result<(), RveError> {
        if !std::mem::take(&mut self.has_trial) {
            return Err(RveError::NothingToCommit);
        }
        // SAFETY: the RVE is alive.
        unsafe { (self.engine.functions.commit)(self.rve) };
        Ok(())
    }

    fn rollback(&mut self) {
        if std::mem::take(&mut self.has_trial) {
            // SAFETY: the RVE is alive.
            unsafe { (self.engine.functions.rollback)(self.rve) };
        }
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        self.sealed(false, out);
    }

    fn snapshot_trial(&self, out: &mut Vec<u8>) -> Result<(), RveError> {
        if !self.has_trial {
            return Err(RveError::NothingToCommit);
        }
        self.sealed(true, out);
        Ok(())
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RveError> {
        let refuse = |reason: String| RveError::Snapshot(reason);
        let payload = snapshot::open(&self.engine.name, bytes).map_err(|error| refuse(error.to_string()))?;
        let (definition, state) =
            payload.split_at_checked(16).ok_or_else(|| refuse("a state without its definition".into()))?;
        if definition != self.definition.0 {
            return Err(refuse("a state of another definition".into()));
        }
        let mut reason = [0u8; REASON];
        // SAFETY: the RVE is alive; the buffers have the sizes that are passed.
        let outcome = unsafe {
            let restore = self.engine.functions.restore;
            restore(self.rve, state.as_ptr(), state.len(), reason.as_mut_ptr().cast(), REASON)
        };
        if outcome != OK {
            return Err(refuse(words(&reason)));
        }
        self.has_trial = false;
        Ok(())
    }
}

impl Drop for ForeignRve {
    fn drop(&mut self) {
        // SAFETY: the RVE is alive, and nobody calls it after this.
        unsafe { (self.engine.functions.release)(self.rve) };
    }
}

/// A definition taken apart for C.
struct Parts {
    /// Version of the packing's file.
    version: u32,
    /// 2 or 3.
    dimension: u32,
    /// Three per grain, m.
    centres: Vec<f64>,
    /// m.
    radii: Vec<f64>,
    /// Cell vectors, each a row, m.
    periodicity: [f64; 9],
    /// Out of plane, m.
    thickness: f64,
    contact: ContactTable,
    options: RveOptions,
    /// The whole definition as JSON, null entries included.
    text: CString,
}

impl Parts {
    /// Reads a definition of either dimension.
    ///
    /// # Errors
    /// [`RveError::Definition`]: bytes that are no definition, or a contact table that lacks what its law needs.
    fn read(definition: &Definition) -> Result<Self, RveError> {
        let value: Value = rmp_serde::from_slice(&definition.bytes)
            .map_err(|error| RveError::Definition(format!("these bytes are not a definition of grains: {error}")))?;
        match value["packing"]["dimension"].as_u64() {
            Some(2) => Self::of::<Discs>(definition, &value),
            Some(3) => Self::of::<Spheres>(definition, &value),
            _ => Err(RveError::Definition("the definition has no dimension".into())),
        }
    }

    /// Takes a definition apart whose dimension is known. Nothing is wrapped or rounded: an engine gets the numbers of the text.
    fn of<S: DefinedSpace>(definition: &Definition, text: &Value) -> Result<Self, RveError> {
        let refused = |error: DefinitionError| RveError::Definition(error.to_string());
        let GrainDefinition { packing, contact, options } =
            S::definition_from_bytes(&definition.bytes).map_err(refused)?;
        contact.validate().map_err(refused)?;
        let coordinate = |grain: &S::Grain, axis| if axis < S::DIMENSION { S::centre(grain)[axis] } else { 0.0 };
        let mut periodicity = [0.0; 9];
        for row in 0..S::DIMENSION {
            for column in 0..S::DIMENSION {
                periodicity[3 * row + column] = packing.periodicity[row][column];
            }
        }
        Ok(Self {
            version: packing.version,
            dimension: packing.dimension,
            centres: packing.grains.iter().flat_map(|grain| [0, 1, 2].map(|axis| coordinate(grain, axis))).collect(),
            radii: packing.grains.iter().map(S::radius).collect(),
            periodicity,
            thickness: packing.thickness,
            contact,
            options,
            text: CString::new(text.to_string())
                .map_err(|_| RveError::Definition("the definition holds a null byte".into()))?,
        })
    }

    /// As the header describes it, with 0 for the numbers that the law does not have; borrows from `self`.
    fn cell(&self) -> Cell {
        Cell {
            dimension: self.dimension,
            grains: u32::try_from(self.radii.len()).unwrap_or(u32::MAX),
            thickness: self.thickness,
            periodicity: self.periodicity,
            centres: self.centres.as_ptr(),
            radii: self.radii.as_ptr(),
            normal_stiffness: self.contact.normal_stiffness.unwrap_or(0.0),
            modulus: self.contact.modulus.unwrap_or(0.0),
            stiffness_ratio: self.contact.stiffness_ratio.unwrap_or(0.0),
            friction: self.contact.friction,
            cohesion: self.contact.cohesion,
            strain_per_step: self.options.strain_per_step(),
            tolerance: self.options.tolerance(),
            definition: self.text.as_ptr(),
        }
    }
}

/// The words of a text that are separated by spaces; none of no text.
fn list(text: Option<String>) -> Vec<String> {
    text.unwrap_or_default().split_whitespace().map(str::to_owned).collect()
}

/// What C wrote into a buffer, up to its end.
fn words(buffer: &[u8]) -> String {
    let text: Vec<u8> = buffer.iter().copied().take_while(|byte| *byte != 0).collect();
    if text.is_empty() { "no reason given".to_owned() } else { String::from_utf8_lossy(&text).into_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn definition(value: &Value) -> Definition {
        Definition { bytes: rmp_serde::to_vec_named(value).unwrap() }
    }

    /// Two discs, with the keys that no definition may lack.
    fn discs() -> Value {
        json!({
            "packing": {
                "format": "grainspan-packing", "version": 1, "dimension": 2,
                "periodicity": [[2.0, 0.0], [0.5, 1.0]],
                "grains": [[0.5, 0.25, 0.125], [1.5, -0.25, 0.25]],
            },
            "contact": { "modulus": 1e8, "stiffness_ratio": 0.5, "friction": 0.3 },
        })
    }

    fn refusal(value: &Value) -> String {
        Parts::read(&definition(value)).err().unwrap().to_string()
    }

    #[test]
    fn plane_definitions_are_handed_on_in_space() {
        let parts = Parts::read(&definition(&discs())).unwrap();
        assert_eq!(parts.centres, [0.5, 0.25, 0.0, 1.5, -0.25, 0.0]);
        assert_eq!(parts.radii, [0.125, 0.25]);
        assert_eq!(parts.periodicity, [2.0, 0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 0.0]);
        let cell = parts.cell();
        assert_eq!((cell.dimension, cell.grains, cell.thickness), (2, 2, 1.0));
        assert_eq!([cell.modulus, cell.stiffness_ratio, cell.friction], [1e8, 0.5, 0.3]);
        assert_eq!([cell.normal_stiffness, cell.cohesion], [0.0, 0.0]);
        let usual = RveOptions::default();
        assert_eq!([cell.strain_per_step, cell.tolerance], [usual.strain_per_step(), usual.tolerance()]);
    }

    #[test]
    fn spheres_have_three_coordinates() {
        let mut value = discs();
        value["packing"]["dimension"] = json!(3);
        value["packing"]["periodicity"] = json!([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]);
        value["packing"]["grains"] = json!([[0.5, 0.25, 0.75, 0.125]]);
        value["contact"] =
            json!({ "law": "hertz_mindlin", "shear_modulus": 29e9, "poisson_ratio": 0.2, "friction": 0.5 });
        let parts = Parts::read(&definition(&value)).unwrap();
        assert_eq!((parts.centres, parts.radii), (vec![0.5, 0.25, 0.75], vec![0.125]));
        assert_eq!(parts.periodicity, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
        assert_eq!((parts.dimension, parts.contact.law.keyword()), (3, "hertz_mindlin"));
    }

    #[test]
    fn the_text_is_the_definition_as_it_came() {
        let value = discs();
        let parts = Parts::read(&definition(&value)).unwrap();
        assert_eq!(parts.text.to_str().unwrap(), value.to_string());
    }

    #[test]
    fn nothing_that_is_missing_or_no_number_is_made_up() {
        let without = |table: &str, key: &str| {
            let mut value = discs();
            value[table].as_object_mut().unwrap().remove(key).unwrap();
            refusal(&value)
        };
        assert!(without("contact", "friction").contains("friction"));
        assert!(without("contact", "modulus").contains("normal_stiffness (N/m) or modulus (Pa) is missing"));
        assert!(without("contact", "stiffness_ratio").contains("stiffness_ratio"));
        assert!(without("packing", "dimension").contains("dimension"));
        assert!(without("packing", "grains").contains("grains"));
        for grains in [json!([[0.5, 0.5]]), json!([[0.5, "left", 0.5, 0.1]]), json!([[0.5, 0.5, 0.5, 0.1]])] {
            let mut value = discs();
            value["packing"]["grains"] = grains;
            assert!(refusal(&value).contains("not a definition of grains"), "{}", refusal(&value));
        }
    }
}

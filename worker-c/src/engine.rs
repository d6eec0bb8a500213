//! A table of C functions as an engine.
#![expect(unsafe_code, reason = "the boundary to C: see the crate documentation")]

use crate::table::{Answer, Cell, EngineTable, TrialOptions};
use protocol::{
    Capabilities, Cost, Definition, DefinitionId, RveEngine, RveError, RveSolver, Scalars, SnapshotKind, TangentKind,
    Tensor2, TrialFlags, TrialOptions as WireOptions, TrialResult, snapshot,
};
use rve_server::definition::{EngineFeature, PackingFile, RveOptions};
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
        if parts.version != u64::from(known) && !self.features.iter().any(|word| word == moments) {
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
        if !self.laws.contains(&parts.law) {
            let reason = format!("engine `{}` does not serve the law `{}`", self.name, parts.law);
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
            largest_target: parts.largest_target.map_or(self.largest_target, |given| given.min(self.largest_target)),
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
                solve_nanoseconds: u64::try_from(begun.elapsed().as_nanos()).unwrap_or(u64::MAX),
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
    version: u64,
    dimension: u32,
    law: String,
    centres: Vec<f64>,
    radii: Vec<f64>,
    periodicity: [f64; 9],
    thickness: f64,
    contact: Value,
    accuracy: (f64, f64),
    largest_target: Option<f64>,
    text: CString,
}

impl Parts {
    fn read(definition: &Definition) -> Result<Self, RveError> {
        let value: Value = rmp_serde::from_slice(&definition.bytes)
            .map_err(|error| RveError::Definition(format!("these bytes are not a definition of grains: {error}")))?;
        let packing = &value["packing"];
        let lacks = |what: &str| RveError::Definition(format!("the definition has no {what}"));
        let dimension = packing["dimension"].as_u64().filter(|one| [2, 3].contains(one)).ok_or(lacks("dimension"))?;
        let version = packing["version"].as_u64().ok_or(lacks("version"))?;
        let places = dimension as usize;
        let (mut centres, mut radii) = (Vec::new(), Vec::new());
        for grain in packing["grains"].as_array().ok_or(lacks("grains"))? {
            let numbers: Vec<f64> = grain.as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
            if numbers.len() != places + 1 {
                let reason = "a grain has another number of coordinates than the packing dimensions";
                return Err(RveError::Definition(reason.into()));
            }
            centres.extend((0..3).map(|axis| if axis < places { numbers[axis] } else { 0.0 }));
            radii.push(numbers[places]);
        }
        let mut periodicity = [0.0; 9];
        for row in 0..places {
            for column in 0..places {
                periodicity[3 * row + column] =
                    packing["periodicity"][row][column].as_f64().ok_or(lacks("periodicity"))?;
            }
        }
        let options = match &value["options"] {
            Value::Null => RveOptions::default(),
            options => serde_json::from_value::<RveOptions>(options.clone())
                .map_err(|error| RveError::Definition(format!("the options of the definition: {error}")))?,
        };
        Ok(Self {
            version,
            dimension: dimension as u32,
            law: value["contact"]["law"].as_str().unwrap_or("linear").to_owned(),
            centres,
            radii,
            periodicity,
            thickness: packing["thickness"].as_f64().unwrap_or(1.0),
            contact: value["contact"].clone(),
            accuracy: (options.strain_per_step(), options.tolerance()),
            largest_target: options.largest_target,
            text: CString::new(value.to_string())
                .map_err(|_| RveError::Definition("the definition holds a null byte".into()))?,
        })
    }

    /// As the header describes it; borrows from `self`.
    fn cell(&self) -> Cell {
        let number = |key: &str| self.contact[key].as_f64().unwrap_or(0.0);
        Cell {
            dimension: self.dimension,
            grains: u32::try_from(self.radii.len()).unwrap_or(u32::MAX),
            thickness: self.thickness,
            periodicity: self.periodicity,
            centres: self.centres.as_ptr(),
            radii: self.radii.as_ptr(),
            normal_stiffness: number("normal_stiffness"),
            modulus: number("modulus"),
            stiffness_ratio: number("stiffness_ratio"),
            friction: number("friction"),
            cohesion: number("cohesion"),
            strain_per_step: self.accuracy.0,
            tolerance: self.accuracy.1,
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

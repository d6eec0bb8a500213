//! What an RVE is made of: the tables `[contact]` and `[rve]` of a scene, and the definition that workers receive.

use crate::packing::PackingFile;
use protocol::Definition;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Why a table was refused.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0}")]
pub struct DefinitionError(pub String);

/// Contact laws by keyword.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ContactLaw {
    /// Linear springs with Coulomb friction, [Argilaga2018] appendix A.
    #[default]
    Linear,
    /// Hertz-Mindlin spheres; for three-dimensional packings only.
    HertzMindlin,
}

/// Whether grains may rotate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rotations {
    /// Grains rotate.
    #[default]
    Free,
    /// Grains only translate.
    Blocked,
}

/// The table `[contact]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactTable {
    /// Contact law.
    #[serde(default)]
    pub law: ContactLaw,
    /// Normal stiffness k_n of every contact, N/m. Exactly one of this and `modulus`.
    #[serde(default)]
    pub normal_stiffness: Option<f64>,
    /// Modulus E, Pa: k_n = 2 E R1 R2 / (R1 + R2).
    #[serde(default)]
    pub modulus: Option<f64>,
    /// k_t / k_n, dimensionless.
    #[serde(default)]
    pub stiffness_ratio: Option<f64>,
    /// Grain shear modulus of Hertz-Mindlin contacts, Pa.
    #[serde(default)]
    pub shear_modulus: Option<f64>,
    /// Grain Poisson ratio of Hertz-Mindlin contacts, dimensionless.
    #[serde(default)]
    pub poisson_ratio: Option<f64>,
    /// Coulomb coefficient mu, dimensionless.
    pub friction: f64,
    /// Cohesive overlap C of f_n = -k_n (h - C), m.
    #[serde(default)]
    pub cohesion: f64,
    /// Contact viscosity; only 0 is accepted, quasi-static results have no rate.
    #[serde(default)]
    pub damping: f64,
    /// Whether grains may rotate.
    #[serde(default)]
    pub rotations: Rotations,
    /// Density of the grain material, kg/m3; quasi-static results do not depend on it.
    #[serde(default = "quartz_density")]
    pub density: f64,
}

fn quartz_density() -> f64 {
    2650.0
}

/// How k_n follows from the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NormalStiffness {
    /// The same for all contacts, N/m.
    Constant(f64),
    /// From a modulus, Pa, and both radii.
    Modulus(f64),
}

impl NormalStiffness {
    /// k_n of a contact between grains of two radii, N/m.
    pub fn of(self, first: f64, second: f64) -> f64 {
        match self {
            Self::Constant(stiffness) => stiffness,
            Self::Modulus(modulus) => 2.0 * modulus * first * second / (first + second),
        }
    }
}

impl ContactTable {
    /// A linear law with a constant normal stiffness and everything else at its default.
    pub fn linear(normal_stiffness: f64, stiffness_ratio: f64, friction: f64) -> Self {
        Self {
            law: ContactLaw::Linear,
            normal_stiffness: Some(normal_stiffness),
            modulus: None,
            stiffness_ratio: Some(stiffness_ratio),
            shear_modulus: None,
            poisson_ratio: None,
            friction,
            cohesion: 0.0,
            damping: 0.0,
            rotations: Rotations::Free,
            density: quartz_density(),
        }
    }

    /// Checks every key.
    ///
    /// # Errors
    /// The first offending key with the remedy.
    pub fn validate(&self) -> Result<(), DefinitionError> {
        let refuse = |reason: String| Err(DefinitionError(reason));
        if self.law == ContactLaw::HertzMindlin {
            return refuse("contact.law = \"hertz_mindlin\" is not served for discs; use law = \"linear\"".into());
        }
        for (key, value) in [("shear_modulus", self.shear_modulus), ("poisson_ratio", self.poisson_ratio)] {
            if value.is_some() {
                return refuse(format!("contact.{key} belongs to law = \"hertz_mindlin\"; remove it"));
            }
        }
        self.normal()?;
        self.ratio()?;
        not_negative("contact.friction", self.friction)?;
        not_negative("contact.cohesion", self.cohesion)?;
        positive("contact.density", self.density)?;
        if self.damping != 0.0 {
            return refuse(format!(
                "contact.damping = {} has no meaning in a quasi-static cell; remove it or set 0",
                self.damping
            ));
        }
        Ok(())
    }

    /// The normal stiffness rule.
    ///
    /// # Errors
    /// Neither or both of `normal_stiffness` and `modulus`, or not a positive number.
    pub fn normal(&self) -> Result<NormalStiffness, DefinitionError> {
        match (self.normal_stiffness, self.modulus) {
            (Some(stiffness), None) => {
                positive("contact.normal_stiffness", stiffness)?;
                Ok(NormalStiffness::Constant(stiffness))
            }
            (None, Some(modulus)) => {
                positive("contact.modulus", modulus)?;
                Ok(NormalStiffness::Modulus(modulus))
            }
            (Some(_), Some(_)) => Err(DefinitionError("contact: give normal_stiffness or modulus, not both".into())),
            (None, None) => Err(DefinitionError("contact: normal_stiffness (N/m) or modulus (Pa) is missing".into())),
        }
    }

    fn ratio(&self) -> Result<f64, DefinitionError> {
        let ratio = self
            .stiffness_ratio
            .ok_or_else(|| DefinitionError("contact.stiffness_ratio (k_t / k_n) is missing".into()))?;
        not_negative("contact.stiffness_ratio", ratio)?;
        Ok(ratio)
    }

    /// k_t / k_n of a validated table.
    pub fn tangential_ratio(&self) -> f64 {
        self.stiffness_ratio.unwrap_or(0.0)
    }
}

/// Named accuracy: a strain per ramp step and a tolerance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Accuracy {
    /// 5e-6 strain per step, force tolerance 1e-2: for trying things out.
    Draft,
    /// 1e-6 strain per step, force tolerance 1e-3.
    #[default]
    Default,
    /// 1e-7 strain per step, force tolerance 1e-7: for verification.
    Tight,
}

/// Equilibrium criteria by keyword. They are not equivalent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// Largest unbalanced force, or moment over radius, of any grain over the mean normal contact force
    /// [Argilaga2018].
    #[default]
    MaxForce,
    /// Root mean square unbalanced force of the grains over that of the contact forces, [Liu2015] eq. 57.
    RmsForce,
    /// Kinetic over elastic energy [Liu2018], met in ten consecutive steps. Erratum: a single hit also accepts every
    /// turning point of the motion.
    Energy,
}

/// Dampings by keyword.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Damping {
    /// Fast inertial relaxation engine: velocities are steered towards the forces and reset when they oppose them.
    #[default]
    Fire,
    /// Non-viscous local damping of the peculiar velocity.
    Local,
}

/// The table `[rve]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RveOptions {
    /// Named accuracy; `strain_per_step` and `tolerance` override its two values.
    pub accuracy: Accuracy,
    /// Largest strain component applied in one ramp step, dimensionless.
    pub strain_per_step: Option<f64>,
    /// Equilibrium criterion.
    pub criterion: Criterion,
    /// Value that the criterion must reach, dimensionless.
    pub tolerance: Option<f64>,
    /// Damping.
    pub damping: Damping,
    /// Coefficient of local damping, in (0, 1); default 0.7.
    pub local_damping: Option<f64>,
    /// Most relaxation steps after the ramp; default 50 000. A trial that needs more is flagged, not failed.
    pub max_steps: Option<u32>,
    /// Largest |H| of one trial, dimensionless; default 0.2.
    pub largest_target: Option<f64>,
}

impl RveOptions {
    /// Checks every key.
    ///
    /// # Errors
    /// The first offending key with the remedy.
    pub fn validate(&self) -> Result<(), DefinitionError> {
        positive("rve.strain_per_step", self.strain_per_step())?;
        positive("rve.tolerance", self.tolerance())?;
        positive("rve.largest_target", self.largest_target())?;
        if self.local_damping.is_some() && self.damping != Damping::Local {
            return Err(DefinitionError("rve.local_damping needs damping = \"local\"".into()));
        }
        let coefficient = self.local_coefficient();
        if !(coefficient > 0.0 && coefficient < 1.0) {
            return Err(DefinitionError(format!("rve.local_damping = {coefficient} must lie between 0 and 1")));
        }
        if self.max_steps() == 0 {
            return Err(DefinitionError("rve.max_steps must be at least 1".into()));
        }
        Ok(())
    }

    /// Strain per ramp step in force.
    pub fn strain_per_step(&self) -> f64 {
        self.strain_per_step.unwrap_or(match self.accuracy {
            Accuracy::Draft => 5e-6,
            Accuracy::Default => 1e-6,
            Accuracy::Tight => 1e-7,
        })
    }

    /// Tolerance in force. The energy criterion is quadratic in the forces, so its named values are the squares.
    pub fn tolerance(&self) -> f64 {
        let force = match self.accuracy {
            Accuracy::Draft => 1e-2,
            Accuracy::Default => 1e-3,
            Accuracy::Tight => 1e-7,
        };
        self.tolerance.unwrap_or(if self.criterion == Criterion::Energy { force * force } else { force })
    }

    /// Coefficient of local damping in force.
    pub fn local_coefficient(&self) -> f64 {
        self.local_damping.unwrap_or(0.7)
    }

    /// Step cap in force.
    pub fn max_steps(&self) -> u32 {
        self.max_steps.unwrap_or(50_000)
    }

    /// Limit of |H| in force.
    pub fn largest_target(&self) -> f64 {
        self.largest_target.unwrap_or(0.2)
    }
}

fn positive(key: &str, value: f64) -> Result<(), DefinitionError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(DefinitionError(format!("{key} = {value} must be a positive number")))
}

fn not_negative(key: &str, value: f64) -> Result<(), DefinitionError> {
    if value.is_finite() && value >= 0.0 {
        return Ok(());
    }
    Err(DefinitionError(format!("{key} = {value} must be zero or a positive number")))
}

/// All that this engine needs to build an RVE.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GrainDefinition {
    /// Packing, checked.
    pub packing: PackingFile,
    /// Contact law.
    pub contact: ContactTable,
    /// Solver options.
    #[serde(default)]
    pub options: RveOptions,
}

impl GrainDefinition {
    /// Checks all three parts.
    ///
    /// # Errors
    /// The first defect with the remedy.
    pub fn validate(self) -> Result<Self, DefinitionError> {
        self.contact.validate()?;
        self.options.validate()?;
        let packing = self.packing.checked().map_err(|error| DefinitionError(error.to_string()))?;
        Ok(Self { packing, ..self })
    }

    /// The bytes that travel to workers. Equal definitions give equal bytes; the packing's provenance is left out so
    /// that a comment cannot change an identity.
    pub fn to_protocol(&self) -> Definition {
        let bare = Self {
            packing: PackingFile { provenance: serde_json::Value::Null, ..self.packing.clone() },
            ..self.clone()
        };
        let bytes = rmp_serde::to_vec_named(&bare).expect("writing MessagePack to memory cannot fail");
        Definition { bytes }
    }

    /// Reads and checks a definition.
    ///
    /// # Errors
    /// Bytes that are not a definition, or the first defect in it.
    pub fn from_protocol(definition: &Definition) -> Result<Self, DefinitionError> {
        let parsed: Self = rmp_serde::from_slice(&definition.bytes)
            .map_err(|error| DefinitionError(format!("these bytes are not a definition of grains: {error}")))?;
        parsed.validate()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contact(text: &str) -> Result<(), String> {
        let table: ContactTable = toml::from_str(text).map_err(|error| error.message().to_owned())?;
        table.validate().map_err(|error| error.to_string())
    }

    fn options(text: &str) -> Result<(), String> {
        let table: RveOptions = toml::from_str(text).map_err(|error| error.message().to_owned())?;
        table.validate().map_err(|error| error.to_string())
    }

    #[test]
    fn contact_tables_of_the_documentation_are_accepted() {
        contact("law = \"linear\"\nmodulus = 6.0e8\nstiffness_ratio = 0.8\nfriction = 0.5463").unwrap();
        contact("normal_stiffness = 1e7\nstiffness_ratio = 0\nfriction = 0\nrotations = \"blocked\"").unwrap();
    }

    #[test]
    fn contact_defects_name_their_key() {
        let base = "stiffness_ratio = 0.5\nfriction = 0.5\n";
        let refused = |text: &str| contact(&format!("{base}{text}")).unwrap_err();
        assert!(refused("").contains("normal_stiffness (N/m) or modulus (Pa) is missing"));
        assert!(refused("modulus = 1e8\nnormal_stiffness = 1").contains("not both"));
        assert!(refused("modulus = -1e8").contains("contact.modulus = -100000000 must be a positive"));
        assert!(refused("modulus = 1e8\ncohesion = -1").contains("contact.cohesion"));
        assert!(refused("modulus = 1e8\ndamping = 0.1").contains("contact.damping"));
        assert!(refused("modulus = 1e8\nfrictoin = 0.1").contains("frictoin"));
        assert!(refused("modulus = 1e8\nlaw = \"hertz_mindlin\"").contains("use law = \"linear\""));
        assert!(refused("modulus = nan").contains("contact.modulus"));
    }

    #[test]
    fn option_defects_name_their_key() {
        options("accuracy = \"draft\"\ncriterion = \"rms_force\"\ndamping = \"local\"\nlocal_damping = 0.5").unwrap();
        assert!(options("tolerance = 0").unwrap_err().contains("rve.tolerance"));
        assert!(options("strain_per_step = -1").unwrap_err().contains("rve.strain_per_step"));
        assert!(options("local_damping = 0.5").unwrap_err().contains("damping = \"local\""));
        assert!(options("damping = \"local\"\nlocal_damping = 1.5").unwrap_err().contains("between 0 and 1"));
        assert!(options("accuracy = \"best\"").unwrap_err().contains("draft"));
    }

    #[test]
    fn definition_survives_the_wire_and_forgets_provenance() {
        let packing = PackingFile {
            format: PackingFile::FORMAT.into(),
            version: 1,
            dimension: 2,
            thickness: 1.0,
            periodicity: [[1.0, 0.0], [0.0, 1.0]],
            grains: vec![[0.5, 0.5, 0.51]],
            contacts: vec![],
            provenance: serde_json::json!({ "seed": 7 }),
        };
        let contact = ContactTable::linear(1.0, 0.5, 0.5);
        let named =
            GrainDefinition { packing: packing.clone(), contact: contact.clone(), options: RveOptions::default() };
        let bare = GrainDefinition {
            packing: PackingFile { provenance: serde_json::Value::Null, ..packing },
            ..named.clone()
        };
        assert_eq!(named.to_protocol(), bare.to_protocol());
        assert_eq!(GrainDefinition::from_protocol(&named.to_protocol()).unwrap(), bare);
    }
}

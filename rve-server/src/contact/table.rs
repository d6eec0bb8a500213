//! The table `[contact]`: the law between grains.

use super::linear::NormalStiffness;
use super::unloading::TangentialUnloading;
use crate::error::{DefinitionError, in_declared_ranges};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Contact laws by keyword.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LawName {
    /// Linear springs with Coulomb friction, [Argilaga2018] appendix A.
    #[default]
    Linear,
    /// Elastic spheres: Hertz along the normal, Mindlin without slip across it; for packings in space only.
    HertzMindlin,
}

protocol::keywords! {
    pub LawName {
        Linear => "linear",
        HertzMindlin => "hertz_mindlin",
    }
}

impl LawName {
    /// Whether the stiffness of a contact does not change with its overlap.
    pub fn is_linear(self) -> bool {
        match self {
            Self::Linear => true,
            Self::HertzMindlin => false,
        }
    }

    /// Whether it is a law of discs too, not of spheres alone.
    pub fn is_for_discs(self) -> bool {
        match self {
            Self::Linear => true,
            Self::HertzMindlin => false,
        }
    }
}

/// Whether grains may rotate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Rotations {
    /// Grains rotate.
    #[default]
    Free,
    /// Grains only translate. Those of a cell turn with it, as its deformation turns; those of a specimen do not turn at all, so that both
    /// differ in shear.
    Blocked,
    /// In a frame of boundary grains, the grains inside it only translate, those of the boundary rotate [Liu2018]. Refused elsewhere.
    InnerBlocked,
}

/// The table `[contact]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ContactTable {
    /// Contact law.
    #[serde(default)]
    pub law: LawName,
    /// Normal stiffness k_n of every contact. Exactly one of this and `modulus`.
    #[serde(default)]
    #[schemars(extend("x-unit" = "N/m", "exclusiveMinimum" = 0))]
    pub normal_stiffness: Option<f64>,
    /// Modulus E: k_n = 2 E R1 R2 / (R1 + R2).
    #[serde(default)]
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0))]
    pub modulus: Option<f64>,
    /// k_t / k_n.
    #[serde(default)]
    #[schemars(extend("x-unit" = "-"), range(min = 0.0, max = 1000.0))]
    pub stiffness_ratio: Option<f64>,
    /// Grain shear modulus of Hertz-Mindlin contacts.
    #[serde(default)]
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0))]
    pub shear_modulus: Option<f64>,
    /// Grain Poisson ratio of Hertz-Mindlin contacts.
    #[serde(default)]
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = -1), range(max = 0.5))]
    pub poisson_ratio: Option<f64>,
    /// Coulomb coefficient mu.
    #[schemars(extend("x-unit" = "-"), range(min = 0.0))]
    pub friction: f64,
    /// Overlap C at zero force: `f_n = -k_n (delta - C)` with the overlap `delta`; with `hertz_mindlin` the attraction is the elastic
    /// force at the overlap C.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"), range(min = 0.0))]
    pub cohesion: f64,
    /// Of cells: contact viscosity over stiffness, in pseudo-time steps; of specimens, whose grains move in time: damping ratio of every
    /// contact, a share of the critical viscosity. In cells a motion of one step is answered by this many times the
    /// elastic force it causes; along a contact that slides, by none. It acts while grains move and on them alone:
    /// none at equilibrium. Where the path matters, the stress differs from that without damping, by about 0.2 % of the pressure
    /// with a friction of 0.3 or 0.5, by 1 % with 0.05. With a damping below 2 cells come to rest in about as many steps as
    /// without, above in twice as many. It is no dashpot constant in N s/m: with hundreds of steps a cell hardly moves.
    #[serde(default)]
    #[schemars(extend("x-unit" = "steps, of specimens -"), range(min = 0.0, max = 1000.0))]
    pub damping: f64,
    /// Effect of unloading on the tangential force of Hertz-Mindlin contacts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-default" = "\"rescaled\""))]
    pub unloading: Option<TangentialUnloading>,
    /// Rolling stiffness over k_t R1 R2; 0 = none. Without tangential stiffness there is no rolling moment.
    #[serde(default, skip_serializing_if = "is_zero")]
    #[schemars(extend("x-unit" = "-"), range(min = 0.0))]
    pub rolling_stiffness: f64,
    /// Largest rolling moment over min(R1, R2) times the normal force; 0 = none.
    #[serde(default, skip_serializing_if = "is_zero")]
    #[schemars(extend("x-unit" = "-"), range(min = 0.0))]
    pub rolling_friction: f64,
    /// Whether grains may rotate.
    #[serde(default)]
    pub rotations: Rotations,
    /// Density of the grain material; quasi-static results do not depend on it.
    #[serde(default = "quartz_density")]
    #[schemars(extend("x-unit" = "kg/m3", "exclusiveMinimum" = 0))]
    pub density: f64,
}

/// Keys that are not used stay out of recipes and definitions.
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn quartz_density() -> f64 {
    2650.0
}

impl ContactTable {
    /// A linear law with a constant normal stiffness and everything else at its default.
    pub fn linear(normal_stiffness: f64, stiffness_ratio: f64, friction: f64) -> Self {
        Self {
            law: LawName::Linear,
            normal_stiffness: Some(normal_stiffness),
            modulus: None,
            stiffness_ratio: Some(stiffness_ratio),
            shear_modulus: None,
            poisson_ratio: None,
            friction,
            cohesion: 0.0,
            damping: 0.0,
            unloading: None,
            rolling_stiffness: 0.0,
            rolling_friction: 0.0,
            rotations: Rotations::Free,
            density: quartz_density(),
        }
    }

    /// Elastic spheres with friction and everything else at its default.
    pub fn hertz_mindlin(shear_modulus: f64, poisson_ratio: f64, friction: f64) -> Self {
        Self {
            law: LawName::HertzMindlin,
            normal_stiffness: None,
            stiffness_ratio: None,
            shear_modulus: Some(shear_modulus),
            poisson_ratio: Some(poisson_ratio),
            ..Self::linear(1.0, 1.0, friction)
        }
    }

    /// Whether contacts resist sliding before they slide. Hertz-Mindlin contacts always do.
    pub fn has_tangential_springs(&self) -> bool {
        match self.law {
            LawName::Linear => self.stiffness_ratio.is_none_or(|ratio| ratio > 0.0),
            LawName::HertzMindlin => true,
        }
    }

    /// Checks every key.
    ///
    /// # Errors
    /// The first offending key with the remedy.
    pub fn validate(&self) -> Result<(), DefinitionError> {
        match self.law {
            LawName::Linear => self.validate_linear()?,
            LawName::HertzMindlin => self.validate_hertz_mindlin()?,
        }
        in_declared_ranges(self, "contact")?;
        if (self.rolling_stiffness > 0.0) != (self.rolling_friction > 0.0) {
            return Err(DefinitionError(
                "contact.rolling_stiffness and contact.rolling_friction need each other; give both or none".into(),
            ));
        }
        if self.rolling_stiffness > 0.0 && self.rotations == Rotations::Blocked {
            return Err(DefinitionError(
                "contact.rolling_stiffness has no effect with rotations = \"blocked\"; remove one of them".into(),
            ));
        }
        Ok(())
    }

    /// Refuses what only grains inside a frame can do.
    ///
    /// # Errors
    /// Rotations that are blocked inside a boundary which is not there.
    pub fn refuse_inner_blocked(&self) -> Result<(), DefinitionError> {
        match self.rotations {
            Rotations::Free | Rotations::Blocked => Ok(()),
            Rotations::InnerBlocked => Err(DefinitionError(
                "contact.rotations = \"inner_blocked\" needs a frame, whose boundary grains rotate; give one (in scenes [rve] frame, in \
                 RVE tests [frame]), or take \"blocked\""
                    .into(),
            )),
        }
    }

    fn validate_linear(&self) -> Result<(), DefinitionError> {
        let given = [
            ("shear_modulus", self.shear_modulus.is_some()),
            ("poisson_ratio", self.poisson_ratio.is_some()),
            ("unloading", self.unloading.is_some()),
        ];
        refuse_given(&given, "hertz_mindlin")?;
        self.normal()?;
        self.ratio()?;
        Ok(())
    }

    fn validate_hertz_mindlin(&self) -> Result<(), DefinitionError> {
        let given = [
            ("normal_stiffness", self.normal_stiffness.is_some()),
            ("modulus", self.modulus.is_some()),
            ("stiffness_ratio", self.stiffness_ratio.is_some()),
        ];
        refuse_given(&given, "linear")?;
        self.grain_shear_modulus()?;
        self.grain_poisson_ratio()?;
        Ok(())
    }

    /// Shear modulus of the grains.
    pub(super) fn grain_shear_modulus(&self) -> Result<f64, DefinitionError> {
        self.shear_modulus.ok_or_else(|| missing("shear_modulus", "Pa"))
    }

    /// Poisson ratio of the grains.
    pub(super) fn grain_poisson_ratio(&self) -> Result<f64, DefinitionError> {
        self.poisson_ratio.ok_or_else(|| missing("poisson_ratio", "dimensionless"))
    }

    /// Checks what depends on the dimension of the packing.
    ///
    /// # Errors
    /// Hertz-Mindlin spheres in a plane.
    pub fn validate_for(&self, dimension: usize) -> Result<(), DefinitionError> {
        if dimension != 3 && !self.law.is_for_discs() {
            return Err(self.no_law_of_discs());
        }
        Ok(())
    }

    /// Why discs cannot have this law.
    pub(super) fn no_law_of_discs(&self) -> DefinitionError {
        let name = self.law.keyword();
        DefinitionError(format!(
            "contact.law = \"{name}\" is a law of spheres and the packing holds discs; use law = \"linear\""
        ))
    }

    /// The normal stiffness rule.
    ///
    /// # Errors
    /// Neither or both of `normal_stiffness` and `modulus`.
    pub fn normal(&self) -> Result<NormalStiffness, DefinitionError> {
        match (self.normal_stiffness, self.modulus) {
            (Some(stiffness), None) => Ok(NormalStiffness::Constant(stiffness)),
            (None, Some(modulus)) => Ok(NormalStiffness::Modulus(modulus)),
            (Some(_), Some(_)) => Err(DefinitionError("contact: give normal_stiffness or modulus, not both".into())),
            (None, None) => Err(DefinitionError("contact: normal_stiffness (N/m) or modulus (Pa) is missing".into())),
        }
    }

    fn ratio(&self) -> Result<f64, DefinitionError> {
        self.stiffness_ratio.ok_or_else(|| DefinitionError("contact.stiffness_ratio (k_t / k_n) is missing".into()))
    }

    /// k_t / k_n of a validated table.
    pub fn tangential_ratio(&self) -> f64 {
        self.stiffness_ratio.unwrap_or(0.0)
    }
}

/// A number of the grains that a law needs.
fn missing(key: &str, unit: &str) -> DefinitionError {
    DefinitionError(format!("contact.{key} ({unit}) of the grains is missing"))
}

/// Refuses keys of another law.
fn refuse_given(keys: &[(&str, bool)], law: &str) -> Result<(), DefinitionError> {
    match keys.iter().find(|(_, given)| *given) {
        Some((key, _)) => Err(DefinitionError(format!("contact.{key} belongs to law = \"{law}\"; remove it"))),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::definition::{Criterion, Damping, FrameConstraint};

    fn contact(text: &str) -> Result<(), String> {
        let table: ContactTable = toml::from_str(text).map_err(|error| error.message().to_owned())?;
        table.validate().map_err(|error| error.to_string())
    }

    #[test]
    fn contact_tables_of_the_documentation_are_accepted() {
        contact("law = \"linear\"\nmodulus = 6.0e8\nstiffness_ratio = 0.8\nfriction = 0.5463").unwrap();
        contact("normal_stiffness = 1e7\nstiffness_ratio = 0\nfriction = 0\nrotations = \"blocked\"").unwrap();
        let spheres = "law = \"hertz_mindlin\"\nshear_modulus = 2.9e10\npoisson_ratio = 0.15\nfriction = 0.5\n";
        contact(&format!("{spheres}unloading = \"incremental\"\nrolling_stiffness = 1\nrolling_friction = 0.1"))
            .unwrap();
        let table: ContactTable = toml::from_str(spheres).unwrap();
        assert!(table.validate_for(2).unwrap_err().to_string().contains("use law = \"linear\""));
        table.validate_for(3).unwrap();
    }

    #[test]
    fn keywords_are_those_of_scenes() {
        for law in LawName::ALL {
            assert_eq!(serde_json::to_value(law).unwrap(), law.keyword());
        }
        for criterion in Criterion::ALL {
            assert_eq!(serde_json::to_value(criterion).unwrap(), criterion.keyword());
        }
        for damping in Damping::ALL {
            assert_eq!(serde_json::to_value(damping).unwrap(), damping.keyword());
        }
        for constraint in FrameConstraint::ALL {
            assert_eq!(serde_json::to_value(constraint).unwrap(), constraint.keyword());
        }
    }

    #[test]
    fn contact_defects_name_their_key() {
        let base = "stiffness_ratio = 0.5\nfriction = 0.5\n";
        let refused = |text: &str| contact(&format!("{base}{text}")).unwrap_err();
        assert!(refused("").contains("normal_stiffness (N/m) or modulus (Pa) is missing"));
        assert!(refused("modulus = 1e8\nnormal_stiffness = 1").contains("not both"));
        assert!(refused("modulus = -1e8").contains("contact.modulus must be above 0, not -100000000"));
        assert!(refused("modulus = 1e8\ncohesion = -1").contains("contact.cohesion"));
        assert!(refused("modulus = 1e8\ndamping = -0.1").contains("contact.damping"));
        assert!(refused("modulus = 1e8\nrolling_friction = 0.1").contains("need each other"));
        assert!(refused("modulus = 1e8\nfrictoin = 0.1").contains("frictoin"));
        assert!(refused("modulus = 1e8\nlaw = \"hertz_mindlin\"").contains("belongs to law = \"linear\""));
        assert!(refused("modulus = nan").contains("contact.modulus"));
    }
}

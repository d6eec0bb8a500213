//! The table `[contact]`: the law between grains.

use super::{DefinitionError, not_negative, positive};
use serde::{Deserialize, Serialize};

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

#[cfg(test)]
mod tests {
    use super::*;

    fn contact(text: &str) -> Result<(), String> {
        let table: ContactTable = toml::from_str(text).map_err(|error| error.message().to_owned())?;
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
}

//! From the kind of a probe or profile to what is measured at a Gauss point.

use super::ProbeContext;
use crate::input_error::InputError;
use crate::tables::ProbeKind;
use keys::Located;
use macro_solver::mesh::Dimension;
use macro_solver::output::{Axes, Measure, Rank, StressMeasure};
use std::ops::Range;

/// A kind as it is written in a table.
pub(super) struct Word<'a> {
    pub(super) context: &'a ProbeContext<'a>,
    /// Where errors about the kind point to.
    pub(super) place: Range<usize>,
    /// Name of the probe or profile.
    pub(super) name: &'a str,
    pub(super) kind: ProbeKind,
}

impl Word<'_> {
    fn error(&self, problem: impl ToString) -> InputError {
        self.context.document.error_at(self.place.clone(), problem)
    }

    /// The kind measures nothing at Gauss points.
    pub(super) fn not_at_points(&self) -> InputError {
        self.error(format!("the kind \"{}\" of '{}' is not measured at Gauss points", self.kind.keyword(), self.name))
            .hint("take for example \"shear_strain\" or \"porosity\"")
    }

    fn is_mesh_in_space(&self) -> bool {
        self.context.sets.mesh.dimension == Dimension::Space
    }

    fn has_spheres(&self) -> bool {
        self.context.materials.cell_dimension() == 3
    }

    fn strain_axes(&self) -> Axes {
        if self.is_mesh_in_space() { Axes::Space } else { Axes::Plane }
    }

    fn stress_axes(&self) -> Axes {
        if self.has_spheres() { Axes::Space } else { Axes::Plane }
    }

    fn given<'a>(
        &self,
        component: Option<&'a Located<String>>,
        example: &str,
    ) -> Result<&'a Located<String>, InputError> {
        component.ok_or_else(|| {
            self.error(format!("'{}' of kind \"{}\" lacks the key `component`", self.name, self.kind.keyword()))
                .hint(format!("add for example component = \"{example}\""))
        })
    }

    fn wrong(&self, found: &Located<String>, choices: &str) -> InputError {
        self.context
            .document
            .error_at(
                found.span(),
                format!("'{}' is not a component of \"{}\"", found.get_ref(), self.kind.keyword()),
            )
            .hint(format!("write {choices}"))
    }

    /// Two axes, as many as the tensor has: `is_in_space` says whether z is one of them.
    fn pair(&self, component: Option<&Located<String>>, is_in_space: bool) -> Result<(usize, usize), InputError> {
        let component = self.given(component, "xy")?;
        let axes: Vec<usize> = component.get_ref().chars().filter_map(|letter| "xyz".find(letter)).collect();
        let has_two = component.get_ref().chars().count() == 2;
        match axes[..] {
            [row, column] if has_two && (is_in_space || row.max(column) < 2) => Ok((row, column)),
            _ if is_in_space => {
                Err(self.wrong(component, "two of the letters x, y and z, for example \"xx\" or \"xy\""))
            }
            _ => Err(self.wrong(component, "two of the letters x and y, for example \"xx\" or \"xy\"")),
        }
    }

    fn rotation_axis(&self, component: Option<&Located<String>>) -> Result<usize, InputError> {
        let component = self.given(component, "z")?;
        match component.get_ref().as_str() {
            "z" => Ok(2),
            "x" if self.has_spheres() => Ok(0),
            "y" if self.has_spheres() => Ok(1),
            _ if self.has_spheres() => Err(self.wrong(component, "\"x\", \"y\" or \"z\"")),
            _ => Err(self.wrong(component, "\"z\": discs turn in the plane")),
        }
    }

    fn rank(&self, word: &str, component: &Located<String>) -> Result<Rank, InputError> {
        match (word, self.stress_axes()) {
            ("major", _) => Ok(Rank::Major),
            ("minor", _) => Ok(Rank::Minor),
            ("intermediate", Axes::Space) => Ok(Rank::Intermediate),
            ("intermediate", Axes::Plane) => {
                Err(self.wrong(component, "\"major\" or \"minor\": cells of discs have the two of the plane"))
            }
            _ => {
                let example = if self.kind == ProbeKind::PrincipalRatio { "major/minor" } else { "major" };
                Err(self.wrong(
                    component,
                    &format!("\"major\", \"intermediate\" or \"minor\", for example \"{example}\""),
                ))
            }
        }
    }

    fn principal_ratio(&self, component: Option<&Located<String>>) -> Result<StressMeasure, InputError> {
        let component = self.given(component, "major/minor")?;
        let Some((upper, lower)) = component.get_ref().split_once('/') else {
            return Err(self.wrong(component, "two ranks, for example \"major/minor\""));
        };
        let (upper, lower) = (self.rank(upper, component)?, self.rank(lower, component)?);
        Ok(StressMeasure::PrincipalRatio(upper, lower, self.stress_axes()))
    }
}

/// The measure, and whether it has a component; `None` for a kind that is not measured at Gauss points.
///
/// # Errors
/// A missing or unknown component, or a quantity that the cells do not have.
pub(super) fn measure(
    word: &Word<'_>,
    component: Option<&Located<String>>,
) -> Result<Option<(Measure, bool)>, InputError> {
    let bare = |measure| Ok(Some((measure, false)));
    let stress = |measure| Ok(Some((Measure::Stress(measure), false)));
    let with_component = |measure| Ok(Some((measure, true)));
    let (of_mesh, of_cell) = (word.is_mesh_in_space(), word.has_spheres());
    match word.kind {
        ProbeKind::MeanStress => {
            let (row, column) = word.pair(component, of_cell)?;
            with_component(Measure::Stress(StressMeasure::Component(row, column)))
        }
        ProbeKind::StressRatio => stress(StressMeasure::Ratio),
        ProbeKind::MeanPressure => stress(StressMeasure::Pressure(word.context.sets.mesh.dimension.count())),
        ProbeKind::Deviator => stress(StressMeasure::Deviator),
        ProbeKind::PrincipalStress => {
            let component = word.given(component, "major")?;
            let rank = word.rank(component.get_ref(), component)?;
            with_component(Measure::Stress(StressMeasure::Principal(rank, word.stress_axes())))
        }
        ProbeKind::PrincipalRatio => with_component(Measure::Stress(word.principal_ratio(component)?)),
        ProbeKind::SigmaBar => stress(StressMeasure::SigmaBar),
        ProbeKind::FrictionAngle => stress(StressMeasure::FrictionAngle(word.stress_axes())),
        ProbeKind::VonMisesStress if of_cell => stress(StressMeasure::VonMises),
        ProbeKind::VonMisesStress => Err(word
            .error(format!("'{}': cells of discs have no stress out of the plane", word.name))
            .hint("take \"deviator\" or \"principal_stress\", or a packing of spheres")),
        ProbeKind::VolumeChange => bare(Measure::VolumeChange),
        ProbeKind::LogVolumeStrain => bare(Measure::LogVolumeStrain),
        ProbeKind::VoidRatio => bare(Measure::VoidRatio),
        ProbeKind::Porosity => bare(Measure::Porosity),
        ProbeKind::CoordinationNumber => bare(Measure::Coordination),
        ProbeKind::CoordinationNumberNoRattlers => bare(Measure::CoordinationNoRattlers),
        ProbeKind::PorePressure => bare(Measure::PorePressure),
        ProbeKind::FabricAnisotropy => bare(Measure::FabricAnisotropy),
        ProbeKind::Fabric => {
            let (row, column) = word.pair(component, of_cell)?;
            with_component(Measure::Fabric(row, column))
        }
        ProbeKind::SlidingFraction => bare(Measure::SlidingFraction),
        ProbeKind::GrainRotation => with_component(Measure::GrainRotation(word.rotation_axis(component)?)),
        ProbeKind::DisplacementGradient => {
            let (row, column) = word.pair(component, of_mesh)?;
            with_component(Measure::DisplacementGradient(row, column))
        }
        ProbeKind::GreenLagrangeStrain => {
            let (row, column) = word.pair(component, of_mesh)?;
            with_component(Measure::Strain(row, column))
        }
        ProbeKind::ShearStrain => bare(Measure::ShearStrain(word.strain_axes())),
        ProbeKind::ShearStrainIncrement => bare(Measure::ShearStrainIncrement(word.strain_axes())),
        ProbeKind::DeviatoricStrain => bare(Measure::DeviatoricStrain),
        ProbeKind::DeviatoricStrainIncrement => bare(Measure::DeviatoricStrainIncrement),
        ProbeKind::EquivalentStrainIncrement => bare(Measure::EquivalentStrainIncrement),
        ProbeKind::ElasticEnergy => bare(Measure::ElasticEnergy),
        ProbeKind::FrictionalDissipation => bare(Measure::FrictionalDissipation),
        ProbeKind::DampingWork => bare(Measure::DampingWork),
        ProbeKind::Reaction
        | ProbeKind::Displacement
        | ProbeKind::Strain
        | ProbeKind::Compression
        | ProbeKind::HourglassEnergy
        | ProbeKind::Velocity
        | ProbeKind::Acceleration
        | ProbeKind::KineticEnergy
        | ProbeKind::EnergyResidual
        | ProbeKind::BandWidth
        | ProbeKind::BandInclination
        | ProbeKind::BandQuality => Ok(None),
    }
}

/// The measure of a kind that stands without a component.
///
/// # Errors
/// The kind needs one, or is not measured at Gauss points.
pub(super) fn bare_measure(word: &Word<'_>) -> Result<Measure, InputError> {
    match measure(word, None) {
        Ok(Some((measure, _))) => Ok(measure),
        Ok(None) => Err(word.not_at_points()),
        Err(_) => Err(word
            .error(format!("a band cannot be shown by \"{}\", which needs a component", word.kind.keyword()))
            .hint("take for example \"shear_strain\", \"shear_strain_increment\" or \"porosity\"")),
    }
}

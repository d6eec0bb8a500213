//! `[[probe]]` and `[[profile]]`.

use keys::Located;
use macro_solver::output::Statistic;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[[probe]]`: a column of the history.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ProbeTable {
    /// Name of the column. It holds no line feed or other control character.
    pub(crate) name: Located<String>,
    /// Quantity.
    pub(crate) kind: ProbeKind,
    /// Node set; of the kinds that name one.
    pub(crate) set: Option<Located<String>>,
    /// Node set with the smaller coordinate; of "strain" and "compression".
    pub(crate) from: Option<Located<String>>,
    /// Node set with the larger coordinate; of "strain" and "compression".
    pub(crate) to: Option<Located<String>>,
    /// Axis "x", "y" or "z"; of tensors two of them, such as "xy"; of principal stresses their rank, of band kinds the axes of the
    /// plane in which the band is a line.
    #[schemars(extend("x-default" = "of band kinds \"xy\""))]
    pub(crate) component: Option<Located<String>>,
    /// Where quantities of Gauss points are measured.
    #[schemars(extend("x-default" = "the whole body"))]
    pub(crate) part: Option<Located<PartTable>>,
    /// How the values at the Gauss points become one number; of kinds that are measured at Gauss points, energies excepted.
    #[schemars(extend("x-default" = "mean"))]
    pub(crate) statistic: Option<Located<Statistic>>,
    /// Name of the stage from whose start displacement, strain or change of volume is counted, over lengths and volumes of that
    /// state. The value is 0 until the stage begins.
    #[schemars(extend("x-default" = "the start of the run"))]
    pub(crate) reference: Option<Located<String>>,
    /// Kind that shows the band; of band kinds. It is one that is measured at Gauss points and needs no `component`.
    #[schemars(with = "Option<String>", extend("x-default" = "shear_strain"))]
    pub(crate) field: Option<Located<ProbeKind>>,
}

/// `[[profile]]`: a quantity along an axis, a file `profiles/NAME.csv`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ProfileTable {
    /// Name of the file: letters, digits, `-` and `_`.
    pub(crate) name: Located<String>,
    /// Quantity: a kind of `[[probe]]` that is measured at Gauss points.
    #[schemars(with = "String")]
    pub(crate) kind: Located<ProbeKind>,
    /// As in `[[probe]]`.
    pub(crate) component: Option<Located<String>>,
    /// Axis along which the bins follow each other: "x", "y" or "z".
    pub(crate) axis: Located<String>,
    /// Number of bins of equal thickness. A bin holds the Gauss points whose initial positions lie in it and moves with them; bins
    /// without any are left out.
    #[schemars(range(min = 1, max = 100_000))]
    pub(crate) bins: usize,
    /// Initial coordinate at which the first bin begins.
    #[schemars(extend("x-unit" = "m", "x-default" = "lowest of the mesh"))]
    pub(crate) from: Option<f64>,
    /// Initial coordinate at which the last bin ends.
    #[schemars(extend("x-unit" = "m", "x-default" = "highest of the mesh"))]
    pub(crate) to: Option<f64>,
    /// Every how many steps rows are written, in addition to the ends of stages.
    #[serde(default = "always")]
    #[schemars(range(min = 1))]
    pub(crate) every: u64,
    /// Gauss points that take part.
    #[schemars(extend("x-default" = "the whole body"))]
    pub(crate) part: Option<Located<PartTable>>,
    /// How the values at the Gauss points of a bin become one number.
    #[schemars(extend("x-default" = "mean"))]
    pub(crate) statistic: Option<Located<Statistic>>,
    /// As in `[[probe]]`.
    #[schemars(extend("x-default" = "the start of the run"))]
    pub(crate) reference: Option<Located<String>>,
}

fn always() -> u64 {
    1
}

/// A part of the body. Exactly one way to choose it is given.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PartTable {
    /// Element set.
    pub(crate) elements: Option<Located<String>>,
    /// Name of a `[[region]]`: the Gauss points that have its cells.
    pub(crate) region: Option<Located<String>>,
    /// Element, from 0.
    pub(crate) element: Option<Located<usize>>,
    /// Gauss point: with `element` one of that element, from 0, otherwise numbered through the mesh.
    pub(crate) point: Option<Located<usize>>,
    /// Lower corner of a box: the Gauss points whose initial positions lie in it.
    #[schemars(extend("x-unit" = "m"))]
    pub(crate) from: Option<Vec<f64>>,
    /// Upper corner of the box.
    #[schemars(extend("x-unit" = "m"))]
    pub(crate) to: Option<Vec<f64>>,
}

/// Quantities that a probe can measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ProbeKind {
    /// (`set`, `component`) Force of the support on the body, N, in the plane per m of thickness; 0 where none holds it, also on absorbing sides. Nodes at the end of a set also bear their
    /// share of the elements next to it.
    Reaction,
    /// (`set`, `component`, `reference`) Displacement of the set, mean over its nodes, each of which counts alike, m.
    Displacement,
    /// (`from`, `to`, `component`, `reference`) Change of the mean distance over the one at the reference; elongation positive.
    Strain,
    /// (as `strain`) Minus the strain: compression positive.
    Compression,
    /// (`reference`) Current over reference volume (in the plane: area), minus 1; dilation positive.
    VolumeChange,
    /// (`component`) Cauchy stress component, Pa, tension positive.
    MeanStress,
    /// `sigma_yy` over `sigma_xx`.
    StressRatio,
    /// Mean pressure, Pa, compression positive: `-(sigma_xx + sigma_yy) / 2` in the plane, `-(sigma_xx + sigma_yy + sigma_zz) / 3`
    /// in space.
    MeanPressure,
    /// `q = sigma_xx - sigma_yy`, Pa, positive in vertical compression.
    Deviator,
    /// Excess pressure of pore fluid that cannot drain, Pa, compression positive; 0 before its stage, see `[pore_fluid]`.
    PorePressure,
    /// Void ratio. The mean is that of the void ratios of the points; see "porosity".
    VoidRatio,
    /// Coordination number, rattlers included.
    CoordinationNumber,
    /// Elastic energy of the contacts, J, in the plane per m of thickness. Needs the observable "energy".
    ElasticEnergy,
    /// Work lost to friction, J, in the plane per m of thickness. Needs the observable "energy".
    FrictionalDissipation,
    /// Work that numerical damping of the grains has taken, J, in the plane per m of thickness. Needs the observable "energy".
    DampingWork,
    /// Energy of the hourglass control of elements with one Gauss point, J, in the plane per m of thickness.
    HourglassEnergy,
    /// (`set`, `component`) Mean velocity of the set, m/s; 0 in a quasi-static stage.
    Velocity,
    /// (`set`, `component`) Mean acceleration of the set, m/s2; 0 in a quasi-static stage.
    Acceleration,
    /// Kinetic energy of the body, J, in the plane per m of thickness; 0 in a quasi-static stage.
    KineticEnergy,
    /// Residual of the energy balance over the largest energy of the stage so far.
    EnergyResidual,
    /// Void volume over total volume.
    Porosity,
    /// Coordination number without rattlers and their contacts. Needs the observable "coordination_no_rattlers".
    CoordinationNumberNoRattlers,
    /// Major over minor principal value of the contact fabric, minus 1. Needs the observable "fabric".
    FabricAnisotropy,
    /// (`component`) Component of the contact fabric `1/C sum n x n`. Needs the observable "fabric".
    Fabric,
    /// Share of the contacts at the Coulomb limit. Needs the observable "sliding_fraction".
    SlidingFraction,
    /// (`component`) Mean rotation of the grains about an axis since the start of the run, rad. Needs the observable "rotation".
    GrainRotation,
    /// (`component`: "major", "intermediate" or "minor") Principal stress, Pa, tension positive; the major one has the largest
    /// compression. Cells of discs have the two of the plane, cells of spheres three.
    PrincipalStress,
    /// (`component`, such as "major/minor") Ratio of two principal stresses.
    PrincipalRatio,
    /// `|sigma_xx - sigma_yy| / |sigma_xx + sigma_yy|`, the measure of [Liu2018].
    SigmaBar,
    /// Mobilised friction angle, degrees: its sine is the difference of major and minor principal stress over their sum.
    FrictionAngle,
    /// `sqrt(3/2 s:s)` of the deviatoric stress in space, Pa; of cells of spheres.
    VonMisesStress,
    /// (`component`, `reference`) Component of `F - I`.
    DisplacementGradient,
    /// (`component`, `reference`) Component of the strain `(F^T F - I) / 2`.
    GreenLagrangeStrain,
    /// (`reference`) Largest minus smallest principal value of the Green-Lagrange strain, of the plane or in space.
    ShearStrain,
    /// The same of the increment since the last accepted step.
    ShearStrainIncrement,
    /// (`reference`) `sqrt(2/3 e:e)` of the deviator of the logarithmic strain, in the plane with no strain along z.
    DeviatoricStrain,
    /// The same of the increment since the last accepted step.
    DeviatoricStrainIncrement,
    /// (`reference`) Incremental equivalent strain of [Liu2018] Fig. 7: the L2 norm of the change of the components of `F - I` since
    /// the last accepted step. Unlike the other increments it grows with the rotation of the step.
    EquivalentStrainIncrement,
    /// (`reference`) Logarithm of current over reference volume; dilation positive.
    LogVolumeStrain,
    /// (`field`, `component`, `reference`) Full width of a shear band at half height, m: of a straight ridge of Gaussian section that
    /// is fitted to the field at the current positions. NaN where none fits.
    BandWidth,
    /// (as `band_width`) Angle of the band, degrees, above -90 and at most 90, from the x axis towards y.
    BandInclination,
    /// (as `band_width`) Share of the variance of the field that the band explains; below some 0.5 there is no single band.
    BandQuality,
}

protocol::keywords! {
    pub(crate) ProbeKind {
        Reaction => "reaction",
        Displacement => "displacement",
        Strain => "strain",
        Compression => "compression",
        VolumeChange => "volume_change",
        MeanStress => "mean_stress",
        StressRatio => "stress_ratio",
        MeanPressure => "mean_pressure",
        Deviator => "deviator",
        PorePressure => "pore_pressure",
        VoidRatio => "void_ratio",
        CoordinationNumber => "coordination_number",
        ElasticEnergy => "elastic_energy",
        FrictionalDissipation => "frictional_dissipation",
        DampingWork => "damping_work",
        HourglassEnergy => "hourglass_energy",
        Velocity => "velocity",
        Acceleration => "acceleration",
        KineticEnergy => "kinetic_energy",
        EnergyResidual => "energy_residual",
        Porosity => "porosity",
        CoordinationNumberNoRattlers => "coordination_number_no_rattlers",
        FabricAnisotropy => "fabric_anisotropy",
        Fabric => "fabric",
        SlidingFraction => "sliding_fraction",
        GrainRotation => "grain_rotation",
        PrincipalStress => "principal_stress",
        PrincipalRatio => "principal_ratio",
        SigmaBar => "sigma_bar",
        FrictionAngle => "friction_angle",
        VonMisesStress => "von_mises_stress",
        DisplacementGradient => "displacement_gradient",
        GreenLagrangeStrain => "green_lagrange_strain",
        ShearStrain => "shear_strain",
        ShearStrainIncrement => "shear_strain_increment",
        DeviatoricStrain => "deviatoric_strain",
        DeviatoricStrainIncrement => "deviatoric_strain_increment",
        EquivalentStrainIncrement => "equivalent_strain_increment",
        LogVolumeStrain => "log_volume_strain",
        BandWidth => "band_width",
        BandInclination => "band_inclination",
        BandQuality => "band_quality",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tables::RowMeasure;

    #[test]
    fn keywords_are_those_of_files() {
        for kind in ProbeKind::ALL {
            assert_eq!(serde_json::to_value(kind).unwrap(), kind.keyword());
        }
        for measure in RowMeasure::ALL {
            assert_eq!(serde_json::to_value(measure).unwrap(), measure.keyword());
        }
    }
}

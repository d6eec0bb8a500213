//! The keys of an ensemble study.

use keys::Located;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// An ensemble study: packings of several sizes and seeds, each along one or more strain or stress paths; of every quantity the mean,
/// the standard deviation and how it falls with the number of grains. `grainspan study` reads it. Paths are relative to the folder of
/// the file.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct StudyFile {
    /// Name of the study: letters, digits, `-` and `_`. The output folder is `out/study/NAME`, or `out/study/NAME-SIZE` with `--size`,
    /// unless `--out` names another.
    #[schemars(extend("x-default" = "name of the file"))]
    pub(crate) name: Option<Located<String>>,
    /// Number of packings of each recipe and size. Their seeds follow each other.
    #[schemars(range(min = 1, max = 100_000))]
    pub(crate) seeds: u32,
    /// Seed of the first packing.
    #[serde(default = "first")]
    #[schemars(range(max = 9_223_372_036_854_775_807_i64))]
    pub(crate) first_seed: u64,
    /// Sizes: numbers of grains, in ascending order.
    #[schemars(extend("x-default" = "that of each recipe"))]
    pub(crate) grains: Option<Located<Vec<usize>>>,
    /// Half the width of the range of axial strain over which dilatancy is averaged: a slope of smaller ranges is mostly noise.
    #[serde(default = "half_width")]
    #[schemars(range(max = 1), extend("x-unit" = "-", "exclusiveMinimum" = 0))]
    pub(crate) smoothing: f64,
    /// Recipes of packings.
    pub(crate) recipe: Located<Vec<RecipeEntry>>,
    /// Element tests whose paths every packing follows.
    pub(crate) test: Located<Vec<TestEntry>>,
    /// Quantities that are measured on every path.
    pub(crate) quantity: Located<Vec<QuantityEntry>>,
    /// Numbers that the study is compared with.
    #[serde(default)]
    pub(crate) expected: Vec<Located<ExpectedEntry>>,
}

/// `[[recipe]]` of a study.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RecipeEntry {
    /// Name in tables and pictures: letters, digits, `-` and `_`.
    pub(crate) name: Located<String>,
    /// Packing recipe; the study sets its `seed`, and its `number` if it names sizes.
    pub(crate) file: Located<PathBuf>,
    /// Keys of the recipe that are changed, each as for `--set`: `"contact.friction=0.5"`.
    #[serde(default)]
    pub(crate) set: Vec<String>,
}

/// `[[test]]` of a study.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TestEntry {
    /// Name in tables and pictures: letters, digits, `-` and `_`.
    pub(crate) name: Located<String>,
    /// Element test; its `packing` is not read.
    pub(crate) file: Located<PathBuf>,
    /// Keys of the test that are changed, each as for `--set`: `"path.0.increments=300"`.
    #[serde(default)]
    pub(crate) set: Vec<String>,
    /// What is called the strain of the path in `[[quantity]]`.
    #[serde(default)]
    pub(crate) strain: PathStrain,
}

/// The abscissa of a path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PathStrain {
    /// `1 - F_xx`, compression positive.
    CompressionX,
    /// `1 - F_yy`, compression positive.
    #[default]
    CompressionY,
    /// `1 - F_zz`, compression positive.
    CompressionZ,
    /// `F_xy`, the shear angle.
    ShearXy,
}

/// `[[quantity]]` of a study.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct QuantityEntry {
    /// Name in tables and pictures: letters, digits, `-` and `_`.
    pub(crate) name: Located<String>,
    /// What is measured in every row of a path.
    pub(crate) measure: RowMeasure,
    /// How the rows become one number.
    pub(crate) take: Take,
    /// Strain of `take = "at"`; between two rows the value is interpolated.
    #[schemars(extend("x-unit" = "-"))]
    pub(crate) at: Option<Located<f64>>,
    /// Rows below this strain are left out; not with `at`.
    #[schemars(extend("x-unit" = "-", "x-default" = "the start of the path"))]
    pub(crate) from: Option<Located<f64>>,
    /// Rows above this strain are left out; not with `at`. A path that stops before it gives no value.
    #[schemars(extend("x-unit" = "-", "x-default" = "the end of the path"))]
    pub(crate) to: Option<Located<f64>>,
}

/// What is measured in a row of an element test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RowMeasure {
    /// Largest over smallest principal compression; in the plane for discs.
    StressRatio,
    /// Difference of these two over their sum: the sine of the mobilised friction angle.
    MobilisedSine,
    /// Minus the mean normal stress, Pa, compression positive.
    MeanPressure,
    /// Void volume over grain volume.
    VoidRatio,
    /// 2 x contacts over grains.
    CoordinationNumber,
    /// The same without rattlers.
    CoordinationNumberNoRattlers,
    /// Major over minor principal value of the contact fabric, minus 1.
    FabricAnisotropy,
    /// Share of contacts that slide.
    SlidingFraction,
    /// Change of volume over the volume at the start, expansion positive.
    VolumeStrain,
    /// `D = 1 + d(volume strain) / d(axial compression)`, logarithmic strains, expansion positive: in plane strain `-d(eps_3) / d(eps_1)`, above 1 where the
    /// grains dilate. Of paths whose `strain` is a compression.
    Dilatancy,
    /// The stress ratio over `D`, both averaged over the same range of strain: Rowe's `K = tan^2(45 + phi_f / 2)`. Its mean over rows is
    /// the mean stress ratio over the mean of `D`.
    StressOverDilatancy,
}

protocol::keywords! {
    pub RowMeasure {
        StressRatio => "stress_ratio",
        MobilisedSine => "mobilised_sine",
        MeanPressure => "mean_pressure",
        VoidRatio => "void_ratio",
        CoordinationNumber => "coordination_number",
        CoordinationNumberNoRattlers => "coordination_number_no_rattlers",
        FabricAnisotropy => "fabric_anisotropy",
        SlidingFraction => "sliding_fraction",
        VolumeStrain => "volume_strain",
        Dilatancy => "dilatancy",
        StressOverDilatancy => "stress_over_dilatancy",
    }
}

impl RowMeasure {
    /// Unit; `-` without one.
    pub fn unit(self) -> &'static str {
        match self {
            Self::MeanPressure => "Pa",
            Self::StressRatio
            | Self::MobilisedSine
            | Self::VoidRatio
            | Self::CoordinationNumber
            | Self::CoordinationNumberNoRattlers
            | Self::FabricAnisotropy
            | Self::SlidingFraction
            | Self::VolumeStrain
            | Self::Dilatancy
            | Self::StressOverDilatancy => "-",
        }
    }

    /// Whether it is a slope over the axial compression.
    pub fn needs_compression(self) -> bool {
        matches!(self, Self::Dilatancy | Self::StressOverDilatancy)
    }
}

/// How the rows of a path become one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Take {
    /// The largest value between `from` and `to`.
    Largest,
    /// The smallest value between `from` and `to`.
    Smallest,
    /// The strain of the row with the largest value between `from` and `to`: that of a peak.
    StrainOfLargest,
    /// The mean of the rows between `from` and `to`.
    Mean,
    /// The value where the path first has the strain `at`.
    At,
}

/// `[[expected]]` of a study: a number of the study, and what it is compared with.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ExpectedEntry {
    /// Entry of the verification catalogue that the comparison belongs to, such as "D-1".
    pub(crate) entry: Option<String>,
    /// Quantity.
    pub(crate) quantity: Located<String>,
    /// Which number of its ensemble.
    #[serde(default)]
    pub(crate) statistic: EnsembleStatistic,
    /// Recipe.
    #[schemars(extend("x-default" = "the only one"))]
    pub(crate) recipe: Option<Located<String>>,
    /// Test.
    #[schemars(extend("x-default" = "the only one"))]
    pub(crate) test: Option<Located<String>>,
    /// Number of grains; not of `statistic = "power"`.
    #[schemars(extend("x-default" = "the largest size"))]
    pub(crate) grains: Option<Located<usize>>,
    /// The number that is expected. One of `value`, `between` and `like` at most; without any our number is reported.
    #[schemars(extend("x-unit" = "of the quantity"))]
    pub(crate) value: Option<f64>,
    /// Two numbers; anything between them is expected.
    #[schemars(extend("x-unit" = "of the quantity"))]
    pub(crate) between: Option<[f64; 2]>,
    /// Another ensemble of the same size, whose value of `statistic` is expected.
    pub(crate) like: Option<Located<LikeTable>>,
    /// Largest difference that counts as agreement.
    #[schemars(range(min = 0), extend("x-unit" = "of the quantity", "x-default" = "of a power half its interval of 95 % confidence, with `between` 0, else none"))]
    pub(crate) tolerance: Option<f64>,
    /// Whether `tolerance` is a share of the expected number.
    #[serde(default)]
    pub(crate) relative: bool,
    /// Where the expected number comes from.
    #[serde(default)]
    pub(crate) source: String,
}

/// `like` of `[[expected]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct LikeTable {
    /// Recipe.
    #[schemars(extend("x-default" = "the same"))]
    pub(crate) recipe: Option<Located<String>>,
    /// Test.
    #[schemars(extend("x-default" = "the same"))]
    pub(crate) test: Option<Located<String>>,
    /// Quantity.
    #[schemars(extend("x-default" = "the same"))]
    pub(crate) quantity: Option<Located<String>>,
}

/// A number of an ensemble.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EnsembleStatistic {
    /// The mean.
    #[default]
    Mean,
    /// The standard deviation of a sample.
    Deviation,
    /// The largest sample.
    Largest,
    /// The smallest sample.
    Smallest,
    /// The power of the number of grains with which the standard deviation goes, fitted over all sizes: -0.5 for independent grains.
    Power,
}

fn first() -> u64 {
    1
}

fn half_width() -> f64 {
    0.005
}

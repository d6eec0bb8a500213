//! Options of the studies of random cases on the command line.

use rve_server::definition::Damping;
use std::path::PathBuf;

/// Arguments that only `bench stability` reads, and of which `bench shortcuts` reads the seed, the number of cases and the scene.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Options of stability")]
pub(crate) struct Options {
    /// Cases of one cell; every fifth is one of spheres [default: 2500, with --quick 24]; scenes of `shortcuts` [default: 40, with --quick 2]
    #[arg(long, value_name = "N")]
    pub(crate) cases: Option<u64>,
    /// Small scenes of finite elements [default: 12, with --quick 2, with filters or --set 0]
    #[arg(long, value_name = "N")]
    pub(crate) small: Option<u64>,
    /// Seed of the campaign: cases and packings depend on it and their number alone [default: 1]
    #[arg(long, value_name = "S")]
    pub(crate) seed: Option<u64>,
    /// Only cases of discs (2) or of spheres (3)
    #[arg(long, value_name = "2|3", value_parser = clap::value_parser!(u32).range(2..=3))]
    pub(crate) dimension: Option<u32>,
    /// Only packings of at most this many grains
    #[arg(long, value_name = "GRAINS")]
    pub(crate) largest: Option<usize>,
    /// Override a key of every case of one cell, as in `grainspan element`
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub(crate) overrides: Vec<String>,
    /// Run every case with each of these dampings and compare: fire,viscous,adaptive,local,kinetic
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) dampings: Vec<Damping>,
    /// Run this case alone, and print its increments
    #[arg(long, value_name = "K")]
    pub(crate) case: Option<u64>,
    /// Write the case as an element test, its packing next to it, instead of running it
    #[arg(long, value_name = "FILE.toml", requires = "case")]
    pub(crate) write: Option<PathBuf>,
    /// Run this small scene alone, and print its steps and those of the finer runs
    #[arg(long, value_name = "K", conflicts_with_all = ["case", "small", "cases"])]
    pub(crate) scene: Option<u64>,
    /// Give cases of many cycles 10 000 of them
    #[arg(long)]
    pub(crate) long_cycles: bool,
    /// Compare no case with a finer run
    #[arg(long)]
    pub(crate) unchecked: bool,
}

impl Options {
    /// Whose options are given besides the seed, the number of cases and the scene; `None` if none are.
    pub(crate) fn other_than_seed_and_scenes(&self) -> Option<&'static str> {
        let others = Self { seed: None, cases: None, scene: None, ..self.clone() };
        (!others.is_plain()).then_some("`bench stability` alone")
    }

    /// Whether none is given.
    pub(crate) fn is_plain(&self) -> bool {
        let Self {
            cases,
            small,
            seed,
            dimension,
            largest,
            overrides,
            dampings,
            case,
            write,
            scene,
            long_cycles,
            unchecked,
        } = self;
        cases.is_none()
            && small.is_none()
            && seed.is_none()
            && dimension.is_none()
            && largest.is_none()
            && overrides.is_empty()
            && dampings.is_empty()
            && case.is_none()
            && write.is_none()
            && scene.is_none()
            && !long_cycles
            && !unchecked
    }
}

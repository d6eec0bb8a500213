//! The command line of `grainspan run`.

use protocol::transport::shared_memory::Waiting;
use std::path::PathBuf;

/// Arguments of `grainspan run`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:
  grainspan run scenes/biaxial-small.toml
  grainspan run scenes/biaxial.toml --workers 2 --out out/fine \\
      --set rve.accuracy=tight
  grainspan run scenes/biaxial.toml --set loading.increments=80 \\
      --set boundary.2.displacement.y=-1e-3

  grainspan run scenes/biaxial.toml --resume

Ctrl-C ends a run in good order: everything up to the last accepted step is written, and --resume continues it.")]
pub(crate) struct Arguments {
    /// Scene file
    #[arg(value_name = "SCENE.toml")]
    pub(super) scene: PathBuf,
    /// Worker processes of each engine on this host [default: one per core; with --attach: 1]; 0 with --listen
    #[arg(long, value_name = "N", value_parser = worker_count)]
    pub(super) workers: Option<usize>,
    /// Start no workers: wait for N that join the run of this name with `grainspan rve-server --run RUN`
    #[arg(long, value_name = "RUN")]
    pub(super) attach: Option<String>,
    /// Let agents of other hosts join at this endpoint (`grainspan agent`); port 0 takes a free one. The file `join` in the
    /// output folder tells agents how. For programs built with `--features hosts`
    #[arg(long, value_name = "ADDRESS:PORT", conflicts_with = "attach")]
    pub(super) listen: Option<String>,
    /// Address of this host in the file `join`; several for several networks [default: that of --listen, or this host's name]
    #[arg(long, value_name = "ADDRESS[:PORT]", requires = "listen")]
    pub(super) advertise: Vec<String>,
    /// Secret that agents must know too, in a file that only you may read [default: drawn for this run]
    #[arg(long, value_name = "FILE", requires = "listen")]
    pub(super) secret: Option<PathBuf>,
    /// Time without any sign of life of another host after which its work goes to others
    #[arg(long, value_name = "SECONDS", requires = "listen", default_value_t = 10.0, value_parser = crate::cli::seconds::seconds)]
    pub(super) silence: f64,
    /// Engine that solves the points in place of the scene's own choice; see docs/guide/external-engines.md
    #[arg(long, value_name = "NAME")]
    pub(super) engine: Option<String>,
    /// How macro and workers wait for messages: `hybrid` and `spin` trade CPU time for latency
    /// [default: pool.wait of the scene, else `block`]
    #[arg(long, value_enum)]
    pub(super) wait: Option<Wait>,
    /// Output folder [default: out/NAME OF THE SCENE]
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Continue the run in the output folder from its last checkpoint; from the start if there is none yet
    #[arg(long)]
    pub(super) resume: bool,
    /// One of the sizes that the file names in `[sizes]` [default: the file as it stands]
    #[arg(long, value_name = "NAME")]
    pub(super) size: Option<String>,
    /// Override a key of the scene; entries of [[lists]] are numbered from 0
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub(super) overrides: Vec<String>,
    /// Print nothing but errors
    #[arg(long)]
    pub(super) quiet: bool,
}

/// [`Waiting`] as the command line names it.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
pub(super) enum Wait {
    /// Block until the kernel reports a message
    Block,
    /// Poll for 50 us, then block, if a core is free
    Hybrid,
    /// Poll all the time
    Spin,
}

impl From<Wait> for Waiting {
    fn from(wait: Wait) -> Self {
        match wait {
            Wait::Block => Self::Block,
            Wait::Hybrid => Self::Hybrid,
            Wait::Spin => Self::Spin,
        }
    }
}

fn worker_count(text: &str) -> Result<usize, String> {
    text.parse().map_err(|_| "not a number of workers".to_owned())
}

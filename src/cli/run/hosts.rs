//! `--listen`: the listener through which agents of other hosts join a run.

#[cfg(feature = "hosts")]
pub(super) use with::{Listening, check, listen, open};
#[cfg(not(feature = "hosts"))]
pub(super) use without::{Listening, check, listen, open};

#[cfg(feature = "hosts")]
mod with {
    use crate::cli::run::arguments::Arguments;
    use crate::exit::{Exit, Failure};
    use crate::stderr::tell;
    use hosts::{Figures, JoinFile, JoinedPort, Limits, ListenerOptions, NetworkMacroPort, Secret, this_program};
    use protocol::transport::shared_memory::SharedMemoryMacroPort;
    use std::collections::BTreeMap;
    use std::path::Path;
    use std::time::Duration;

    /// Name of the file, in the output folder, that tells agents how to join.
    const JOIN_FILE: &str = "join";

    /// What remains of the listener besides the port.
    pub(in crate::cli::run) struct AgentAccess {
        figures: Option<Figures>,
        _join_file: Option<JoinFile>,
    }

    impl AgentAccess {
        /// Whether agents may join.
        pub(in crate::cli::run) fn is_listening(&self) -> bool {
            self.figures.is_some()
        }

        /// What happened between hosts, by name.
        pub(in crate::cli::run) fn figures(&self) -> BTreeMap<String, u64> {
            let Some(figures) = &self.figures else { return BTreeMap::new() };
            let value = serde_json::to_value(figures.now());
            value.and_then(serde_json::from_value).expect("all of them are whole numbers with a name")
        }
    }

    /// What can be known to be wrong before anything is opened.
    ///
    /// # Errors
    /// The secret cannot be read.
    pub(in crate::cli::run) fn check(arguments: &Arguments) -> Result<(), Failure> {
        let secret = arguments.secret.as_ref().filter(|_| arguments.listen.is_some());
        secret
            .map_or(Ok(()), |path| Secret::read(path).map(drop))
            .map_err(|error| Failure::new(Exit::BadInput, error))
    }

    /// The endpoint at which agents may join, and what proves that they may; none if the run does not listen.
    pub(in crate::cli::run) struct Listening(Option<(NetworkMacroPort, Secret)>);

    /// Opens the endpoint.
    ///
    /// # Errors
    /// It is taken, or the secret cannot be used.
    pub(in crate::cli::run) fn listen(arguments: &Arguments, run: &str) -> Result<Listening, Failure> {
        let Some(endpoint) = &arguments.listen else { return Ok(Listening(None)) };
        let bad = |error: &dyn std::fmt::Display| Failure::new(Exit::BadInput, error);
        let secret = match &arguments.secret {
            Some(path) => Secret::read(path),
            None => Secret::draw(),
        };
        let secret = secret.map_err(|error| bad(&error))?;
        let limits = Limits { silence: Duration::from_secs_f64(arguments.silence), ..Limits::default() };
        let options = ListenerOptions {
            run: run.to_owned(),
            secret: secret.clone(),
            limits,
            program: this_program().to_owned(),
        };
        let port = NetworkMacroPort::listen(endpoint, options).map_err(|error| bad(&error))?;
        Ok(Listening(Some((port, secret))))
    }

    /// The port of the run: the workers of this host, and those of others if it listens.
    ///
    /// # Errors
    /// The file that tells agents how to join cannot be written.
    pub(in crate::cli::run) fn open(
        local: SharedMemoryMacroPort,
        listening: Listening,
        arguments: &Arguments,
        folder: &Path,
    ) -> Result<(JoinedPort<SharedMemoryMacroPort>, AgentAccess), Failure> {
        let Some((port, secret)) = listening.0 else {
            return Ok((JoinedPort::new(local, None), AgentAccess { figures: None, _join_file: None }));
        };
        let address = port.address();
        let path = folder.join(JOIN_FILE);
        let join_file = JoinFile::write(&path, address, &arguments.advertise, &secret)
            .map_err(|error| Failure::new(Exit::BadInput, error))?;
        if !arguments.quiet {
            tell(format_args!("listening at {address}; on other hosts: grainspan agent --join {}", path.display()));
        }
        tracing::info!(%address, "listening for agents");
        let figures = Some(port.figures());
        Ok((JoinedPort::new(local, Some(port)), AgentAccess { figures, _join_file: Some(join_file) }))
    }
}

#[cfg(not(feature = "hosts"))]
mod without {
    use crate::cli::run::arguments::Arguments;
    use crate::exit::{Exit, Failure};
    use protocol::transport::shared_memory::SharedMemoryMacroPort;
    use std::collections::BTreeMap;
    use std::path::Path;

    /// There is none.
    pub(in crate::cli::run) struct AgentAccess;

    impl AgentAccess {
        /// Never: no one can join from elsewhere.
        pub(in crate::cli::run) fn is_listening(&self) -> bool {
            false
        }

        /// Nothing.
        pub(in crate::cli::run) fn figures(&self) -> BTreeMap<String, u64> {
            BTreeMap::new()
        }
    }

    /// No endpoint.
    pub(in crate::cli::run) struct Listening;

    /// Nothing: no one can join from elsewhere.
    ///
    /// # Errors
    /// Those of [`check`].
    pub(in crate::cli::run) fn listen(arguments: &Arguments, _: &str) -> Result<Listening, Failure> {
        check(arguments).map(|()| Listening)
    }

    /// The port to the workers of this host.
    ///
    /// # Errors
    /// None; there are some where hosts can join.
    pub(in crate::cli::run) fn open(
        local: SharedMemoryMacroPort,
        _: Listening,
        _: &Arguments,
        _: &Path,
    ) -> Result<(SharedMemoryMacroPort, AgentAccess), Failure> {
        Ok((local, AgentAccess))
    }

    /// What this build cannot do.
    ///
    /// # Errors
    /// The run is to listen for others.
    pub(in crate::cli::run) fn check(arguments: &Arguments) -> Result<(), Failure> {
        match (&arguments.listen, &arguments.secret) {
            // Nothing listens whose connections could fall silent: that limit needs no look.
            (None, None) if arguments.advertise.is_empty() => {
                let _ = arguments.silence;
                Ok(())
            }
            _ => Err(Failure::new(Exit::BadInput, crate::cli::agent::WITHOUT_HOSTS)),
        }
    }
}

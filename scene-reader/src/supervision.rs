//! `[pool]`: how the workers of a run are led. It changes no result.

use super::document::Document;
use super::input_error::InputError;
use super::tables::{PoolRunKeys, PoolTable};
use keys::Given;
use macro_solver::pool::PoolSettings;
use protocol::transport::shared_memory::Waiting;
use std::num::NonZeroUsize;

/// Most trials per message unless the scene says otherwise: enough for several rounds through the SIMD lanes of a worker, so that a
/// lane that is done early finds more to do. When fewer wait than all workers could take, each gets its share of them.
pub const JOBS_A_MESSAGE: NonZeroUsize = NonZeroUsize::new(64).unwrap();

/// How the workers of a run are led; what is left out takes the default of the pool.
#[derive(Clone, Debug)]
pub struct PoolPlan {
    given: Given<PoolTable>,
    /// Whether a worker solves trials side by side in SIMD lanes.
    pub lanes: bool,
    /// Whether equal trials of one evaluation are solved once.
    pub shares_duplicates: bool,
    /// How macro solver and workers wait for messages.
    pub wait: Option<Waiting>,
    /// Most workers that `--workers` may ask for, where the scene says so.
    pub most_workers: Option<usize>,
    /// Fruitless replacements in a row before a run gives up.
    pub restarts: Option<u32>,
}

impl PoolPlan {
    pub(super) fn new(given: &Given<PoolTable>, keys: &PoolRunKeys, shares_duplicates: bool) -> Self {
        let PoolRunKeys { lanes, wait, most_workers, restarts, .. } = *keys;
        Self { given: given.clone(), lanes, shares_duplicates, wait, most_workers, restarts }
    }

    /// The settings with the written keys in place of their own.
    ///
    /// # Errors
    /// A value that does not fit, which the check of the document excludes.
    pub fn apply(&self, document: &Document, settings: &PoolSettings) -> Result<PoolSettings, InputError> {
        let base = PoolSettings { jobs_per_message: JOBS_A_MESSAGE, ..settings.clone() };
        let settings: PoolSettings = self.given.over(&base).map_err(|fault| document.fault(&fault))?;
        let settings = PoolSettings { deduplicate: settings.deduplicate && self.shares_duplicates, ..settings };
        Ok(if self.lanes { settings } else { PoolSettings { jobs_per_message: NonZeroUsize::MIN, ..settings } })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The settings of a pool after the keys of a scene.
    fn settings(more: &[&str]) -> Result<PoolSettings, String> {
        let scene = crate::weak_element(more)?;
        scene.pool.apply(&scene.document, &PoolSettings::new("test")).map_err(|error| error.to_string())
    }

    /// What no key names passes through.
    #[test]
    fn versions_of_engines_stay_as_the_caller_gives_them() {
        let scene = crate::weak_element(&["pool.window=3"]).unwrap();
        let given = PoolSettings { versions: vec![("one".into(), "1+a".into())], ..PoolSettings::new("test") };
        let found = scene.pool.apply(&scene.document, &given).unwrap();
        assert_eq!((found.window.get(), found.versions), (3, given.versions));
    }

    #[test]
    fn trials_per_message_and_messages_per_worker_are_read() {
        let sizes =
            |more: &[&str]| settings(more).map(|settings| [settings.jobs_per_message.get(), settings.window.get()]);
        let window = PoolSettings::new("test").window.get();
        assert_eq!(sizes(&[]), Ok([JOBS_A_MESSAGE.get(), window]));
        assert_eq!(sizes(&["pool.jobs_per_message=5", "pool.window=7"]), Ok([5, 7]));
        assert_eq!(sizes(&["pool.jobs_per_message=4096"]), Ok([4096, window]));
        assert_eq!(sizes(&["pool.lanes=true", "pool.jobs_per_message=5"]), Ok([5, window]));
        assert_eq!(sizes(&["pool.lanes=false"]), Ok([1, window]));
        assert_eq!(
            sizes(&["pool.lanes=false", "pool.jobs_per_message=5"]),
            Ok([1, window]),
            "whatever jobs_per_message says"
        );
    }

    #[test]
    fn defects_of_the_pool_name_their_key() {
        for (defect, said) in [
            ("pool.jobs_per_message=0", "at most 4096"),
            ("pool.jobs_per_message=4097", "at most 4096, not 4097"),
            ("pool.jobs_per_message=-1", "pool.jobs_per_message"),
            ("pool.jobs_per_message=2.5", "pool.jobs_per_message"),
            ("pool.window=0", "at most 4096"),
            ("pool.window=many", "pool.window"),
            ("pool.lanes=8", "pool.lanes"),
            ("pool.lane=true", "lane"),
            ("pool.wait=sleep", "\"hybrid\""),
            ("pool.hang_factor=0.5", "at least 1"),
            ("pool.quarantine_after=0", "at least 1"),
            ("pool.worker_timeout=-1", "at least 0"),
        ] {
            let refused = settings(&[defect]).err().unwrap_or_else(|| panic!("{defect} was accepted"));
            assert!(refused.contains(said), "{defect}: {refused}");
        }
        // A number that is out of range is refused even where it is not used.
        assert!(settings(&["pool.lanes=false", "pool.jobs_per_message=0"]).is_err());
    }
}

//! The keys that supervise a run and change no result: `[checkpoint]` and `[pool]`.

use super::document::Document;
use super::input_error::InputError;
use super::schema::{CheckpointTable, PoolTable};
use macro_solver::checkpoint::CheckpointPolicy;
use macro_solver::pool::{PoolSettings, Recycling};
use protocol::transport::shared_memory::Waiting;
use std::num::NonZeroUsize;
use std::time::Duration;
use toml::Spanned;

/// Longest time that makes sense, s: a month.
const LONGEST: f64 = 31.0 * 86_400.0;

/// Most trials per message unless the scene says otherwise: enough for several rounds through the lanes of a worker, so that a
/// lane that is done early finds more to do. When fewer wait than all workers could take, each gets its share of them.
pub const JOBS_A_MESSAGE: NonZeroUsize = NonZeroUsize::new(64).unwrap();

/// Most trials per message, and messages, that make sense.
const MOST: usize = 4096;

/// How the workers of a run are led; what is left out takes the pool's default.
#[derive(Clone, Debug, Default)]
pub struct PoolKeys {
    hang_floor: Option<Duration>,
    hang_factor: Option<f64>,
    hang_unknown: Option<Duration>,
    stopped_limit: Option<Duration>,
    patience: Option<Duration>,
    quarantine_after: Option<u32>,
    slice: Option<NonZeroUsize>,
    window: Option<NonZeroUsize>,
    recycling: Recycling,
    /// How macro and workers wait for messages.
    pub wait: Option<Waiting>,
    /// Most workers that `--workers` may ask for, where the scene says so.
    pub most_workers: Option<usize>,
    /// Fruitless replacements in a row before a run gives up.
    pub restarts: Option<u32>,
}

impl PoolKeys {
    /// Reads the table.
    ///
    /// # Errors
    /// A number out of range, with its place.
    pub(super) fn read(document: &Document, table: &PoolTable) -> Result<Self, InputError> {
        let seconds = |given: &Option<Spanned<f64>>| seconds(document, given);
        if let Some(factor) = &table.hang_factor
            && *factor.get_ref() < 1.0
        {
            return Err(document
                .error_at(factor.span(), "a worker needs at least the time that it is expected to need")
                .hint("give a factor of 1 or more"));
        }
        if let Some(after) = &table.quarantine_after
            && *after.get_ref() == 0
        {
            return Err(document
                .error_at(after.span(), "a job that has ended no worker cannot be held to be deadly")
                .hint("give the number of workers that one job may end, at least 1"));
        }
        let slice = count(document, &table.slice)?;
        Ok(Self {
            slice: if table.lanes == Some(false) { Some(NonZeroUsize::MIN) } else { slice },
            window: count(document, &table.window)?,
            recycling: Recycling { jobs: table.recycle_jobs, memory: table.recycle_memory },
            most_workers: most_workers(document, &table.most_workers)?,
            wait: waiting(document, &table.wait)?,
            hang_floor: seconds(&table.hang_floor)?,
            hang_factor: table.hang_factor.as_ref().map(|factor| *factor.get_ref()),
            hang_unknown: seconds(&table.hang_unknown)?,
            stopped_limit: seconds(&table.stopped_limit)?,
            patience: seconds(&table.patience)?,
            quarantine_after: table.quarantine_after.as_ref().map(|after| *after.get_ref()),
            restarts: table.restarts.as_ref().map(|restarts| *restarts.get_ref()),
        })
    }

    /// Replaces what is given.
    pub fn apply(&self, settings: &mut PoolSettings) {
        settings.slice = self.slice.unwrap_or(JOBS_A_MESSAGE);
        replace(&mut settings.window, self.window);
        settings.recycling = self.recycling;
        replace(&mut settings.hang.floor, self.hang_floor);
        replace(&mut settings.hang.factor, self.hang_factor);
        replace(&mut settings.hang.unknown, self.hang_unknown);
        replace(&mut settings.hang.stopped, self.stopped_limit);
        replace(&mut settings.patience, self.patience);
        replace(&mut settings.blames_until_quarantine, self.quarantine_after);
    }
}

/// When checkpoints are written.
///
/// # Errors
/// A number out of range, with its place.
pub(super) fn checkpoint_policy(
    document: &Document,
    table: &CheckpointTable,
) -> Result<CheckpointPolicy, InputError> {
    let mut policy = CheckpointPolicy::default();
    replace(&mut policy.enabled, table.enabled);
    replace(&mut policy.pause, seconds(document, &table.seconds)?);
    if let Some(steps) = &table.steps {
        if *steps.get_ref() == 0 {
            return Err(document
                .error_at(steps.span(), "a checkpoint after every 0 steps is not possible")
                .hint("give 1 or more, or checkpoint.enabled = false for none"));
        }
        policy.steps = Some(*steps.get_ref());
    }
    Ok(policy)
}

fn waiting(document: &Document, given: &Option<Spanned<String>>) -> Result<Option<Waiting>, InputError> {
    let Some(given) = given else { return Ok(None) };
    let found = Waiting::ALL.into_iter().find(|waiting| waiting.keyword() == given.get_ref());
    let keywords = Waiting::ALL.map(Waiting::keyword).join("\", \"");
    found.map(Some).ok_or_else(|| {
        document
            .error_at(given.span(), format!("\"{}\" is no way to wait", given.get_ref()))
            .hint(format!("one of \"{keywords}\""))
    })
}

fn count(document: &Document, given: &Option<Spanned<usize>>) -> Result<Option<NonZeroUsize>, InputError> {
    let Some(given) = given else { return Ok(None) };
    match NonZeroUsize::new(*given.get_ref()).filter(|number| number.get() <= MOST) {
        Some(number) => Ok(Some(number)),
        None => Err(document
            .error_at(given.span(), format!("{} is not a usable number", given.get_ref()))
            .hint(format!("give a number from 1 to {MOST}"))),
    }
}

fn most_workers(document: &Document, given: &Option<Spanned<usize>>) -> Result<Option<usize>, InputError> {
    match given {
        Some(given) if *given.get_ref() == 0 => Err(document
            .error_at(given.span(), "a run needs at least one worker")
            .hint("give the most workers that --workers may ask for, or leave the key out")),
        given => Ok(given.as_ref().map(|given| *given.get_ref())),
    }
}

fn replace<T>(target: &mut T, given: Option<T>) {
    if let Some(given) = given {
        *target = given;
    }
}

fn seconds(document: &Document, given: &Option<Spanned<f64>>) -> Result<Option<Duration>, InputError> {
    let Some(given) = given else { return Ok(None) };
    let value = *given.get_ref();
    if (0.0..=LONGEST).contains(&value) {
        return Ok(Some(Duration::from_secs_f64(value)));
    }
    Err(document
        .error_at(given.span(), format!("{value} s is not a usable time"))
        .hint(format!("give a time from 0 to {LONGEST} s")))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The settings of a pool after the keys of a scene.
    fn settings(more: &[&str]) -> Result<PoolSettings, String> {
        let scene = crate::weak_element(more)?;
        let mut settings = PoolSettings::new("test");
        scene.pool.apply(&mut settings);
        Ok(settings)
    }

    #[test]
    fn trials_per_message_and_messages_per_worker_are_read() {
        let sizes = |more: &[&str]| settings(more).map(|settings| [settings.slice.get(), settings.window.get()]);
        let window = PoolSettings::new("test").window.get();
        assert_eq!(sizes(&[]), Ok([JOBS_A_MESSAGE.get(), window]));
        assert_eq!(sizes(&["pool.slice=5", "pool.window=7"]), Ok([5, 7]));
        assert_eq!(sizes(&["pool.slice=4096"]), Ok([4096, window]));
        assert_eq!(sizes(&["pool.lanes=true", "pool.slice=5"]), Ok([5, window]));
        assert_eq!(sizes(&["pool.lanes=false"]), Ok([1, window]));
        assert_eq!(sizes(&["pool.lanes=false", "pool.slice=5"]), Ok([1, window]), "whatever slice says");
    }

    #[test]
    fn defects_of_the_pool_name_their_key() {
        for (defect, said) in [
            ("pool.slice=0", "a number from 1 to 4096"),
            ("pool.slice=4097", "4097 is not a usable number"),
            ("pool.slice=-1", "pool.slice"),
            ("pool.slice=2.5", "pool.slice"),
            ("pool.window=0", "a number from 1 to 4096"),
            ("pool.window=many", "pool.window"),
            ("pool.lanes=8", "pool.lanes"),
            ("pool.lane=true", "lane"),
            ("pool.wait=sleep", "\"hybrid\""),
            ("pool.hang_factor=0.5", "1 or more"),
            ("pool.quarantine_after=0", "at least 1"),
            ("pool.patience=-1", "is not a usable time"),
        ] {
            let refused = settings(&[defect]).err().unwrap_or_else(|| panic!("{defect} was accepted"));
            assert!(refused.contains(said), "{defect}: {refused}");
        }
        // A slice that cannot be is refused even where it is not used.
        assert!(settings(&["pool.lanes=false", "pool.slice=0"]).is_err());
    }
}

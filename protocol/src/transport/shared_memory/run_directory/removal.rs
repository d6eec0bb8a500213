//! The removal of dead runs by name, while others may begin runs of the same name.

use super::record::RunListing;
use super::segments::sweep;
use super::{BIRTH, fresh_number, look_at};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::SystemTime;

/// First letters of a folder that is being removed: no run can have such a name.
const ASIDE: &str = ".dead-";

/// Removes what a run left that was found dead; false if another run has its name by now, which is left alone.
///
/// Between the look at the run and its removal, another process may remove it too and begin a run of the same name. So the folder first
/// gets a name that only this call knows, and is looked at again.
pub(super) fn remove_dead(base: &Path, dead: &RunListing) -> bool {
    let aside = format!("{ASIDE}{:016x}", fresh_number());
    let (place, moved) = (base.join(&dead.name), base.join(&aside));
    if fs::rename(&place, &moved).is_err() {
        // Others have removed it.
        return true;
    }
    let found = look_at(base, &aside);
    if is_same(dead, &found) {
        sweep(&moved, prefix(dead));
        return true;
    }
    if fs::rename(&moved, &place).is_err() {
        // What was moved had only just begun, and begins again at its place.
        sweep(&moved, prefix(&found));
    }
    false
}

fn prefix(run: &RunListing) -> Option<&str> {
    run.record.as_ref().map(|record| record.prefix.as_str())
}

/// Whether a folder is that of the run that was found dead. Of two folders without a record the young one is about to get one.
fn is_same(dead: &RunListing, found: &RunListing) -> bool {
    prefix(dead) == prefix(found) && (found.record.is_some() || !found.alive)
}

/// Ends removals that did not come to their end: dead runs go, and one that lives gets its name back.
pub(super) fn finish_removals(base: &Path) {
    let entries = fs::read_dir(base).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    for name in names.filter(|name| name.starts_with(ASIDE) && has_rested(&base.join(name))) {
        let (path, found) = (base.join(&name), look_at(base, &name));
        match &found.record {
            Some(record) if found.alive => {
                // If its name is taken by now, it is left where it is, and no command finds it by its name.
                if let Err(error) = fs::rename(&path, base.join(&record.name)) {
                    tracing::warn!(%error, run = record.name, place = %path.display(), "a living run could not get its name back");
                }
            }
            _ => sweep(&path, prefix(&found)),
        }
    }
}

/// Whether a folder got its name long ago: whoever gave it has ended.
fn has_rested(path: &Path) -> bool {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let renamed = fs::symlink_metadata(path).map(|metadata| metadata.ctime());
    renamed.is_ok_and(|time| u64::try_from(time).is_ok_and(|time| time + BIRTH.as_secs() < now))
}

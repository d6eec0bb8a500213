//! Which commit a file of the repository belongs to.

use std::path::Path;
use std::process::Command;

/// The commit of the copy of the repository that a folder belongs to, with `-dirty` for one with changes; `None` outside of a copy.
pub(super) fn commit_of(folder: &Path) -> Option<String> {
    let mut git = Command::new("git");
    git.arg("-C").arg(folder).args(["describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]);
    let output = git.output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}

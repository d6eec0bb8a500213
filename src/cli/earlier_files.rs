//! Files of an earlier test in a folder that another one writes to: next to those of the new one they would be taken for its own.

use macro_solver::output::OutputError;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

/// Removes the files of a folder that are called `STEM-NNNN`, a number of at least four digits, followed by `-` or `.` and more.
///
/// # Errors
/// A file cannot be removed.
pub(super) fn remove_numbered(folder: &Path, stem: &str) -> Result<(), OutputError> {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if is_numbered(&entry.file_name().to_string_lossy(), stem) {
            remove(&entry.path())?;
        }
    }
    Ok(())
}

/// Removes a file, if it is there.
///
/// # Errors
/// It cannot be removed.
pub(super) fn remove(path: &Path) -> Result<(), OutputError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(OutputError::write(path, error)),
        _ => Ok(()),
    }
}

fn is_numbered(name: &str, stem: &str) -> bool {
    let Some(rest) = name.strip_prefix(stem).and_then(|rest| rest.strip_prefix('-')) else { return false };
    let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
    digits >= 4 && matches!(rest.as_bytes().get(digits), Some(b'-' | b'.'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbered_files_go_and_others_stay() {
        let folder = tempfile::tempdir().unwrap();
        let names = [
            "grains-0001.vtp",
            "grains-0012-fluctuations.svg",
            "grains-1.vtp",
            "grains-0001",
            "grains.txt",
            "my-grains-0001.vtp",
        ];
        for name in names {
            fs::write(folder.path().join(name), "").unwrap();
        }
        remove_numbered(folder.path(), "grains").unwrap();
        let left: Vec<bool> = names.iter().map(|name| folder.path().join(name).exists()).collect();
        assert_eq!(left, [false, false, true, true, true, true]);
        remove_numbered(&folder.path().join("none"), "grains").unwrap();
    }
}

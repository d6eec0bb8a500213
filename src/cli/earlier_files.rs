//! Files of an earlier test in a folder that another one writes to: next to those of the new one they would be taken for its own.

use macro_solver::output::OutputError;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

/// Removes the files of a folder that are called `STEM-NNNN` and one of `endings`. The number has four digits, more from 10000 on. Whatever
/// else begins that way, a date for example, is not the program's and stays.
///
/// # Errors
/// A file cannot be removed.
pub(super) fn remove_numbered(folder: &Path, stem: &str, endings: &[&str]) -> Result<(), OutputError> {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if is_numbered(&entry.file_name().to_string_lossy(), stem, endings) {
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

fn is_numbered(name: &str, stem: &str, endings: &[&str]) -> bool {
    let Some(rest) = name.strip_prefix(stem).and_then(|rest| rest.strip_prefix('-')) else { return false };
    let (digits, ending) = rest.split_at(rest.bytes().take_while(u8::is_ascii_digit).count());
    endings.contains(&ending) && digits.parse().is_ok_and(|number: u64| format!("{number:04}") == digits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbered_files_go_and_others_stay() {
        let folder = tempfile::tempdir().unwrap();
        let gone = ["grains-0001.vtp", "grains-0012-fluctuations.svg", "grains-10000.vtp"];
        let staying = [
            "grains-1.vtp",
            "grains-00012.vtp",
            "grains-0001",
            "grains.txt",
            "my-grains-0001.vtp",
            "grains-2026-11-30.xlsx",
            "grains-2026-notes.txt",
            "grains-2026.docx",
        ];
        for name in gone.iter().chain(&staying) {
            fs::write(folder.path().join(name), "").unwrap();
        }
        let endings = [".vtp", "-fluctuations.svg"];
        remove_numbered(folder.path(), "grains", &endings).unwrap();
        assert!(gone.iter().all(|name| !folder.path().join(name).exists()));
        assert!(staying.iter().all(|name| folder.path().join(name).exists()));
        remove_numbered(&folder.path().join("none"), "grains", &endings).unwrap();
    }
}

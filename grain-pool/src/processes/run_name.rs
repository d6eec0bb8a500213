//! Unique names of runs.

use std::hash::{BuildHasher, Hasher, RandomState};

/// Longest part of a scene's name that goes into a run's name, which is part of the addresses of its channels: the
/// system allows these about 60 characters, with the user's number and the folders.
const STEM_LENGTH: usize = 9;

/// A new name for a run of the scene called `scene`: letters, digits and `-` only, so that it can be a file name and an
/// argument everywhere.
pub fn run_name(scene: &str) -> String {
    // Process ids are used again, and are not unique across containers that share memory.
    let random = RandomState::new().build_hasher().finish();
    format!("{}-{}-{:04x}", stem(scene), std::process::id(), random as u16)
}

fn stem(scene: &str) -> String {
    let plain = scene.chars().map(|letter| if letter.is_ascii_alphanumeric() { letter } else { '-' });
    let stem: String = plain.take(STEM_LENGTH).collect();
    if stem.is_empty() { "run".to_owned() } else { stem }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_plain_and_differ() {
        let name = run_name("Größe 1/biaxial, with a title that does not end");
        assert!(name.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '-'), "{name}");
        assert!(name.len() <= 22, "{name}");
        // One of three may by chance equal the first.
        assert!((0..3).any(|_| run_name("biaxial") != run_name("biaxial")));
        assert!(run_name("").starts_with("run-"));
    }
}

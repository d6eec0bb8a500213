//! Which build the engines of this program are.

/// Version of the package, `+`, and an identity of the sources that cells are made of, committed or not: 16 hexadecimal digits. Programs
/// and libraries made from one tree have the same one. Flags of the compiler are not in it, nor the features and the profile in the
/// manifest of the workspace.
pub const ENGINE_VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "+", env!("GRAINSPAN_SOURCES"));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_holds_an_identity_of_the_sources() {
        let (package, sources) = ENGINE_VERSION.split_once('+').unwrap();
        assert_eq!(package, env!("CARGO_PKG_VERSION"));
        assert!(sources.len() == 16 && sources.bytes().all(|digit| digit.is_ascii_hexdigit()), "{sources}");
    }
}

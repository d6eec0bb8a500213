//! The settings that are compared.

use anyhow::Context;
use rve_server::definition::RveOptions;
use serde::Deserialize;

/// Named options of the cell solver.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Setting {
    /// Curve of the picture that it belongs to.
    pub(super) curve: String,
    /// Name in tables.
    pub(super) name: String,
    /// The keys of `[rve]`.
    pub(super) rve: RveOptions,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    setting: Vec<Setting>,
}

/// All settings, or the ones that take seconds.
///
/// # Errors
/// A key of `[rve]` that the solver does not know.
pub(super) fn settings(quick: bool) -> anyhow::Result<Vec<Setting>> {
    let all: Settings = toml::from_str(include_str!("settings.toml")).context("settings of bench rve")?;
    for setting in &all.setting {
        setting.rve.validate().with_context(|| format!("setting `{}` of bench rve", setting.name))?;
    }
    let takes_seconds = |setting: &Setting| !quick || setting.rve.strain_per_step() >= 5e-6;
    Ok(all.setting.into_iter().filter(takes_seconds).collect())
}

/// Whether a reference is at least ten times tighter than a setting in both knobs, so that its own error can be neglected.
pub(super) fn is_beyond(reference: &RveOptions, setting: &RveOptions) -> bool {
    let rounding = 1.0 + 1e-9;
    reference.strain_per_step() * 10.0 <= setting.strain_per_step() * rounding
        && reference.tolerance() * 10.0 <= setting.tolerance() * rounding
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_sound_and_named_once() {
        let all = settings(false).unwrap();
        let mut names: Vec<&str> = all.iter().map(|setting| setting.name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), all.len());
        assert!(settings(true).unwrap().len() >= 2);
    }

    #[test]
    fn a_reference_is_ten_times_tighter() {
        let options = |text| toml::from_str::<RveOptions>(text).unwrap();
        let reference = options("strain_per_step = 1e-7\ntolerance = 1e-4");
        assert!(is_beyond(&reference, &options("strain_per_step = 1e-6\ntolerance = 1e-3")));
        assert!(!is_beyond(&reference, &options("strain_per_step = 5e-7\ntolerance = 1e-3")));
        assert!(!is_beyond(&reference, &options("strain_per_step = 1e-6\ntolerance = 2e-4")));
    }
}

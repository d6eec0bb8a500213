//! Quasi-Newton corrections of the global equations.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Limited-memory BFGS on the free degrees of freedom, on top of the kept factors [Nocedal and Wright, algorithm 7.4].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuasiNewton {
    /// Pairs of changes of displacement and out-of-balance force that are remembered, over steps too.
    pub pairs: usize,
    /// Pairs between whose iterates no point's displacement gradient has changed by this much are noise and are not
    /// used; dimensionless.
    pub min_change: f64,
}

impl Default for QuasiNewton {
    fn default() -> Self {
        Self { pairs: 20, min_change: 2e-5 }
    }
}

/// The keys of `[solver]` about quasi-Newton corrections.
#[derive(Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(super) struct QuasiNewtonKeys {
    /// Pairs that limited-memory BFGS keeps, over steps too; 0 switches it off.
    #[schemars(extend("x-default" = "by `strategy`", "x-procedures" = "implicit"))]
    quasi_newton_pairs: usize,
    /// Pairs between whose iterates no point's displacement gradient has changed by this much are noise and are not used.
    #[schemars(extend("x-unit" = "-", "x-procedures" = "implicit"), range(min = 0.0))]
    quasi_newton_min_change: f64,
}

impl Default for QuasiNewtonKeys {
    fn default() -> Self {
        Self { quasi_newton_pairs: 0, quasi_newton_min_change: QuasiNewton::default().min_change }
    }
}

pub(super) mod quasi_newton_keys {
    use super::{QuasiNewton, QuasiNewtonKeys};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(in crate::problem) fn serialize<S: Serializer>(
        settings: &Option<QuasiNewton>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let keys = settings.map_or(QuasiNewtonKeys::default(), |settings| QuasiNewtonKeys {
            quasi_newton_pairs: settings.pairs,
            quasi_newton_min_change: settings.min_change,
        });
        keys.serialize(serializer)
    }

    pub(in crate::problem) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<QuasiNewton>, D::Error> {
        let keys = QuasiNewtonKeys::deserialize(deserializer)?;
        let settings = QuasiNewton { pairs: keys.quasi_newton_pairs, min_change: keys.quasi_newton_min_change };
        Ok((settings.pairs > 0).then_some(settings))
    }
}

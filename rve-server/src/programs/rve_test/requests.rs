//! What rows carry in addition to stress and scalars.

use protocol::TangentKind;
use std::collections::BTreeSet;

/// Results of rows that are made on request.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RowRequests {
    /// Tangent operator of every row.
    pub tangent: TangentKind,
    /// Increments whose grains and contacts are wanted.
    pub pictures: BTreeSet<u64>,
    /// Increment from which displacement fluctuations of these grains are counted; `None`: they are not computed.
    pub fluctuations_from: Option<u64>,
}

impl From<TangentKind> for RowRequests {
    fn from(tangent: TangentKind) -> Self {
        Self { tangent, ..Self::default() }
    }
}

//! What rows carry in addition to stress and scalars.

use protocol::TangentKind;
use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;

/// Results of rows that are made on request, and whether the test is to go on.
#[derive(Clone, Debug, Default)]
pub struct RowRequests {
    /// Tangent operator of every row.
    pub tangent: TangentKind,
    /// Increments whose grains and contacts are wanted.
    pub pictures: BTreeSet<u64>,
    /// Increment from which displacement fluctuations of these grains are counted; `None`: they are not computed.
    pub fluctuations_from: Option<u64>,
    /// Asked before every trial: one row may take thousands.
    pub stop: StopRequests,
}

/// Whether a test is to end before its next trial; by default it is not.
#[derive(Clone, Default)]
pub struct StopRequests(Option<Arc<dyn Fn() -> bool>>);

impl StopRequests {
    /// Those that a function tells of.
    pub fn new(is_made: impl Fn() -> bool + 'static) -> Self {
        Self(Some(Arc::new(is_made)))
    }

    pub(super) fn is_made(&self) -> bool {
        self.0.as_ref().is_some_and(|is_made| is_made())
    }
}

impl fmt::Debug for StopRequests {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_tuple("StopRequests").field(&self.is_made()).finish()
    }
}

impl From<TangentKind> for RowRequests {
    fn from(tangent: TangentKind) -> Self {
        Self { tangent, ..Self::default() }
    }
}

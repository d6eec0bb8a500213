//! How the controlled stresses of a row came about.

/// How the controlled stresses of a row came about, the plainest first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum StressControl {
    /// No stress is controlled.
    #[default]
    None,
    /// Met within the tolerance by a search from the state of the row before.
    Met,
    /// Met within the tolerance in parts of the increment.
    Cut,
    /// Met within the tolerance after the search had failed, mostly because the cell snapped: the unbalanced stress drove it through committed
    /// states.
    Relaxed,
    /// Not met at the end of the increment: the cell snaps across the target, and the nearest state is kept, outside the tolerance.
    Jump,
}

impl StressControl {
    /// Whether the cell has snapped: it does not go on as before, so that nothing is extrapolated from its last change.
    pub(super) fn has_snapped(self) -> bool {
        matches!(self, Self::Relaxed | Self::Jump)
    }
}

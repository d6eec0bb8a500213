//! How an answer was found.

/// Way to the end of a solve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Course {
    /// By relaxation, as the definition says.
    #[default]
    Relaxed,
    /// By the stored linear response of the state: no contact changed its mode.
    Elastic,
    /// By new linear responses of the contacts that stick, slide and are closed at the end.
    Events,
    /// By relaxation, because the event-driven solver does not apply or would not pay.
    HandedOver,
}

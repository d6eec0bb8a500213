//! How an answer was found.

/// What found an answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AnsweredBy {
    /// By relaxation, as the definition says.
    #[default]
    Relaxation,
    /// By the stored linear response of the state: no contact changed its mode.
    Elastic,
    /// By new linear responses of the contacts that stick, slide and are closed at the end.
    Events,
    /// By relaxation, because the event-driven solver does not apply or would not pay.
    HandedOver,
}

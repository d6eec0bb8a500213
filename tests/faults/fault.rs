//! What a faulty worker does, and when.

use super::draw::Draw;
use std::fmt;

/// States of a worker's conversation, in the order in which it goes through them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum State {
    BeforeJoining,
    BeforeHello,
    AfterHello,
    AfterWelcome,
    Defined,
    JobTaken,
    MidSolve,
    Solved,
    MidReply,
    Replied,
    BetweenSteps,
    Dismissed,
}

impl State {
    pub const ALL: [Self; 12] = [
        Self::BeforeJoining,
        Self::BeforeHello,
        Self::AfterHello,
        Self::AfterWelcome,
        Self::Defined,
        Self::JobTaken,
        Self::MidSolve,
        Self::Solved,
        Self::MidReply,
        Self::Replied,
        Self::BetweenSteps,
        Self::Dismissed,
    ];
}

/// What happens there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Action {
    /// SIGKILL.
    Kill,
    /// SIGSEGV: a crash in native code.
    Crash,
    /// SIGABRT.
    Abort,
    /// An allocation that the system refuses.
    OutOfMemory,
    /// SIGSTOP.
    Stop,
    /// Never answers again.
    Sleep,
    /// Leaves without a word.
    Exit,
    /// A panic inside the engine.
    Panic,
    /// Answers, but late.
    Late,
    /// Answers twice.
    Twice,
    /// A number in the answer is not one.
    NotANumber,
    /// The state does not have the content that its name promises.
    DamagedState,
    /// An answer to a job that nobody gave out.
    Invent,
    /// Bytes that are no message.
    Garbage,
    /// A message of another protocol version.
    Stranger,
}

impl Action {
    /// What can happen in a state.
    fn possible(state: State) -> &'static [Self] {
        use Action::*;
        match state {
            State::BeforeJoining => &[Kill, Exit],
            State::BeforeHello => &[Kill, Crash, Exit, Garbage, Stranger],
            State::AfterHello | State::AfterWelcome | State::Defined => &[Kill, Crash, Exit, Garbage],
            State::JobTaken => &[Kill, Abort, Exit, Stop, Sleep],
            State::MidSolve => &[Kill, Crash, OutOfMemory, Panic],
            State::Solved => &[Kill, Late, NotANumber, DamagedState, Invent, Twice, Sleep],
            State::MidReply => &[Kill],
            State::Replied => &[Kill, Abort, Garbage],
            State::BetweenSteps => &[Kill, Exit, Stop],
            State::Dismissed => &[Kill, Sleep],
        }
    }
}

/// One fault: at the `count`-th time (from 1) that `state` is reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Fault {
    pub state: State,
    pub action: Action,
    pub count: u64,
}

impl Fault {
    pub fn draw(draw: &mut Draw) -> Self {
        let state = draw.pick(&State::ALL);
        let often = matches!(
            state,
            State::JobTaken
                | State::MidSolve
                | State::Solved
                | State::MidReply
                | State::Replied
                | State::BetweenSteps
        );
        let count = if often { 1 + draw.below(6) } else { 1 };
        Self { state, action: draw.pick(Action::possible(state)), count }
    }

    /// From the words of a command line.
    pub fn parse(text: &str) -> Option<Self> {
        let mut parts = text.split(':');
        let (state, action, count) = (parts.next()?, parts.next()?, parts.next()?);
        let state = State::ALL.into_iter().find(|one| format!("{one:?}") == state)?;
        let action = Action::possible(state).iter().copied().find(|one| format!("{one:?}") == action)?;
        Some(Self { state, action, count: count.parse().ok()? })
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:?}:{:?}:{}", self.state, self.action, self.count)
    }
}

//! Enums whose variants people choose by a word, and sets of bits with a word for each.

use thiserror::Error;

/// A word that names no variant.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("possible values: {choices}")]
pub struct UnknownKeyword {
    /// All words, separated by commas.
    pub choices: String,
}

/// The words of an enum, each stated once: its variants (`ALL`), the word of one (`keyword`), and `FromStr` back. A variant that is
/// missing from the list does not compile. Words of input files have to be those of the `serde` names, which tests compare.
#[macro_export]
macro_rules! keywords {
    ($visibility:vis $name:ident { $($variant:ident => $word:literal),+ $(,)? }) => {
        impl $name {
            /// All of them.
            $visibility const ALL: [Self; [$($word),+].len()] = [$(Self::$variant),+];

            /// The word for it in input files, on the command line and in outputs.
            $visibility fn keyword(self) -> &'static str {
                match self {
                    $(Self::$variant => $word,)+
                }
            }
        }

        impl std::str::FromStr for $name {
            type Err = $crate::keyword::UnknownKeyword;

            fn from_str(word: &str) -> Result<Self, Self::Err> {
                let unknown = || $crate::keyword::UnknownKeyword { choices: Self::ALL.map(Self::keyword).join(", ") };
                Self::ALL.into_iter().find(|one| one.keyword() == word).ok_or_else(unknown)
            }
        }
    };
}

/// The bits of a set, each stated once: its constant, its number on the wire and its word in the wire layout. The list of all of them
/// (`NAMED`) cannot leave one out.
macro_rules! bits {
    ($set:ident { $($(#[$note:meta])* $name:ident = $bit:literal => $word:literal),+ $(,)? }) => {
        impl $set {
            $($(#[$note])* pub const $name: Self = Self($bit);)+

            /// Every bit with its word in the wire layout, in the order of their numbers.
            pub const NAMED: [(Self, &'static str); [$($bit),+].len()] = [$((Self::$name, $word)),+];
        }
    };
}
pub(crate) use bits;

#[cfg(test)]
mod tests {
    use crate::transport::shared_memory::Waiting;
    use crate::{Observables, TangentKind, TrialFlags};

    #[test]
    fn bits_are_counted_up_from_the_lowest() {
        let numbers = |bits: &[u32]| bits.iter().enumerate().all(|(place, bit)| *bit == 1 << place);
        assert!(numbers(&TrialFlags::NAMED.map(|(flag, _)| flag.0)));
        let observables = Observables::NAMED.map(|(observable, _)| observable);
        assert!(numbers(&observables.map(|observable| observable.0)));
        assert_eq!(observables.into_iter().fold(Observables::NONE, Observables::union), Observables::ALL);
    }

    #[test]
    fn words_lead_back_to_their_variants_and_are_those_of_files() {
        for kind in TangentKind::ALL {
            assert_eq!(kind.keyword().parse(), Ok(kind));
            assert_eq!(serde_json::to_value(kind).unwrap(), kind.keyword());
        }
        for waiting in Waiting::ALL {
            assert_eq!(serde_json::to_value(waiting).unwrap(), waiting.keyword());
        }
        let unknown = "spinning".parse::<Waiting>().unwrap_err();
        assert_eq!(unknown.to_string(), "possible values: block, hybrid, spin");
    }
}

//! What the commands accept, write and say.

mod bad_input;
mod bench;
mod run;
mod specimens;
mod tools;

//! What the commands accept, write and say.

mod bad_input;
mod run;
mod specimens;
mod tools;

//! What the commands accept, write and say.

mod bad_input;
mod beginners_mistakes;
mod economy;
mod element;
mod error_estimate;
mod figures;
mod page;
mod reproduce;
mod run;
mod run_output;
mod specimens;
mod studies;
mod tools;

//! What the folders, documents and deployment files promise.

mod deploy;
mod documents;
mod seams;

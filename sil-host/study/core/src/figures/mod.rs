//! The page that compares every figure and number of the paper with the computed ones.
//!
//! - [`page`]: the page itself, as HTML
//! - [`page_maker`]: code that its sections share; each study makes its own in `page.rs`
//! - [`run`]: the section of one run over time
//!
//! Every number on the page, and every verdict, comes from an outcome; the text around them
//! explains the differences.

pub mod page;
pub mod page_maker;
pub mod run;

pub use page::{Comparison, Page, Section, Verdict};

//! The page that sets every figure and number of the paper beside what is found here.
//!
//! - [`page`]: the page itself, as HTML
//! - [`sections`]: what the paper says, what is found, and why they differ, study by study

pub mod page;
pub mod sections;

pub use page::{Comparison, Page, Section, Verdict};

//! The page that sets every figure and number of the paper beside what is found here.
//!
//! - [`page`]: the page itself, as HTML
//! - [`page_maker`]: what its sections share; each study makes its own in its `page.rs`
//! - [`run`]: the section of one run over time
//!
//! Every number on it comes from an outcome, and so does every verdict; the words around them
//! say why.

pub mod page;
pub mod page_maker;
pub mod run;

pub use page::{Comparison, Page, Section, Verdict};

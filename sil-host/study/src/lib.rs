//! The list of studies, for the command line, sweeps and the page of figures.
//!
//! [`core`](painleve_study_core) says what a study is, [`paper`](painleve_study_paper) computes the paper's figures,
//! [`quality`](painleve_study_quality) how well the controller works, and `sweep` computes in shards, on
//! many machines, those whose rows are lines of a table.
//!
//! Each study is a folder: `mod.rs` holds its settings and rows, `options.rs` parses the settings
//! from the command line, `outcome.rs` collects the rows, `figure.rs` draws them, and `page.rs`
//! compares them with the paper.

use painleve_study_core::catalogue::CatalogueEntry;
use painleve_study_paper::{
    admissible, bifurcation, closed_loop_bifurcation, poincare, regions, sliding_range,
};
use painleve_study_quality::{
    ablation, capture, effects, lift_off, loop_margins, ringing, robustness, stiffness,
};

/// Every study, in the order of the command's help and of the page.
pub static STUDIES: [CatalogueEntry; 14] = [
    CatalogueEntry::of::<admissible::Options>(),
    CatalogueEntry::of::<regions::Options>(),
    CatalogueEntry::of::<bifurcation::Options>(),
    CatalogueEntry::of::<poincare::Options>(),
    CatalogueEntry::of::<sliding_range::Options>(),
    CatalogueEntry::of::<closed_loop_bifurcation::Options>(),
    CatalogueEntry::of::<robustness::Options>(),
    CatalogueEntry::of::<ablation::Options>(),
    CatalogueEntry::of::<effects::Options>(),
    CatalogueEntry::of::<stiffness::Options>(),
    CatalogueEntry::of::<ringing::Options>(),
    CatalogueEntry::of::<loop_margins::Options>(),
    CatalogueEntry::of::<capture::Options>(),
    CatalogueEntry::of::<lift_off::Options>(),
];

/// Returns the study with this name.
pub fn find(name: &str) -> Option<&'static CatalogueEntry> {
    STUDIES.iter().find(|entry| entry.name == name)
}

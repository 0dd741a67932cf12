//! The list of studies, shared by the command line, sweeps and the page of figures.

use crate::catalogue::CatalogueEntry;
use crate::{
    ablation, admissible, bifurcation, capture, closed_loop_bifurcation, effects, lift_off,
    poincare, regions, ringing, robustness, sliding_range, stiffness,
};

/// Every study, in the order of the command's help and of the page.
pub static STUDIES: [CatalogueEntry; 13] = [
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
    CatalogueEntry::of::<capture::Options>(),
    CatalogueEntry::of::<lift_off::Options>(),
];

/// Returns the study with this name.
pub fn find(name: &str) -> Option<&'static CatalogueEntry> {
    STUDIES.iter().find(|entry| entry.name == name)
}

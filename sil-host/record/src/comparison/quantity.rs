//! The quantities of runs that a comparison looks at.

use crate::run_table::RunTable;

/// A quantity that is compared.
pub(super) struct Quantity {
    pub key: &'static str,
    title: &'static str,
    unit: &'static str,
    scale: f64,
    /// The column of the simulated arm, and the controller's estimate of the same.
    pub columns: [&'static str; 2],
    /// What is subtracted.
    minus: Option<[&'static str; 2]>,
}

const REFERENCE: [&str; 2] = ["plant.reference_tip_t_m", "estimates.reference_m"];

pub(super) const QUANTITIES: [Quantity; 7] = [
    quantity(
        "tip_mm",
        "Tip position zₜ",
        "mm",
        ["plant.tip_t_m", "estimates.tip_t_m"],
        None,
    ),
    quantity(
        "error_mm",
        "Tracking error zₜ − zₜ*",
        "mm",
        ["plant.tip_t_m", "estimates.tip_t_m"],
        Some(REFERENCE),
    ),
    quantity("gap_mm", "Gap", "mm", ["plant.gap_m", "plant.gap_m"], None),
    quantity(
        "normal_force_n",
        "Normal force fₙ",
        "N",
        ["plant.normal_force_n", "estimates.normal_force_n"],
        None,
    ),
    quantity(
        "u1_nm",
        "Torque u₁",
        "N·m",
        ["plant.u1_nm", "estimates.u1_nm"],
        None,
    ),
    quantity(
        "u2_nm",
        "Torque u₂",
        "N·m",
        ["plant.u2_nm", "estimates.u2_nm"],
        None,
    ),
    quantity(
        "friction",
        "Estimated friction coefficient μ",
        "",
        ["estimates.friction", "estimates.friction"],
        None,
    ),
];

const fn quantity(
    key: &'static str,
    title: &'static str,
    unit: &'static str,
    columns: [&'static str; 2],
    minus: Option<[&'static str; 2]>,
) -> Quantity {
    let scale = match unit.as_bytes() {
        b"mm" => 1e3,
        _ => 1.0,
    };
    Quantity {
        key,
        title,
        unit,
        scale,
        columns,
        minus,
    }
}

impl Quantity {
    /// Returns title and unit.
    pub fn label(&self) -> String {
        match self.unit {
            "" => self.title.into(),
            unit => format!("{} ({unit})", self.title),
        }
    }

    /// Returns the values of a run: of the simulated arm, or as estimated.
    pub fn values(&self, table: &RunTable, estimated: usize) -> Vec<f64> {
        let values = table.column(self.columns[estimated]).iter();
        match self.minus.map(|minus| table.column(minus[estimated])) {
            Some(minus) => values
                .zip(minus)
                .map(|(one, other)| self.scale * (one - other))
                .collect(),
            None => values.map(|value| self.scale * value).collect(),
        }
    }
}

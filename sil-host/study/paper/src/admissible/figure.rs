//! p along the belt, in both postures.

use painleve_chart::style::{BLUE_INK, GREY, VERMILLION};
use painleve_chart::{Chart, Mark, Panel};
use painleve_plant::belt_line::BeltLine;
use painleve_shared::Arm;
use painleve_study_core::outcome::Figure;

use super::Admissible;

/// Points of a curve.
const CURVE_POINTS: usize = 400;

impl Figure for Admissible {
    fn svg(&self) -> String {
        let mut marks = Vec::new();
        // The arm was checked before.
        if let Ok(arm) = Arm::new(self.arm) {
            for ((posture, name, _), colour) in
                self.postures().into_iter().zip([BLUE_INK, VERMILLION])
            {
                let line = BeltLine::new(&arm, posture);
                let points = (0..=CURVE_POINTS).map(|index| {
                    let tau = core::f64::consts::PI * (index as f64 / CURVE_POINTS as f64 - 0.5);
                    (line.tip_t_m(tau), line.p_per_kg(tau, self.mu, self.slip))
                });
                marks.push(Mark::line(name, colour, points.collect()));
            }
        }
        let (low, high) = (-self.reach_m, self.reach_m);
        marks.push(Mark::line("p = 0", GREY, vec![(low, 0.0), (high, 0.0)]));
        Chart {
            title: "Admissible configurations (Table II)".into(),
            subtitle: format!(
                "μ = {} · slip {} · critical friction {:.5}",
                self.mu,
                self.direction(),
                self.critical_friction
            ),
            x_title: "Tip position zₜ (m)".into(),
            x: Some(low..high),
            panels: vec![Panel {
                title: "Contact coefficient p (1/kg)".into(),
                note: "paradox where p ≤ 0".into(),
                marks,
                ..Panel::default()
            }],
            ..Chart::default()
        }
        .svg()
    }
}

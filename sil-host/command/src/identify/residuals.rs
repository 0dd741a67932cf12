//! The distance of the tip from the line along the belt, by the values before and by those now.

use painleve_chart::style::{BLUE_INK, ORANGE};
use painleve_chart::{Chart, Mark, Panel};
use painleve_commission::identification::Found;
use painleve_shared::Posture;

/// Returns the figure as SVG text.
pub fn svg(found: &Found) -> String {
    let identified = &found.identified;
    let by = [
        ("by the values before", &found.prior.parameters),
        ("by the values now", &identified.fit.parameters),
    ];
    let panels = by
        .into_iter()
        .enumerate()
        .map(|(index, (title, parameters))| {
            let of_posture = |posture: Posture, name: &str, colour| Mark::Dots {
                name: if index == 0 {
                    name.into()
                } else {
                    String::new()
                },
                colour,
                size: 6,
                points: identified
                    .points
                    .residuals(parameters)
                    .filter(|it| it.posture == posture)
                    .map(|it| (1e3 * it.tip_t_m, 1e3 * it.depth_m))
                    .collect(),
            };
            Panel {
                title: format!("Depth of the tip in the belt {title} (mm)"),
                minimum_span: 0.1,
                marks: vec![
                    of_posture(Posture::ElbowDown, "elbow down", BLUE_INK),
                    of_posture(Posture::ElbowUp, "elbow up", ORANGE),
                ],
                ..Panel::default()
            }
        });
    Chart {
        title: "Slides along the belt".into(),
        subtitle: format!(
            "{} readings, means over 1 mm; root mean square {:.2} mm before, {:.3} mm now",
            identified.readings,
            1e3 * identified.off_line_m[0],
            1e3 * identified.off_line_m[1]
        ),
        x_title: "Tip position (mm)".into(),
        panels: panels.collect(),
        ..Chart::default()
    }
    .svg()
}

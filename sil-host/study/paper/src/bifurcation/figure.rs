//! Fig. 4: a section at one friction coefficient as points, a whole diagram as maps.

use painleve_chart::style::{BLACK_INK, BLUE_INK, Colour, GREEN, GREY, QUIET, SKY, VERMILLION};
use painleve_chart::{Chart, Mark, Panel};
use painleve_study_core::outcome::Figure;

use super::Row;
use super::outcome::BifurcationDiagram;
use crate::cells::Cells;
use crate::places::Places;

/// Colours of a map in ascending order after the quiet colour; distinguishable in grey.
const RISING: [Colour; 6] = [
    Colour(0xFD, 0xE7, 0x25),
    Colour(0x90, 0xD7, 0x43),
    Colour(0x35, 0xB7, 0x79),
    Colour(0x21, 0x90, 0x8C),
    Colour(0x3B, 0x52, 0x8B),
    Colour(0x44, 0x01, 0x54),
];

impl Figure for BifurcationDiagram {
    fn svg(&self) -> String {
        chart(self).svg()
    }
}

/// Draws the figure.
fn chart(diagram: &BifurcationDiagram) -> Chart {
    let Cells {
        mu,
        transient_s,
        record_s,
        ..
    } = diagram.settings();
    let groups = diagram.groups();
    let watched = format!("largest θ̇₁ within {record_s} s after {transient_s} s of transient");
    match mu.as_slice() {
        [mu] => Chart {
            title: format!("Bifurcation diagram at μ = {mu}"),
            subtitle: format!("no control, {watched} (paper: Fig. 4)"),
            x_title: "Belt speed v_belt (m/s)".into(),
            panels: vec![section(diagram, &groups), apexes(diagram, &groups)],
            ..Chart::default()
        },
        _ => {
            let values: Vec<Vec<f64>> = groups
                .iter()
                .map(|group| strongest(diagram, group))
                .collect();
            // One range of colours, so that the panels can be compared.
            let (palette, cells) = shades(&values.concat());
            let cells = cells.chunks(values[0].len());
            let panels = groups.iter().zip(cells);
            let panels = panels.map(|(group, cells)| map(diagram, group, &palette, cells));
            Chart {
                title: "Bifurcation diagram over belt speed and friction".into(),
                subtitle: format!("no control, {watched}; dashed: bouncing in the paper"),
                x_title: "Belt speed v_belt (m/s)".into(),
                x: Some(Places::of(&diagram.settings().v_belt_m_s).ends()),
                panels: panels.collect(),
                ..Chart::default()
            }
        }
    }
}

/// Returns the name of a group of initial conditions and its colour.
fn look(group: &str) -> (String, Colour) {
    match group {
        "a" => ("from x0,a".into(), BLACK_INK),
        "d" => ("from x0,d".into(), VERMILLION),
        "u" => ("from x0,u".into(), BLUE_INK),
        _ => ("from random states".into(), GREEN),
    }
}

/// Draws a value of each cell of a section against belt speed. Adjacent cells are not joined: their
/// motions need not be related. A dot is larger than those drawn over it, so that both are seen.
fn points(
    diagram: &BifurcationDiagram,
    group: &str,
    size: i32,
    value: impl Fn(&Row) -> f64,
) -> Mark {
    let (name, colour) = look(group);
    let points = diagram
        .rising_speeds()
        .into_iter()
        .flat_map(|place| diagram.at(0, place, group))
        .map(|row| (row.v_belt_m_s, value(row)))
        .collect();
    Mark::Dots {
        name,
        colour,
        size,
        points,
    }
}

fn curves(diagram: &BifurcationDiagram, groups: &[&str], value: impl Fn(&Row) -> f64) -> Vec<Mark> {
    // The first series is drawn last, on top.
    let places = groups.iter().enumerate().rev();
    places
        .map(|(place, group)| points(diagram, group, 8 + 5 * place as i32, &value))
        .collect()
}

fn section(diagram: &BifurcationDiagram, groups: &[&str]) -> Panel {
    let mut marks = Vec::new();
    if let Some([from, to]) = diagram.windows.iter().find_map(|window| window.paper_m_s) {
        marks.push(Mark::Spans {
            name: format!("bouncing in the paper, {from} … {to} m/s").replace('-', "−"),
            colour: SKY,
            opacity: 0.25,
            x: vec![from..to],
        });
    }
    marks.extend(curves(diagram, groups, |row| row.max_theta1_dot_rad_s));
    Panel {
        title: "Largest θ̇₁ (rad/s)".into(),
        marks,
        ..Panel::default()
    }
}

fn apexes(diagram: &BifurcationDiagram, groups: &[&str]) -> Panel {
    Panel {
        title: "Apex of the tip (mm)".into(),
        height: 300,
        y_ticks: 4,
        marks: curves(diagram, groups, |row| 1e3 * row.apex_m)
            .into_iter()
            .map(without_name)
            .collect(),
        ..Panel::default()
    }
}

/// Removes the legend entries that the panel above shows already.
fn without_name(mut mark: Mark) -> Mark {
    if let Mark::Dots { name, .. } = &mut mark {
        name.clear();
    }
    mark
}

/// Returns the largest θ̇₁ of each cell of a map; minus infinity where nothing bounces.
fn strongest(diagram: &BifurcationDiagram, group: &str) -> Vec<f64> {
    let settings = diagram.settings();
    let (columns, lines) = (Places::of(&settings.v_belt_m_s), Places::of(&settings.mu));
    let of_cell = |mu: usize, speed: usize| {
        let rows = diagram.at(mu, speed, group).filter(|row| row.bouncing);
        let speeds = rows.map(|row| row.max_theta1_dot_rad_s);
        speeds.fold(f64::NEG_INFINITY, f64::max)
    };
    lines
        .nearest
        .iter()
        .flat_map(|&mu| columns.nearest.iter().map(move |&speed| (mu, speed)))
        .map(|(mu, speed)| of_cell(mu, speed))
        .collect()
}

fn map(
    diagram: &BifurcationDiagram,
    group: &str,
    palette: &[(String, Colour)],
    cells: &[u8],
) -> Panel {
    let settings = diagram.settings();
    let (columns, lines) = (Places::of(&settings.v_belt_m_s), Places::of(&settings.mu));
    let mut marks = vec![Mark::Cells {
        x: columns.ends(),
        y: lines.ends(),
        columns: columns.nearest.len(),
        palette: palette.to_vec(),
        cells: cells.to_vec(),
    }];
    let paper = diagram
        .windows
        .iter()
        .filter(|window| window.initial == group);
    let least = paper.clone().filter(|window| window.paper_m_s.is_some());
    let least = least.map(|window| window.mu).fold(f64::INFINITY, f64::min);
    if let Some([from, to]) = paper.filter_map(|window| window.paper_m_s).next() {
        let (bottom, top) = (least - 0.5 * lines.step, lines.ends().end);
        marks.push(Mark::dashed(
            "",
            GREY,
            vec![(from, top), (from, bottom), (to, bottom), (to, top)],
        ));
    }
    Panel {
        title: format!("μ, {}", look(group).0),
        note: "largest θ̇₁ in rad/s:".into(),
        y: Some(lines.ends()),
        y_ticks: 10,
        height: 560,
        marks,
        ..Panel::default()
    }
}

/// Returns a palette for values, and the index of each value in it; minus infinity is quiet.
fn shades(values: &[f64]) -> (Vec<(String, Colour)>, Vec<u8>) {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    let low = finite().fold(f64::INFINITY, f64::min).floor();
    let high = finite().fold(f64::NEG_INFINITY, f64::max).ceil();
    let mut palette = vec![("quiet".to_owned(), QUIET)];
    if low > high {
        return (palette, vec![0; values.len()]);
    }
    let width = ((high - low) / RISING.len() as f64).ceil().max(1.0);
    let used = ((high - low) / width).ceil().max(1.0) as usize;
    for (shade, colour) in RISING.iter().enumerate().take(used) {
        let from = low + width * shade as f64;
        palette.push((format!("{from}–{}", from + width), *colour));
    }
    let place = |value: &f64| match value.is_finite() {
        true => 1 + (((value - low) / width) as usize).min(used - 1) as u8,
        false => 0,
    };
    let cells = values.iter().map(place).collect();
    (palette, cells)
}

#[cfg(test)]
mod tests {
    use painleve_plant::mechanics::PlantParameters;
    use painleve_study_core::initial::Initial;

    use super::*;
    use crate::bifurcation::Bifurcation;
    use crate::cells::RELATIVE_TOLERANCE;

    #[test]
    fn a_colour_means_the_same_in_every_panel() {
        let study = Bifurcation {
            cells: Cells {
                plant: PlantParameters::default(),
                relative_tolerance: RELATIVE_TOLERANCE,
                mu: vec![0.4, 0.6],
                v_belt_m_s: vec![-0.5, -0.4],
                initial: vec![Initial::A, Initial::D],
                seed: 1,
                transient_s: 1.0,
                record_s: 1.0,
            },
        };
        let rows = (0..8).map(|index| Row {
            mu: 0.4,
            v_belt_m_s: -0.4,
            initial: "a".into(),
            // From x0,d three times as fast as from x0,a.
            max_theta1_dot_rad_s: if index % 2 == 0 { 4.0 } else { 12.0 },
            bouncing: true,
            contact_fraction: 0.5,
            apex_m: 0.01,
            impacts_per_s: 5.0,
            start_theta1_deg: 32.0,
            start_theta2_deg: 18.0,
            start_theta1_dot_rad_s: 0.0,
            start_theta2_dot_rad_s: 0.0,
        });
        let diagram = BifurcationDiagram::new(&study, rows.collect());
        let panels = chart(&diagram).panels;
        let [one, other] = [0, 1].map(|panel: usize| match &panels[panel].marks[0] {
            Mark::Cells { palette, cells, .. } => (palette, cells[0]),
            mark => panic!("{mark:?}"),
        });
        assert_eq!(one.0, other.0);
        assert_ne!(one.1, other.1);
    }
}

//! Charts stay within their bounds, and their legend lists the named elements.

use super::*;
use crate::style::{BLUE_INK, GREEN, ORANGE, VERMILLION};
use proptest::prelude::*;

fn chart(marks: Vec<Mark>) -> Chart {
    Chart {
        title: "a < b".into(),
        x_title: "x (m)".into(),
        panels: vec![Panel {
            title: "y (N)".into(),
            marks,
            ..Panel::default()
        }],
        ..Chart::default()
    }
}

fn count(svg: &str, part: &str) -> usize {
    svg.matches(part).count()
}

#[test]
fn named_elements_are_in_the_legend_and_titles_are_escaped() {
    let svg = chart(vec![
        Mark::line("solid", BLUE_INK, vec![(0.0, 1.0), (1.0, 2.0)]),
        Mark::dashed("", GREEN, vec![(0.0, 2.0), (1.0, 1.0)]),
        Mark::Spans {
            name: "span".into(),
            colour: ORANGE,
            opacity: 0.5,
            x: vec![0.2..0.4],
        },
        Mark::Cells {
            x: 0.0..1.0,
            y: 1.0..2.0,
            columns: 2,
            palette: vec![("cell".into(), VERMILLION)],
            cells: vec![0, 0, 9, 0],
        },
        Mark::Label {
            at: (0.5, 1.5),
            centred: true,
            text: "word".into(),
        },
    ])
    .svg();
    for text in [
        "solid", "span", "cell", "word", "a &lt; b", "x (m)", "y (N)",
    ] {
        assert!(
            svg.contains(&format!(">{text}</text>")),
            "{text} is not in {svg}"
        );
    }
    // One rectangle in the legend; in the map one for the lower row, and one beside the clear cell.
    let shapes = svg.split("<path fill=\"#D55E00\"").skip(1);
    let rectangles = shapes.map(|shape| count(shape.split_once("/>").unwrap().0, "M"));
    assert_eq!(rectangles.collect::<Vec<_>>(), [1, 2]);
}

#[test]
fn nan_interrupts_lines_and_coincident_dots_are_merged() {
    let points = vec![
        (0.0, 0.0),
        (1.0, 1.0),
        (2.0, f64::NAN),
        (3.0, 1.0),
        (4.0, 0.0),
    ];
    let svg = chart(vec![Mark::line("", BLUE_INK, points)]).svg();
    assert_eq!(count(&svg, "stroke=\"#0072B2\" "), 2);
    let dots = |points| {
        let dots = Mark::Dots {
            name: String::new(),
            colour: GREEN,
            size: 4,
            points,
        };
        chart(vec![dots]).svg()
    };
    let few = dots(vec![(0.0, 0.0), (1.0, 1.0), (1.0, 1.0), (0.5, f64::NAN)]);
    assert_eq!(count(&few, "r=\"7\" fill=\"#009E73\""), 2);
    // Many keep their size and are one shape.
    let many = dots((0..100).map(|n| (f64::from(n / 2), 1.0)).collect());
    let (_, many) = many.split_once("<path fill=\"#009E73\"").unwrap();
    assert_eq!(count(many.split_once("/>").unwrap().0, "h4v4"), 50);
}

#[test]
fn long_legends_get_a_row_of_their_own() {
    let height = |name: &str| {
        let marks = (0..3).map(|_| Mark::line(name, BLUE_INK, vec![(0.0, 0.0), (1.0, 1.0)]));
        let svg = chart(marks.collect()).svg();
        let (_, rest) = svg.split_once("height=\"").unwrap();
        rest.split_once('"').unwrap().0.parse::<i32>().unwrap()
    };
    // Shown at half the drawn size.
    assert_eq!(
        height(&"long name ".repeat(3)),
        height("short") + 3 * ROW / 2
    );
}

#[test]
fn a_single_point_is_a_dot_in_the_middle_with_labels_that_differ() {
    let svg = chart(vec![Mark::line("", BLUE_INK, vec![(-0.4, 6.0)])]).svg();
    assert_eq!(count(&svg, "<circle"), 1);
    assert!(
        svg.contains(">−0.40</text>") && svg.contains(">6.0</text>"),
        "{svg}"
    );
    let labels: Vec<&str> = svg
        .split("text-anchor=\"end\"")
        .skip(1)
        .filter_map(|rest| rest.split_once('>')?.1.split_once('<'))
        .map(|(label, _)| label)
        .collect();
    let mut distinct = labels.clone();
    distinct.dedup();
    assert_eq!(labels, distinct);
}

#[test]
fn panels_side_by_side_share_one_legend() {
    let panel = || Panel {
        title: "y".into(),
        marks: vec![Mark::line(
            "only once",
            BLUE_INK,
            vec![(0.0, 1.0), (1.0, 2.0)],
        )],
        ..Panel::default()
    };
    let chart = Chart {
        columns: 2,
        one_legend: true,
        panels: (0..4).map(|_| panel()).collect(),
        ..Chart::default()
    };
    assert_eq!(count(&chart.svg(), ">only once</text>"), 1);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_numbers_give_a_figure_within_its_bounds(
        points in prop::collection::vec(
            (any::<f64>(), prop_oneof![Just(0.1), any::<f64>()]), 0..20,
        ),
        dashed: bool,
    ) {
        let mark = if dashed { Mark::dashed } else { Mark::line };
        let dots = Mark::Dots {
            name: "d".into(),
            colour: GREEN,
            size: 2,
            points: points.clone(),
        };
        let svg = chart(vec![mark("l", BLUE_INK, points), dots]).svg();
        prop_assert!(!svg.contains("NaN") && !svg.contains("inf"));
        for line in svg.lines().filter_map(|line| line.split_once("points=\"")) {
            let (points, _) = line.1.split_once('"').unwrap();
            for (x, y) in points.split_whitespace().filter_map(|point| point.split_once(',')) {
                let (x, y): (i32, i32) = (x.parse().unwrap(), y.parse().unwrap());
                prop_assert!((0..=WIDTH).contains(&x) && (0..=2000).contains(&y));
            }
        }
    }
}

#[test]
fn a_label_is_drawn_over_the_lines_with_a_margin_around_its_letters() {
    let svg = chart(vec![
        Mark::Label {
            at: (0.5, 0.5),
            centred: true,
            text: "name".into(),
        },
        Mark::Level {
            value: 0.5,
            colour: BLUE_INK,
        },
    ])
    .svg();
    let label = svg.find(r#"paint-order="stroke">name</text>"#).unwrap();
    let line = svg.find(r##"stroke="#0072B2""##).unwrap();
    assert!(line < label, "{svg}");
}

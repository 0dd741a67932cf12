//! The planar two-link arm among the bodies of a file.
//!
//! The arm moves across the axes of its hinges. Its link 1 goes from hinge to hinge, its link 2 from the second hinge to
//! the tip. Angles are measured as in [`painleve_shared::Arm`], with the belt's inward normal along gravity in that plane.

use std::f64::consts::TAU;
use std::str::FromStr;

use nalgebra::Vector3;
use painleve_shared::ArmParameters;

use super::chain::{Chain, Hinge, Mass, numbers};

/// Largest angle between parallel axes, rad: files round right angles.
const PARALLEL_RAD: f64 = 1e-3;

/// Largest distance of a centre of mass from its link's line that is not worth a note, relative to the link's length.
const ON_LINE: f64 = 1e-4;

/// The point of link 2 that touches the belt.
#[derive(Clone, Debug, PartialEq)]
pub enum Tip {
    /// A frame of the file.
    Frame(String),
    /// A point in the frame of the link that the second joint turns, m.
    Point(Vector3<f64>),
}

impl FromStr for Tip {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if !text.contains(',') {
            return Ok(Self::Frame(text.into()));
        }
        let numbers = numbers::<3>("a point", &text.replace(',', " "))?;
        Ok(Self::Point(numbers.into()))
    }
}

/// An arm of a file.
#[derive(Debug)]
pub struct Imported {
    /// The arm; its height is the default.
    pub arm: ArmParameters<f64>,
    /// What the file says and the arm cannot have, a part each.
    pub ignored: Vec<String>,
}

/// Returns the arm.
///
/// # Errors
/// The reason in one sentence.
pub fn arm(chain: &Chain, tip: Option<&Tip>) -> Result<Imported, String> {
    let [first, second] = hinges(chain)?;
    let links = links(chain, first.0, second.0);
    let (from, to) = (first.1, second.1);
    let across = from.axis.cross(&to.axis).norm();
    if across > PARALLEL_RAD {
        let degrees = across.asin().to_degrees();
        return Err(format!(
            "the axes of joints '{}' and '{}' are not parallel: {degrees:.3}° between them",
            from.name, to.name
        ));
    }
    let axis = from.axis;
    let in_plane = |vector: Vector3<f64>| vector - axis * axis.dot(&vector);
    let tip_m = tip_place(chain, &links, second.0, tip)?;
    let lines = [
        in_plane(to.anchor - from.anchor),
        in_plane(tip_m - to.anchor),
    ];
    let directions = lines.map(|line| line.try_normalize(1e-9));
    let [Some(along_1), Some(along_2)] = directions else {
        let link = if directions[0].is_none() { "1" } else { "2" };
        return Err(format!(
            "link {link} has no length across the axes of the joints"
        ));
    };
    let gravity = in_plane(chain.gravity_m_s2);
    let down = gravity.try_normalize(1e-9).unwrap_or(along_1);
    let angle =
        |from: &Vector3<f64>, to: &Vector3<f64>| axis.dot(&from.cross(to)).atan2(from.dot(to));
    let unused = chain.unused.iter();
    let unused = unused.map(|(what, number)| format!("{number} × {what}"));
    let mut ignored: Vec<String> = unused.collect();
    let mut centres = [0.0; 2];
    let mut inertias = [0.0; 2];
    let mut masses = [0.0; 2];
    for (k, (along, hinge)) in [(along_1, from), (along_2, to)].into_iter().enumerate() {
        let mass = mass(chain, &links, k + 1);
        if mass.kg <= 0.0 {
            return Err(format!(
                "link {} (behind joint '{}') has no mass",
                k + 1,
                hinge.name
            ));
        }
        let offset = in_plane(mass.centre - hinge.anchor);
        let beside_m = axis.dot(&along.cross(&offset));
        if beside_m.abs() > ON_LINE * lines[k].norm() {
            ignored.push(format!(
                "{:.3} mm by which the centre of mass of link {} lies beside its line",
                1e3 * beside_m.abs(),
                k + 1
            ));
        }
        masses[k] = mass.kg;
        centres[k] = offset.dot(&along);
        inertias[k] = axis.dot(&(mass.inertia * axis));
    }
    let hinges = [from, to];
    let pair = |value: fn(&Hinge) -> f64| hinges.map(|hinge| rounded(value(hinge)));
    // The second hinge may turn the other way round.
    let sense = from.axis.dot(&to.axis).signum();
    let rests = [
        angle(&down, &along_1) + from.spring_rest_rad,
        angle(&along_1, &along_2) + sense * to.spring_rest_rad,
    ];
    let stiffness = pair(|hinge| hinge.stiffness);
    let rest = |k: usize| {
        let turns = (rests[k] / TAU).round();
        if stiffness[k] == 0.0 {
            0.0
        } else {
            rounded(rests[k] - TAU * turns)
        }
    };
    let arm = ArmParameters {
        link_length_m: lines.map(|line| rounded(line.norm())),
        link_mass_kg: masses.map(rounded),
        link_centre_of_mass_m: Some(centres.map(rounded)),
        link_inertia_kg_m2: Some(inertias.map(rounded)),
        damping_nms_rad: pair(|hinge| hinge.damping),
        stiffness_nm_rad: stiffness,
        spring_rest_rad: [rest(0), rest(1)],
        coulomb_friction_nm: pair(|hinge| hinge.friction),
        rotor_inertia_kg_m2: pair(|hinge| hinge.rotor),
        gravity_m_s2: rounded(gravity.norm()),
        ..ArmParameters::default()
    };
    Ok(Imported { arm, ignored })
}

/// Returns both hinges, each with the index of the body that it carries.
fn hinges(chain: &Chain) -> Result<[(usize, &Hinge); 2], String> {
    let bodies = chain.bodies.iter().enumerate();
    let all = bodies.flat_map(|(index, body)| body.hinges.iter().map(move |hinge| (index, hinge)));
    let all: Vec<(usize, &Hinge)> = all.collect();
    let names = || quoted(all.iter().map(|(_, hinge)| &hinge.name));
    match all[..] {
        [first, second] if is_behind(chain, second.0, first.0) => Ok([first, second]),
        [first, second] if is_behind(chain, first.0, second.0) => Ok([second, first]),
        [_, _] => Err(format!(
            "joints {} do not follow each other: a two-link arm is a chain",
            names()
        )),
        [] => Err("it has no joint that turns: a planar two-link arm has two".into()),
        [_] => Err(format!(
            "it has only one joint that turns ({}): a planar two-link arm has two",
            names()
        )),
        _ => Err(format!(
            "it has {} joints that turn ({}): a planar two-link arm has two",
            all.len(),
            names()
        )),
    }
}

/// Returns names for a message.
fn quoted<'a>(names: impl Iterator<Item = &'a String>) -> String {
    let quoted: Vec<String> = names.map(|name| format!("'{name}'")).collect();
    quoted.join(", ")
}

/// Whether a body is carried by another one.
fn is_behind(chain: &Chain, body: usize, other: usize) -> bool {
    let carriers =
        std::iter::successors(chain.bodies[body].parent, |&body| chain.bodies[body].parent);
    carriers.into_iter().any(|carrier| carrier == other)
}

/// Returns the link of each body: 0 is the base.
fn links(chain: &Chain, first: usize, second: usize) -> Vec<usize> {
    let belongs = |body: usize, to: usize| body == to || is_behind(chain, body, to);
    let link = |body: usize| usize::from(belongs(body, first)) + usize::from(belongs(body, second));
    (0..chain.bodies.len()).map(link).collect()
}

/// Returns the mass of all bodies of a link.
fn mass(chain: &Chain, links: &[usize], link: usize) -> Mass {
    let bodies = chain
        .bodies
        .iter()
        .zip(links)
        .filter(|(_, of)| **of == link);
    bodies.fold(Mass::default(), |sum, (body, _)| sum.with(&body.mass))
}

/// Returns the tip's place; `second` is the body that the second hinge carries.
fn tip_place(
    chain: &Chain,
    links: &[usize],
    second: usize,
    tip: Option<&Tip>,
) -> Result<Vector3<f64>, String> {
    let bodies = || {
        chain
            .bodies
            .iter()
            .enumerate()
            .filter(|(body, _)| links[*body] == 2)
    };
    let frames = || {
        bodies().flat_map(|(body, of)| {
            of.frames
                .iter()
                .enumerate()
                .map(move |(k, frame)| (body, k, frame))
        })
    };
    match tip {
        Some(Tip::Point(point)) => Ok(chain.bodies[second]
            .pose
            .transform_point(&(*point).into())
            .coords),
        Some(Tip::Frame(name)) => {
            let found = frames().find(|(_, _, (frame, _))| frame == name);
            let all = || quoted(frames().map(|(_, _, (frame, _))| frame));
            found
                .map(|(_, _, (_, place))| *place)
                .ok_or_else(|| format!("--tip {name}: link 2 has no such frame, only {}", all()))
        }
        None => {
            // Bodies that carry none, and sites: the first frame of a body is its own.
            let carries = |body: usize| chain.bodies.iter().any(|other| other.parent == Some(body));
            let ends: Vec<_> = frames()
                .filter(|(body, k, _)| *k > 0 || (*body != second && !carries(*body)))
                .map(|(_, _, frame)| frame)
                .collect();
            match ends[..] {
                [(_, place)] => Ok(*place),
                [] => Err(
                    "link 2 has no frame at its end: say where the tip is with --tip X,Y,Z".into(),
                ),
                _ => Err(format!(
                    "link 2 has several frames at its end: choose one with --tip NAME: {}",
                    quoted(ends.iter().map(|(name, _)| name))
                )),
            }
        }
    }
}

/// Returns a number to nine significant digits: the tenth is the rounding of right angles.
pub fn rounded(number: f64) -> f64 {
    format!("{number:.8e}").parse().unwrap_or(number)
}

//! The bodies of a URDF file, in the configuration with all joints at zero.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use roxmltree::Node;

use super::chain::{Body, Chain, Hinge, Mass, direction, elements, label, numbers, symmetric};

/// The gravity that programs assume where URDF has none, m/s².
const GRAVITY_M_S2: f64 = 9.81;

/// Reads the bodies of `<robot>`.
///
/// # Errors
/// The reason in one sentence.
pub fn chain(robot: Node<'_, '_>) -> Result<Chain, String> {
    let mut chain = Chain {
        gravity_m_s2: Vector3::new(0.0, 0.0, -GRAVITY_M_S2),
        ..Chain::default()
    };
    chain.note_unused(robot, &["name", "version"], &["link", "joint"]);
    let mut links = BTreeMap::new();
    for link in elements(robot, "link") {
        if links.insert(name(link)?, link).is_some() {
            return Err(format!("there are two links '{}'", name(link)?));
        }
    }
    let mut joints: BTreeMap<&str, Vec<(&str, Node<'_, '_>)>> = BTreeMap::new();
    let mut children = BTreeSet::new();
    for joint in elements(robot, "joint") {
        let [parent, child] = ["parent", "child"].map(|end| {
            let link = elements(joint, end).find_map(|node| node.attribute("link"));
            let link = link.filter(|link| links.contains_key(link));
            link.ok_or_else(|| format!("joint '{}' has no {end} among the links", label(joint)))
        });
        let (parent, child) = (parent?, child?);
        if !children.insert(child) {
            return Err(format!("link '{child}' is the child of two joints"));
        }
        joints.entry(parent).or_default().push((child, joint));
    }
    let roots: Vec<&str> = links
        .keys()
        .copied()
        .filter(|link| !children.contains(link))
        .collect();
    let [root] = roots[..] else {
        return Err(format!(
            "{} links are no child of a joint: one must be the base",
            roots.len()
        ));
    };
    let mut ahead = vec![(root, Isometry3::identity(), None, Vec::new())];
    while let Some((link, pose, parent, hinges)) = ahead.pop() {
        let index = chain.bodies.len();
        let node = links[link];
        chain.note_unused(node, &["name"], &["inertial"]);
        chain.bodies.push(Body {
            parent,
            pose,
            hinges,
            mass: mass(node)?.placed(&pose),
            frames: vec![(link.into(), pose.translation.vector)],
        });
        for (child, joint) in joints.remove(link).unwrap_or_default() {
            let used = ["origin", "parent", "child", "axis", "dynamics"];
            chain.note_unused(joint, &["name", "type"], &used);
            let pose = pose * origin(joint)?;
            ahead.push((child, pose, Some(index), hinge(joint, &pose)?));
        }
    }
    Ok(chain)
}

fn name<'a>(node: Node<'a, '_>) -> Result<&'a str, String> {
    let missing = || format!("a <{}> has no name", node.tag_name().name());
    node.attribute("name").ok_or_else(missing)
}

/// Returns the pose of `<origin>` inside an element.
fn origin(node: Node<'_, '_>) -> Result<Isometry3<f64>, String> {
    let Some(origin) = elements(node, "origin").next() else {
        return Ok(Isometry3::identity());
    };
    let vector = |attribute: &str| {
        let what = format!(
            "<{}> '{}': {attribute}",
            node.tag_name().name(),
            label(node)
        );
        let text = origin.attribute(attribute);
        text.map_or(Ok([0.0; 3]), |text| numbers::<3>(&what, text))
    };
    let [roll, pitch, yaw] = vector("rpy")?;
    let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    Ok(Isometry3::from_parts(
        Translation3::from(Vector3::from(vector("xyz")?)),
        turn,
    ))
}

/// Returns the number of an attribute, 0 if it is absent.
fn number(node: Option<Node<'_, '_>>, attribute: &str, of: &str) -> Result<f64, String> {
    let text = node.and_then(|node| node.attribute(attribute));
    text.map_or(Ok(0.0), |text| {
        Ok(numbers::<1>(&format!("{of}: {attribute}"), text)?[0])
    })
}

fn mass(link: Node<'_, '_>) -> Result<Mass, String> {
    let Some(inertial) = elements(link, "inertial").next() else {
        return Ok(Mass::default());
    };
    let of = format!("link '{}'", label(link));
    let tensor = elements(inertial, "inertia").next();
    let mut moments = [0.0; 6];
    for (moment, attribute) in moments
        .iter_mut()
        .zip(["ixx", "iyy", "izz", "ixy", "ixz", "iyz"])
    {
        *moment = number(tensor, attribute, &of)?;
    }
    let mass = Mass {
        kg: number(elements(inertial, "mass").next(), "value", &of)?,
        centre: Vector3::zeros(),
        inertia: symmetric(moments),
    };
    Ok(mass.placed(&origin(inertial)?))
}

/// Returns the hinge of a joint in its pose, none if it is fixed.
fn hinge(joint: Node<'_, '_>, pose: &Isometry3<f64>) -> Result<Vec<Hinge>, String> {
    let of = format!("joint '{}'", label(joint));
    match joint.attribute("type").unwrap_or_default() {
        "fixed" => return Ok(Vec::new()),
        "revolute" | "continuous" => {}
        other => return Err(format!("{of} is {other}: the arm has two revolute joints")),
    }
    if elements(joint, "mimic").next().is_some() {
        return Err(format!(
            "{of} follows another joint: the arm's joints move by themselves"
        ));
    }
    let text = elements(joint, "axis").find_map(|axis| axis.attribute("xyz"));
    let what = format!("{of}: axis");
    let axis = text.map_or(Ok([1.0, 0.0, 0.0]), |text| numbers::<3>(&what, text))?;
    let dynamics = elements(joint, "dynamics").next();
    Ok(vec![Hinge {
        name: label(joint).into(),
        anchor: pose.translation.vector,
        axis: pose.rotation * direction(&what, axis)?,
        damping: number(dynamics, "damping", &of)?,
        friction: number(dynamics, "friction", &of)?,
        rotor: 0.0,
        stiffness: 0.0,
        spring_rest_rad: 0.0,
    }])
}

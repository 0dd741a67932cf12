//! What URDF and MJCF have in common: rigid bodies at their places in one configuration, joined by hinges.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Matrix3, Vector3};
use roxmltree::Node;

/// The bodies of a file, each after the one that carries it.
#[derive(Debug, Default)]
pub struct Chain {
    /// Gravity, m/s².
    pub gravity_m_s2: Vector3<f64>,
    /// The bodies.
    pub bodies: Vec<Body>,
    /// Elements and attributes that were not used, with their number.
    pub unused: BTreeMap<String, usize>,
}

/// A rigid body. All vectors are in the axes of the world.
#[derive(Debug)]
pub struct Body {
    /// The index of the body that carries it; none for the base.
    pub parent: Option<usize>,
    /// Its frame.
    pub pose: Isometry3<f64>,
    /// The hinges between it and the body that carries it.
    pub hinges: Vec<Hinge>,
    /// Its mass.
    pub mass: Mass,
    /// Points that have a name; the first is its own.
    pub frames: Vec<(String, Vector3<f64>)>,
}

/// A joint with one axis.
#[derive(Clone, Debug)]
pub struct Hinge {
    /// Its name in the file.
    pub name: String,
    /// A point of its axis, m.
    pub anchor: Vector3<f64>,
    /// The direction of its axis, a unit vector.
    pub axis: Vector3<f64>,
    /// N·m·s/rad.
    pub damping: f64,
    /// Coulomb friction, N·m.
    pub friction: f64,
    /// Inertia of the rotor at the joint, kg·m².
    pub rotor: f64,
    /// N·m/rad.
    pub stiffness: f64,
    /// Angle from the configuration of the poses at which the spring is relaxed, rad.
    pub spring_rest_rad: f64,
}

/// A mass with its distribution.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mass {
    /// kg.
    pub kg: f64,
    /// Centre of mass, m.
    pub centre: Vector3<f64>,
    /// Inertia about the centre of mass, kg·m².
    pub inertia: Matrix3<f64>,
}

impl Mass {
    /// Returns this mass as it lies in the world if it is described in a frame with this pose.
    pub fn placed(&self, pose: &Isometry3<f64>) -> Self {
        let turn = pose.rotation.to_rotation_matrix();
        Self {
            kg: self.kg,
            centre: pose.rotation * self.centre + pose.translation.vector,
            inertia: turn * self.inertia * turn.transpose(),
        }
    }

    /// Returns both masses joined rigidly.
    pub fn with(&self, other: &Self) -> Self {
        let kg = self.kg + other.kg;
        if kg == 0.0 {
            return Self::default();
        }
        let centre = (self.kg * self.centre + other.kg * other.centre) / kg;
        let about_centre = |mass: &Self| {
            let arm = mass.centre - centre;
            let square = Matrix3::identity() * arm.norm_squared() - arm * arm.transpose();
            mass.inertia + mass.kg * square
        };
        Self {
            kg,
            centre,
            inertia: about_centre(self) + about_centre(other),
        }
    }
}

impl Chain {
    /// Notes the attributes and the elements inside an element that this program does not use.
    pub fn note_unused(&mut self, node: Node<'_, '_>, attributes: &[&str], children: &[&str]) {
        let tag = node.tag_name().name();
        for attribute in node.attributes() {
            if !attributes.contains(&attribute.name()) {
                let what = format!("{tag} {}", attribute.name());
                *self.unused.entry(what).or_default() += 1;
            }
        }
        for child in node.children().filter(Node::is_element) {
            let tag = child.tag_name().name();
            if !children.contains(&tag) {
                *self.unused.entry(format!("<{tag}>")).or_default() += 1;
            }
        }
    }
}

/// Returns the elements inside another one that have this tag.
pub fn elements<'a>(
    node: Node<'a, 'a>,
    tag: &'static str,
) -> impl DoubleEndedIterator<Item = Node<'a, 'a>> {
    node.children().filter(move |child| child.has_tag_name(tag))
}

/// Returns how an element is called in messages.
pub fn label<'a>(node: Node<'a, '_>) -> &'a str {
    node.attribute("name").unwrap_or("without name")
}

/// Reads the numbers of an attribute; `what` names it.
pub fn list(what: &str, text: &str) -> Result<Vec<f64>, String> {
    let number = |part: &str| part.parse().ok().filter(|number: &f64| number.is_finite());
    text.split_whitespace()
        .map(|part| number(part).ok_or_else(|| format!("{what} = '{text}': expected numbers")))
        .collect()
}

/// Reads as many numbers as an attribute must have.
pub fn numbers<const N: usize>(what: &str, text: &str) -> Result<[f64; N], String> {
    let expected = match N {
        1 => "one number".into(),
        _ => format!("{N} numbers"),
    };
    list(what, text)?
        .try_into()
        .map_err(|_| format!("{what} = '{text}': expected {expected}"))
}

/// Returns the direction of a vector; `what` names it.
pub fn direction(what: &str, vector: [f64; 3]) -> Result<Vector3<f64>, String> {
    Vector3::from(vector)
        .try_normalize(1e-9)
        .ok_or_else(|| format!("{what} has no direction"))
}

/// Returns a symmetric matrix from its elements xx, yy, zz, xy, xz, yz.
pub fn symmetric([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> Matrix3<f64> {
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

//! The bodies of an MJCF file, in the configuration of its poses.

use std::collections::HashMap;

use nalgebra::{Isometry3, Quaternion, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};
use roxmltree::{Node, NodeId};

use super::chain::{
    Body, Chain, Hinge, Mass, direction, elements, label, list, numbers, symmetric,
};
use super::shape::Shape;

/// MuJoCo's gravity, m/s².
const GRAVITY_M_S2: [f64; 3] = [0.0, 0.0, -9.81];

/// MuJoCo's density, kg/m³.
const DENSITY_KG_M3: &str = "1000";

/// Where a body lies and how it is turned.
const POSE: [&str; 6] = ["pos", "quat", "axisangle", "euler", "xyaxes", "zaxis"];

/// What hides bodies or joints from a reader of the file.
const HIDING: [&str; 5] = ["include", "replicate", "composite", "flexcomp", "attach"];

/// What the whole file agrees on.
struct Reader<'a> {
    root: Node<'a, 'a>,
    defaults: Defaults<'a>,
    /// Radians in a unit of angles.
    unit_rad: f64,
    euler_sequence: &'a str,
    /// Whether the masses of geoms count in bodies with and without `<inertial>`.
    counts_geoms: [bool; 2],
}

/// The `<default>`s of a file. They are looked up for every attribute, so searching the file each time would take the
/// square of its length.
struct Defaults<'a> {
    /// The first one.
    first: Option<Node<'a, 'a>>,
    of_class: HashMap<&'a str, Node<'a, 'a>>,
    /// The nearest `childclass` around an element.
    class_around: HashMap<NodeId, &'a str>,
}

impl<'a> Defaults<'a> {
    fn of(root: Node<'a, 'a>) -> Self {
        let all = || {
            root.descendants()
                .filter(|node| node.has_tag_name("default"))
        };
        let with_class = all().filter_map(|node| Some((node.attribute("class")?, node)));
        let mut class_around = HashMap::new();
        // Each element comes after the one around it.
        for node in root.descendants() {
            let around = node.parent().and_then(|parent| {
                let own = parent.attribute("childclass");
                own.or_else(|| class_around.get(&parent.id()).copied())
            });
            class_around.extend(around.map(|class| (node.id(), class)));
        }
        Self {
            first: all().next(),
            // Of two with one name, the first counts.
            of_class: with_class.rev().collect(),
            class_around,
        }
    }

    /// Returns the `<default>` of an element: that of its class, of the nearest `childclass` around it, or the first.
    fn of_element(&self, node: Node<'a, 'a>) -> Option<Node<'a, 'a>> {
        let around = || self.class_around.get(&node.id()).copied();
        match node.attribute("class").or_else(around) {
            Some(class) => self.of_class.get(class).copied(),
            None => self.first,
        }
    }
}

/// Reads the bodies of `<mujoco>`.
///
/// # Errors
/// The reason in one sentence.
pub fn chain<'a>(root: Node<'a, 'a>) -> Result<Chain, String> {
    if let Some(node) = root
        .descendants()
        .find(|node| HIDING.contains(&node.tag_name().name()))
    {
        return Err(format!(
            "it uses <{}>: save the whole model with MuJoCo's mj_saveLastXML first",
            node.tag_name().name()
        ));
    }
    let mut chain = Chain::default();
    let sections = ["compiler", "option", "default", "worldbody"];
    chain.note_unused(root, &["model"], &sections);
    let compilers = || elements(root, "compiler");
    let setting = |name: &str| {
        compilers()
            .filter_map(|node| node.attribute(name))
            .next_back()
    };
    for compiler in compilers() {
        chain.note_unused(
            compiler,
            &["angle", "eulerseq", "inertiafromgeom", "autolimits"],
            &[],
        );
    }
    let reader = Reader {
        root,
        defaults: Defaults::of(root),
        unit_rad: match setting("angle") {
            Some("radian") => 1.0,
            _ => 1_f64.to_radians(),
        },
        euler_sequence: setting("eulerseq").unwrap_or("xyz"),
        counts_geoms: match setting("inertiafromgeom") {
            Some("true") => [true; 2],
            Some("false") => [false; 2],
            _ => [false, true],
        },
    };
    let gravity = elements(root, "option")
        .filter_map(|node| node.attribute("gravity"))
        .next_back();
    let gravity = gravity.map_or(Ok(GRAVITY_M_S2), |text| numbers("option: gravity", text))?;
    chain.gravity_m_s2 = gravity.into();
    reader.read_bodies(&mut chain)?;
    Ok(chain)
}

fn described(node: Node<'_, '_>) -> String {
    format!("{} '{}'", node.tag_name().name(), label(node))
}

impl<'a> Reader<'a> {
    /// Reads the world and all bodies in it, each after the one that carries it.
    fn read_bodies(&self, chain: &mut Chain) -> Result<(), String> {
        let worlds: Vec<_> = elements(self.root, "worldbody").collect();
        let [world] = worlds[..] else {
            return Err(format!(
                "it has {} <worldbody> instead of one",
                worlds.len()
            ));
        };
        chain
            .bodies
            .push(body("world", Isometry3::identity(), None));
        let mut ahead = vec![(world, Isometry3::identity(), 0, false)];
        while let Some((node, pose, index, counts_geoms)) = ahead.pop() {
            let attributes = [&POSE[..], &["name", "childclass"]].concat();
            let used = [
                "body",
                "frame",
                "inertial",
                "joint",
                "freejoint",
                "geom",
                "site",
            ];
            chain.note_unused(node, &attributes, &used);
            for part in node.children().filter(Node::is_element) {
                match part.tag_name().name() {
                    "body" => {
                        let pose = pose * self.pose(part)?;
                        let has_inertial = elements(part, "inertial").next().is_some();
                        let counts_geoms = self.counts_geoms[usize::from(!has_inertial)];
                        ahead.push((part, pose, chain.bodies.len(), counts_geoms));
                        chain.bodies.push(body(label(part), pose, Some(index)));
                    }
                    // It belongs to the body around it.
                    "frame" => ahead.push((part, pose * self.pose(part)?, index, counts_geoms)),
                    "joint" => {
                        let hinge = self.hinge(chain, part, &pose)?;
                        chain.bodies[index].hinges.push(hinge);
                    }
                    "freejoint" => {
                        return Err(format!(
                            "{} floats: an arm stands on a base",
                            described(node)
                        ));
                    }
                    "inertial" if !counts_geoms => {
                        chain.note_unused(
                            part,
                            &[&POSE[..], &["mass", "diaginertia", "fullinertia"]].concat(),
                            &[],
                        );
                        let mass = self.inertial(node, part)?.placed(&pose);
                        chain.bodies[index].mass = mass;
                    }
                    "geom" if counts_geoms => {
                        let mass = self.geom(part)?.placed(&pose);
                        chain.bodies[index].mass = chain.bodies[index].mass.with(&mass);
                    }
                    "site" => {
                        let at = pose * self.pose(part)?;
                        chain.bodies[index]
                            .frames
                            .push((label(part).into(), at.translation.vector));
                    }
                    _ => {}
                }
            }
        }
        Ok(())
    }

    /// Returns an attribute of an element, or that of its default class.
    fn attribute(&self, node: Node<'a, 'a>, name: &str) -> Option<&'a str> {
        let own = node.attribute(name);
        own.or_else(|| {
            let tag = node.tag_name().name();
            let mut class = self.defaults.of_element(node);
            while let Some(defaults) = class {
                let element = defaults.children().find(|child| child.has_tag_name(tag));
                if let Some(text) = element.and_then(|element| element.attribute(name)) {
                    return Some(text);
                }
                class = defaults
                    .parent()
                    .filter(|parent| parent.has_tag_name("default"));
            }
            None
        })
    }

    /// Returns the numbers of an attribute of an element, if it has it.
    fn numbers<const N: usize>(
        &self,
        node: Node<'a, 'a>,
        name: &str,
    ) -> Result<Option<[f64; N]>, String> {
        let what = || format!("{}: {name}", described(node));
        self.attribute(node, name)
            .map(|text| numbers(&what(), text))
            .transpose()
    }

    fn number(&self, node: Node<'a, 'a>, name: &str) -> Result<f64, String> {
        Ok(self
            .numbers::<1>(node, name)?
            .map_or(0.0, |[number]| number))
    }

    /// Returns the pose of an element in the body around it.
    fn pose(&self, node: Node<'a, 'a>) -> Result<Isometry3<f64>, String> {
        let at = Vector3::from(self.numbers(node, "pos")?.unwrap_or_default());
        Ok(Isometry3::from_parts(
            Translation3::from(at),
            self.turn(node)?,
        ))
    }

    fn turn(&self, node: Node<'a, 'a>) -> Result<UnitQuaternion<f64>, String> {
        let what = described(node);
        if let Some([w, x, y, z]) = self.numbers(node, "quat")? {
            let quaternion = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-9);
            return quaternion.ok_or_else(|| format!("{what}: quat has no direction"));
        }
        if let Some([x, y, z, angle]) = self.numbers(node, "axisangle")? {
            let axis = Unit::new_unchecked(direction(&what, [x, y, z])?);
            return Ok(UnitQuaternion::from_axis_angle(
                &axis,
                angle * self.unit_rad,
            ));
        }
        if let Some([x1, x2, x3, y1, y2, y3]) = self.numbers(node, "xyaxes")? {
            let x = direction(&what, [x1, x2, x3])?;
            let y = Vector3::new(y1, y2, y3);
            let y = direction(&what, (y - x * x.dot(&y)).into())?;
            let axes = Rotation3::from_basis_unchecked(&[x, y, x.cross(&y)]);
            return Ok(UnitQuaternion::from_rotation_matrix(&axes));
        }
        if let Some(z) = self.numbers::<3>(node, "zaxis")? {
            return Ok(turn_of_z(&direction(&what, z)?));
        }
        let mut turn = UnitQuaternion::identity();
        if let Some(angles) = self.numbers::<3>(node, "euler")? {
            for (axis, angle) in self.euler_sequence.chars().zip(angles) {
                let direction = match axis.to_ascii_lowercase() {
                    'x' => Vector3::x_axis(),
                    'y' => Vector3::y_axis(),
                    'z' => Vector3::z_axis(),
                    _ => {
                        return Err(format!(
                            "compiler: eulerseq = '{}': expected x, y and z",
                            self.euler_sequence
                        ));
                    }
                };
                let one = UnitQuaternion::from_axis_angle(&direction, angle * self.unit_rad);
                // Capital letters are axes that stay.
                turn = if axis.is_lowercase() {
                    turn * one
                } else {
                    one * turn
                };
            }
        }
        Ok(turn)
    }

    fn inertial(&self, body: Node<'a, 'a>, node: Node<'a, 'a>) -> Result<Mass, String> {
        let mut moments = [0.0; 6];
        match (
            self.numbers::<6>(node, "fullinertia")?,
            self.numbers::<3>(node, "diaginertia")?,
        ) {
            (Some(full), _) => moments = full,
            (None, Some(diagonal)) => moments[..3].copy_from_slice(&diagonal),
            (None, None) => return Err(format!("{}: <inertial> has no inertia", described(body))),
        }
        let mass = Mass {
            kg: self.number(node, "mass")?,
            centre: Vector3::zeros(),
            inertia: symmetric(moments),
        };
        Ok(mass.placed(&self.pose(node)?))
    }

    /// Returns the mass of a geom in the body around it.
    fn geom(&self, node: Node<'a, 'a>) -> Result<Mass, String> {
        let what = described(node);
        let size = self.attribute(node, "size");
        let mut size = list(&format!("{what}: size"), size.unwrap_or_default())?;
        let ends = self.numbers::<6>(node, "fromto")?;
        let pose = match ends {
            None => self.pose(node)?,
            Some([x1, y1, z1, x2, y2, z2]) => {
                let [from, to] = [Vector3::new(x1, y1, z1), Vector3::new(x2, y2, z2)];
                let across = size.first().copied().unwrap_or_default();
                let half = 0.5 * (to - from).norm();
                size = match self.attribute(node, "type") {
                    Some("box" | "ellipsoid") => vec![across, across, half],
                    _ => vec![across, half],
                };
                let turn = turn_of_z(&direction(&what, (to - from).into())?);
                Isometry3::from_parts(Translation3::from(0.5 * (from + to)), turn)
            }
        };
        let shape = match (self.attribute(node, "type").unwrap_or("sphere"), &size[..]) {
            ("plane" | "hfield", _) => return Ok(Mass::default()),
            ("sphere", &[radius, ..]) => Shape::Sphere(radius),
            ("capsule", &[radius, half, ..]) => Shape::Capsule(radius, half),
            ("cylinder", &[radius, half, ..]) => Shape::Cylinder(radius, half),
            ("ellipsoid", &[a, b, c]) => Shape::Ellipsoid([a, b, c]),
            ("box", &[a, b, c]) => Shape::Box([a, b, c]),
            (other, _) => {
                return Err(format!(
                    "{what}: a {other} of size {size:?} has no known mass: give its body an <inertial>"
                ));
            }
        };
        let density = || self.attribute(node, "density").unwrap_or(DENSITY_KG_M3);
        let kg = match self.numbers::<1>(node, "mass")? {
            Some([kg]) => kg,
            None => numbers::<1>(&format!("{what}: density"), density())?[0] * shape.volume_m3(),
        };
        Ok(shape.mass(kg).placed(&pose))
    }

    fn hinge(
        &self,
        chain: &mut Chain,
        node: Node<'a, 'a>,
        pose: &Isometry3<f64>,
    ) -> Result<Hinge, String> {
        let of = described(node);
        let used = [
            "name",
            "class",
            "type",
            "pos",
            "axis",
            "damping",
            "frictionloss",
            "armature",
            "stiffness",
            "springref",
            "ref",
        ];
        chain.note_unused(node, &used, &[]);
        let kind = self.attribute(node, "type").unwrap_or("hinge");
        if kind != "hinge" {
            return Err(format!("{of} is a {kind}: the arm has two hinges"));
        }
        let axis = self.numbers(node, "axis")?.unwrap_or([0.0, 0.0, 1.0]);
        let at = Vector3::from(self.numbers(node, "pos")?.unwrap_or_default());
        Ok(Hinge {
            name: label(node).into(),
            anchor: pose.rotation * at + pose.translation.vector,
            axis: pose.rotation * direction(&of, axis)?,
            damping: self.number(node, "damping")?,
            friction: self.number(node, "frictionloss")?,
            rotor: self.number(node, "armature")?,
            stiffness: self.number(node, "stiffness")?,
            spring_rest_rad: (self.number(node, "springref")? - self.number(node, "ref")?)
                * self.unit_rad,
        })
    }
}

fn body(name: &str, pose: Isometry3<f64>, parent: Option<usize>) -> Body {
    Body {
        parent,
        pose,
        hinges: Vec::new(),
        mass: Mass::default(),
        frames: vec![(name.into(), pose.translation.vector)],
    }
}

/// Returns the shortest turn that brings z to this direction.
fn turn_of_z(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    let half_turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    UnitQuaternion::rotation_between(&Vector3::z(), direction).unwrap_or(half_turn)
}

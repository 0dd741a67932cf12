#![allow(clippy::unwrap_used)]

use std::f64::consts::PI;

use painleve_shared::ArmParameters;

use super::planar::Tip;
use super::read;

const URDF: &str = include_str!("../../../../examples/two-link.urdf");

/// The arm of the example, as MuJoCo's users write one: in degrees, with default classes, a frame, and bodies that turn.
const MJCF: &str = r#"<mujoco>
  <option gravity="0 0 -9.81"/>
  <default>
    <joint axis="0 1 0" damping="0.004"/>
    <default class="shoulder"><joint damping="0.006" frictionloss="0.002"/></default>
  </default>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="upper" pos="0 0.04 1.2">
      <joint name="shoulder" class="shoulder"/>
      <inertial pos="0 0 -0.11" mass="0.18" diaginertia="0.0011 0.0012 0.0001"/>
      <body name="elbow-motor" pos="0 0 -0.22">
        <inertial pos="0 0 0" mass="0.06" diaginertia="2e-5 2e-5 2e-5"/>
      </body>
      <frame euler="0 90 0">
        <body name="lower" pos="0.24 0.03 0" euler="0 -90 0">
          <joint name="elbow"/>
          <inertial pos="0 0 -0.1" mass="0.1" diaginertia="0.00035 0.00036 0.00002"/>
          <site name="tip" pos="0 0 -0.2"/>
        </body>
      </frame>
    </body>
  </worldbody>
</mujoco>"#;

fn arm(text: &str) -> ArmParameters<f64> {
    read(text, None).unwrap().arm
}

fn refusal(text: &str) -> String {
    read(text, None).unwrap_err()
}

#[test]
fn a_urdf_gives_lengths_masses_and_friction_of_both_links() {
    let read = read(URDF, None).unwrap();
    // The motor, 0.06 kg at 0.22 m, belongs to link 1.
    let centre = (0.18 * 0.11 + 0.06 * 0.22) / 0.24;
    let inertia =
        0.0012 + 0.18 * (centre - 0.11_f64).powi(2) + 2e-5 + 0.06 * (0.22 - centre).powi(2);
    let close = |found: [f64; 2], expected: [f64; 2]| {
        for (found, expected) in found.into_iter().zip(expected) {
            assert!(
                (found - expected).abs() < 1e-8 * expected.max(1e-3),
                "{found} {expected}"
            );
        }
    };
    let arm = read.arm;
    close(arm.link_length_m, [0.24, 0.2]);
    close(arm.link_mass_kg, [0.24, 0.1]);
    close(arm.link_centre_of_mass_m.unwrap(), [centre, 0.1]);
    close(arm.link_inertia_kg_m2.unwrap(), [inertia, 0.00036]);
    close(arm.damping_nms_rad, [0.006, 0.004]);
    close(arm.coulomb_friction_nm, [0.002, 0.0]);
    assert_eq!(arm.stiffness_nm_rad, [0.0; 2]);
    assert_eq!(read.ignored, ["1 × <limit>", "1 × <visual>"]);
}

#[test]
fn the_same_arm_in_mjcf_gives_the_same_arm() {
    assert_eq!(arm(MJCF), arm(URDF));
}

/// Poses with other axes, other zeros of the joints and another direction of the elbow are the same arm.
#[test]
fn the_arm_does_not_depend_on_how_the_file_places_it() {
    let turned = URDF
        .replace(
            r#"<origin xyz="0 0 1.2"/>"#,
            r#"<origin xyz="1 2 3" rpy="0 0 0.7"/>"#,
        )
        .replace(
            r#"<origin xyz="0 0.04 0"/>"#,
            r#"<origin xyz="0 0.04 0" rpy="0 1.1 0"/>"#,
        )
        .replace(
            "<origin xyz=\"0 0.03 -0.24\"/>\n    <axis xyz=\"0 1 0\"/>",
            "<origin xyz=\"0 0.03 -0.24\" rpy=\"0 -0.6 0\"/>\n    <axis xyz=\"0 -2 0\"/>",
        );
    assert_ne!(turned, URDF);
    assert_eq!(arm(&turned), arm(URDF));
}

#[test]
fn only_gravity_across_the_axes_acts() {
    let gravity = |gravity: &str| {
        let text = MJCF.replace("0 0 -9.81", gravity);
        arm(&text).gravity_m_s2
    };
    assert_eq!(gravity("3 0 -4"), 5.0);
    assert_eq!(gravity("0 9.81 0"), 0.0);
    assert_eq!(gravity("0 7 -2"), 2.0);
}

/// Springs are relaxed at angles of the model: link 1's from gravity, link 2's from link 1.
#[test]
fn springs_are_relaxed_where_the_file_says() {
    let sprung = MJCF
        .replace(
            r#"class="shoulder"/>"#,
            r#"class="shoulder" stiffness="2" springref="10"/>"#,
        )
        .replace(
            r#"<joint name="elbow"/>"#,
            r#"<joint name="elbow" stiffness="3" springref="-20" ref="5" armature="1e-4"/>"#,
        )
        .replace(r#"euler="0 -90 0""#, r#"euler="0 -60 0""#);
    let arm = arm(&sprung);
    assert_eq!(arm.stiffness_nm_rad, [2.0, 3.0]);
    assert_eq!(arm.rotor_inertia_kg_m2, [0.0, 1e-4]);
    let degrees = arm.spring_rest_rad.map(|rest| rest * 180.0 / PI);
    assert!((degrees[0] - 10.0).abs() < 1e-5, "{degrees:?}");
    assert!((degrees[1] - (30.0 - 25.0)).abs() < 1e-5, "{degrees:?}");
}

#[test]
fn a_tip_without_frame_is_given_as_a_point() {
    let text = URDF.replace(r#""0 0 -0.2""#, r#""0 0 -0.15""#);
    let tip: Tip = "0,0,-0.2".parse().unwrap();
    assert_eq!(read(&text, Some(&tip)).unwrap().arm, arm(URDF));
    let named = read(&text, Some(&"tip".parse().unwrap())).unwrap();
    assert_eq!(named.arm.link_length_m[1], 0.15);
    let unknown = read(&text, Some(&"hand".parse().unwrap())).unwrap_err();
    assert_eq!(
        unknown,
        "--tip hand: link 2 has no such frame, only 'lower', 'tip'"
    );
    assert!("0,0".parse::<Tip>().is_err());
}

#[test]
fn a_centre_of_mass_beside_the_line_is_named() {
    let text = URDF.replace(r#"xyz="0 0 -0.1""#, r#"xyz="0.0025 0 -0.1""#);
    let read = read(&text, None).unwrap();
    let named = "2.500 mm by which the centre of mass of link 2 lies beside its line";
    assert!(read.ignored.contains(&named.into()), "{:?}", read.ignored);
}

#[test]
fn what_is_no_planar_two_link_arm_is_refused_with_the_reason() {
    let mount = "name=\"mount\" type=\"fixed\"";
    let cases = [
        (
            URDF,
            "</robot>",
            "",
            "the root node was opened but never closed",
        ),
        (
            URDF,
            "type=\"continuous\"",
            "type=\"prismatic\"",
            "joint 'shoulder' is prismatic: the arm has two revolute joints",
        ),
        (
            URDF,
            "type=\"continuous\"",
            "type=\"fixed\"",
            "it has only one joint that turns ('elbow')",
        ),
        (
            URDF,
            mount,
            "name=\"mount\" type=\"revolute\"",
            "it has 3 joints that turn ('mount', 'shoulder', 'elbow')",
        ),
        (
            URDF,
            "<axis xyz=\"0 1 0\"/>\n    <limit",
            "<axis xyz=\"0.1 1 0\"/>\n    <limit",
            "are not parallel: 5.711° between them",
        ),
        (
            URDF,
            "<axis xyz=\"0 1 0\"/>\n    <limit",
            "<axis xyz=\"0 0 0\"/>\n    <limit",
            "joint 'elbow': axis has no direction",
        ),
        (
            URDF,
            "<parent link=\"upper\"/>\n    <child link=\"lower\"",
            "<parent link=\"base\"/>\n    <child link=\"lower\"",
            "do not follow each other",
        ),
        (
            URDF,
            "<parent link=\"lower\"",
            "<parent link=\"nothing\"",
            "joint 'fingertip' has no parent among the links",
        ),
        (
            URDF,
            "<child link=\"tip\"",
            "<child link=\"lower\"",
            "link 'lower' is the child of two joints",
        ),
        (
            URDF,
            "<mass value=\"0.1\"/>",
            "",
            "link 2 (behind joint 'elbow') has no mass",
        ),
        (
            URDF,
            "<mass value=\"0.1\"/>",
            "<mass value=\"much\"/>",
            "link 'lower': value = 'much': expected numbers",
        ),
        (
            URDF,
            "<mass value=\"0.1\"/>",
            "<mass value=\"inf\"/>",
            "link 'lower': value = 'inf': expected numbers",
        ),
        (
            URDF,
            "xyz=\"0 0.03 -0.24\"",
            "xyz=\"0 0.03\"",
            "<joint> 'elbow': xyz = '0 0.03': expected 3 numbers",
        ),
        (
            URDF,
            "xyz=\"0 0.03 -0.24\"",
            "xyz=\"0 0.03 0\"",
            "link 1 has no length",
        ),
        (
            URDF,
            "<link name=\"tip\"/>",
            "<link name=\"tip\"/><link name=\"spare\"/>",
            "2 links are no child of a joint",
        ),
        (
            MJCF,
            "<site name=\"tip\" pos=\"0 0 -0.2\"/>",
            "",
            "link 2 has no frame at its end",
        ),
        (
            MJCF,
            "<site name=\"tip\"",
            "<site name=\"pen\"/><site name=\"tip\"",
            "choose one with --tip NAME: 'pen', 'tip'",
        ),
        (
            MJCF,
            "<joint name=\"elbow\"/>",
            "<joint name=\"elbow\" type=\"slide\"/>",
            "joint 'elbow' is a slide",
        ),
        (
            MJCF,
            "<joint name=\"elbow\"/>",
            "<freejoint/>",
            "body 'lower' floats",
        ),
        (
            MJCF,
            "<worldbody>",
            "<include file=\"arm.xml\"/><worldbody>",
            "it uses <include>",
        ),
        (MJCF, "worldbody>", "world>", "it has 0 <worldbody>"),
        (MJCF, "mujoco>", "sdf>", "<sdf> is neither"),
    ];
    for (file, from, to, expected) in cases {
        let text = file.replace(from, to);
        assert_ne!(text, file, "{from}");
        let message = refusal(&text);
        assert!(message.contains(expected), "{message}\n{expected}");
    }
}

#[test]
fn a_file_with_very_many_elements_is_refused() {
    let bodies = "<body>".repeat(20_000) + &"</body>".repeat(20_000);
    let message = refusal(&format!("<mujoco><worldbody>{bodies}</worldbody></mujoco>"));
    assert!(message.contains("nodes limit"), "{message}");
}

#[test]
fn deeply_nested_bodies_take_no_time_of_their_square() {
    let depth = 1000;
    let text = format!(
        "<mujoco><worldbody>{}{}</worldbody></mujoco>",
        r#"<body><geom size="0.1"/>"#.repeat(depth),
        "</body>".repeat(depth)
    );
    let start = std::time::Instant::now();
    refusal(&text);
    assert!(start.elapsed().as_secs_f64() < 0.5);
}

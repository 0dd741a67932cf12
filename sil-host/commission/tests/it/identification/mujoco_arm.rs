//! An arm on its belt whose mechanics are MuJoCo's, in a Python program of its own (`mujoco_rig.py`).
//!
//! It has the lengths, masses, springs, damping, joint friction and rotors of a scenario's arm, on a flat belt of constant speed and friction.
//! Waves, vibration and seam of the belt, patches of other friction, play of the gears, payloads, pushes and static friction of the joints
//! belong to our own plant and do not exist here.

use std::io::{BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::OnceLock;

use painleve_plant::mechanics::motion::theta;
use painleve_plant::scenario::Scenario;
use painleve_plant::{ContactMode, Event, Plant, PlantError, Probe, Snapshot, State, Step};
use painleve_shared::{JointTorque, LinkMotion, OutOfRange, Slip};

/// The version of which the measured figures are.
const MUJOCO: &str = "mujoco==4.0.0";

/// Slip velocity below which a pressed tip sticks, m/s, as on our own compliant contact.
const STICK_M_S: f64 = 1e-3;

/// Doubles of an answer.
const VALUES: usize = 10;

/// Returns a Python that has MuJoCo; says what is skipped where it cannot be installed.
pub fn python() -> Option<&'static Path> {
    static PYTHON: OnceLock<Option<PathBuf>> = OnceLock::new();
    let python = PYTHON.get_or_init(|| painleve_tests::python::python("mujoco", &[MUJOCO]));
    python.as_deref()
}

/// The arm.
pub struct MujocoArm {
    program: Child,
    commands: BufWriter<ChildStdin>,
    answers: BufReader<ChildStdout>,
    belt_speed_m_s: f64,
    now: Snapshot,
}

impl MujocoArm {
    /// Starts the arm of a scenario, whose joints bend by a milliradian before they slip, as ours do.
    ///
    /// # Errors
    /// [`OutOfRange`] if the arm does not reach its start.
    pub fn new(scenario: &Scenario) -> Result<Self, OutOfRange> {
        Self::with_bristles(scenario, 1e-3)
    }

    /// Starts the arm of a scenario, whose joints stick without bending, by MuJoCo's own friction.
    ///
    /// # Errors
    /// [`OutOfRange`] if the arm does not reach its start.
    pub fn without_bristles(scenario: &Scenario) -> Result<Self, OutOfRange> {
        Self::with_bristles(scenario, 0.0)
    }

    fn with_bristles(scenario: &Scenario, bristles_rad: f64) -> Result<Self, OutOfRange> {
        assert_eq!(scenario.converters.torque.lag_s, 0.0, "it has no lag");
        let arm = scenario.moving_arm();
        assert_eq!(arm.tip_mass_kg, 0.0, "its tip has no mass");
        assert!(arm.link_centre_of_mass_m.is_none() && arm.link_inertia_kg_m2.is_none());
        let joints = &scenario.effects.joints;
        let [length_1, length_2] = arm.link_length_m;
        let [mass_1, mass_2] = arm.link_mass_kg;
        let pairs = [
            ("length", arm.link_length_m),
            ("mass", arm.link_mass_kg),
            ("centre", arm.link_length_m.map(|length_m| length_m / 2.0)),
            (
                "inertia",
                [mass_1 * length_1 * length_1, mass_2 * length_2 * length_2].map(|it| it / 12.0),
            ),
            ("rotor", arm.rotor_inertia_kg_m2),
            (
                "damping",
                arm.damping_nms_rad.map(|it| it + joints.viscous_nms_rad),
            ),
            ("stiffness", arm.stiffness_nm_rad),
            ("rest", arm.spring_rest_rad),
            (
                "friction",
                arm.coulomb_friction_nm.map(|it| it + joints.coulomb_nm),
            ),
            (
                "theta",
                theta(&scenario.initial.state(&scenario.arm)?).to_array(),
            ),
        ];
        let belt_speed_m_s = scenario.belt.profile.speed_m_s(0.0);
        let singles = [
            ("gravity", arm.gravity_m_s2),
            ("tilt", arm.belt_tilt_rad),
            ("height", arm.height_m),
            ("belt", belt_speed_m_s),
            ("mu", scenario.belt.friction),
            ("bristles", bristles_rad),
        ];
        let of_pairs = pairs.iter().flat_map(|(name, [one, two])| {
            [format!("{name}1={one:?}"), format!("{name}2={two:?}")]
        });
        let of_singles = singles
            .iter()
            .map(|(name, value)| format!("{name}={value:?}"));
        let source = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/tests/it/identification/mujoco_rig.py"
        );
        let mut program = Command::new(python().unwrap())
            .arg(source)
            .args(of_pairs.chain(of_singles))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut arm = Self {
            commands: BufWriter::new(program.stdin.take().unwrap()),
            answers: BufReader::new(program.stdout.take().unwrap()),
            program,
            belt_speed_m_s,
            now: Snapshot::default(),
        };
        arm.now = arm.answer(0.0).unwrap();
        Ok(arm)
    }

    /// Reads the arm at a time, under the present torque.
    fn answer(&mut self, time_s: f64) -> std::io::Result<Snapshot> {
        let mut bytes = [0; 8 * VALUES];
        self.answers.read_exact(&mut bytes)?;
        let (doubles, _) = bytes.as_chunks::<8>();
        let value = |index: usize| f64::from_le_bytes(doubles[index]);
        let [theta_1, theta_2, rate_1, rate_2] = [0, 1, 2, 3].map(value);
        let [tip_t_m, gap_m, tip_m_s] = [4, 5, 6].map(value);
        let slip_velocity_m_s = tip_m_s - self.belt_speed_m_s;
        let mode = if value(9) == 0.0 {
            ContactMode::Flight
        } else if slip_velocity_m_s.abs() < STICK_M_S {
            ContactMode::Stick
        } else {
            ContactMode::slide(Slip::of(slip_velocity_m_s))
        };
        Ok(Snapshot {
            time_s,
            theta_rad: LinkMotion::new(theta_1, theta_2),
            theta_dot_rad_s: LinkMotion::new(rate_1, rate_2),
            tip_t_m,
            gap_m,
            slip_velocity_m_s,
            belt_speed_m_s: self.belt_speed_m_s,
            tangential_force_n: value(7),
            normal_force_n: value(8),
            torque_nm: self.now.torque_nm,
            mode,
            ..Snapshot::default()
        })
    }

    fn moved(&mut self, duration_s: f64, until_s: f64) -> std::io::Result<Snapshot> {
        let [torque_1, torque_2] = self.now.torque_nm.to_array();
        for value in [torque_1, torque_2, duration_s] {
            self.commands.write_all(&value.to_le_bytes())?;
        }
        self.commands.flush()?;
        self.answer(until_s)
    }
}

impl Drop for MujocoArm {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

impl Plant for MujocoArm {
    fn snapshot(&self) -> Snapshot {
        self.now
    }

    fn command_torque(&mut self, target_nm: JointTorque<f64>, _lag_s: f64) {
        self.now.torque_nm = target_nm;
    }

    fn advance(&mut self, until_s: f64, probe: &mut dyn Probe) -> Result<(), PlantError> {
        let duration_s = until_s - self.now.time_s;
        if duration_s <= 0.0 {
            return Ok(());
        }
        let start = self.now;
        let end = self.moved(duration_s, until_s).map_err(PlantError::new)?;
        self.now = end;
        probe.step(&Stretch { start, end });
        if start.mode != end.mode {
            let ([theta_1, theta_2], [rate_1, rate_2]) =
                (end.theta_rad.to_array(), end.theta_dot_rad_s.to_array());
            let change = Event::ModeChange {
                from: start.mode,
                to: end.mode,
            };
            let state = State::new(theta_1, theta_2, rate_1, rate_2);
            probe.event(until_s, change, &state);
        }
        Ok(())
    }
}

/// Motion under one torque, in the air if the tip was not pressed in all of it.
struct Stretch {
    start: Snapshot,
    end: Snapshot,
}

impl Step for Stretch {
    fn start_s(&self) -> f64 {
        self.start.time_s
    }

    fn end_s(&self) -> f64 {
        self.end.time_s
    }

    fn mode(&self) -> ContactMode {
        self.end.mode
    }

    fn start(&self) -> Snapshot {
        self.start
    }

    fn end(&self) -> Snapshot {
        self.end
    }
}

//! A controller that holds the tip at rest on the moving belt, and the commands at which its loop is opened.

use nalgebra::{Matrix2, Vector2};
use painleve_firmware::law::LawSettings;
use painleve_plant::scenario::Scenario;
use painleve_plant::{ContactMode, Plant, PlantError};
use painleve_shared::kinematics::Pose;
use painleve_shared::{Arm, JointTorque};

use super::NotHeld;
use painleve_plant::belt_line::p_ratio;
use painleve_study_core::StudyError;
use painleve_study_core::trial::Trial;

/// Time in which the tip comes to rest and the slow estimates settle, s.
const SETTLE_S: f64 = 12.0;
/// Distance from the wanted place within which a tip counts as held, m. A governor may hold it short of the edge.
const HELD_M: f64 = 2e-3;
/// Motion in the last tenth of the settling that a tip at rest does not have, m.
const AT_REST_M: f64 = 1e-4;

/// The loop in its state of rest.
pub(super) struct AtRest {
    trial: Trial,
    mode: ContactMode,
    arm: Arm<f64>,
    /// The commands: for each its torques per unit, and the weights with which it follows from the joints' torques.
    commands: [Command; 2],
}

/// A command at which the loop is opened.
#[derive(Clone, Copy, Debug)]
pub(super) struct Command {
    name: &'static str,
    /// Generalised torques for one unit of the command, N·m.
    torque_nm: Vector2<f64>,
    /// The command as a sum of the joints' torques.
    weights: [f64; 2],
    /// Size of the disturbances, in units of the command.
    pub(super) size: f64,
}

/// What is recorded at one tick.
#[derive(Clone, Copy, Debug)]
pub(super) struct Recorded {
    /// The commands.
    pub(super) commands: [f64; 2],
    /// Normal force, N.
    pub(super) force_n: f64,
    /// Whether the tip slides as at rest: if not, why there is no loop.
    pub(super) slides: Result<(), NotHeld>,
}

/// Disturbances far from the edge: a quarter of a newton, and as much at the joints.
const FORCE_N: f64 = 0.25;
const TORQUE_NM: f64 = 0.025;

/// Smallest part of these.
const LEAST_SIZE: f64 = 0.02;

/// Returns the normal force that a hybrid law wants, N; `None` for another law.
pub(super) fn wanted_force_n(scenario: &Scenario) -> Option<f64> {
    match scenario.controller.law.of_set() {
        Some(LawSettings::Hybrid(law)) => Some(law.normal_force_n.into()),
        _ => None,
    }
}

impl AtRest {
    /// Makes the loop at its start.
    pub(super) fn start(scenario: &Scenario) -> Result<Trial, StudyError> {
        Ok(Trial::new(scenario)?)
    }

    /// Returns the loop of a scenario once it has come to rest, or why it does not.
    ///
    /// # Errors
    /// [`StudyError`] if the scenario is invalid.
    pub(super) fn settled(scenario: &Scenario) -> Result<Result<Self, NotHeld>, StudyError> {
        let mut trial = Self::start(scenario)?;
        let wanted_m = trial.tip_t_m();
        let (mut least_m, mut most_m) = (f64::INFINITY, f64::NEG_INFINITY);
        while trial.time_s() < SETTLE_S {
            let ends = trial.tick(&mut ()).is_err();
            // A law that presses only once its reference moves may lift the tip off at first.
            let is_off = trial.normal_force_n() <= 0.0 && trial.time_s() > 0.5 * SETTLE_S;
            if ends || is_off {
                return Ok(Err(NotHeld::LiftOff));
            }
            if trial.fault().is_some() {
                return Ok(Err(NotHeld::Fault));
            }
            if trial.time_s() > 0.9 * SETTLE_S {
                let tip_m = trial.tip_t_m();
                (least_m, most_m) = (least_m.min(tip_m), most_m.max(tip_m));
            }
        }
        let error_m = (0.5 * (least_m + most_m) - wanted_m).abs();
        if most_m - least_m > AT_REST_M || error_m > HELD_M {
            return Ok(Err(NotHeld::Restless));
        }
        let mode = trial.simulation().plant().snapshot().mode;
        if mode.slip().is_none() {
            return Ok(Err(NotHeld::Sticks));
        }
        let arm = Arm::new(scenario.arm)?;
        let jacobian = arm.jacobian(&Pose::new(&trial.theta_rad()));
        let Some(to_force) = jacobian.transpose().try_inverse() else {
            return Ok(Err(NotHeld::Restless));
        };
        let mut commands = match wanted_force_n(scenario) {
            Some(_) => tip_commands(&jacobian, &to_force),
            None => joint_commands(),
        };
        // Near the edge the contact multiplies a force by Q22/p: a smaller disturbance keeps it.
        let slip = scenario.slip_at_rest();
        let moving = Arm::new(scenario.moving_arm())?;
        let p_ratio = p_ratio(&moving, &trial.theta_rad(), scenario.belt.friction, slip);
        for command in &mut commands {
            command.size *= p_ratio.clamp(LEAST_SIZE, 1.0);
        }
        Ok(Ok(Self {
            trial,
            mode,
            arm,
            commands,
        }))
    }

    pub(super) fn name(&self, number: usize) -> &'static str {
        self.commands[number].name
    }

    pub(super) fn command(&self, number: usize) -> &Command {
        &self.commands[number]
    }

    /// Returns the control rate, Hz.
    pub(super) fn tick_hz(&self) -> f64 {
        self.trial.simulation().tick_hz()
    }

    /// Runs on from the state of rest for some ticks, with a disturbance of one command, in its units. The recorded
    /// commands contain it. The first `skipped` ticks come before, and are not recorded.
    ///
    /// # Errors
    /// [`PlantError`] if the plant cannot continue.
    pub(super) fn run(
        &self,
        number: usize,
        skipped: usize,
        ticks: usize,
        disturbance: impl Fn(usize) -> f64,
    ) -> Result<Vec<Recorded>, PlantError> {
        let mut trial = self.trial.clone();
        for _ in 0..skipped {
            trial.tick(&mut ())?;
        }
        let mut recorded = Vec::with_capacity(ticks);
        for tick in 0..ticks {
            let torque_nm = self.commands[number].torque_nm * disturbance(tick);
            // A push on the tip, by the pose that the arm has now: integrals move it on for many seconds.
            let jacobian = self.arm.jacobian(&Pose::new(&trial.theta_rad()));
            if torque_nm != Vector2::zeros()
                && let Some(to_force) = jacobian.transpose().try_inverse()
            {
                trial.push((to_force * torque_nm).into());
            }
            trial.tick(&mut ())?;
            let simulation = trial.simulation();
            let torque_nm = simulation.command_nm().to_array();
            let plant = simulation.plant().snapshot();
            recorded.push(Recorded {
                commands: self.commands.map(|command| {
                    let [first, second] = command.weights;
                    first * torque_nm[0] + second * torque_nm[1]
                }),
                force_n: plant.normal_force_n,
                slides: match plant.mode {
                    mode if mode == self.mode => Ok(()),
                    ContactMode::Flight => Err(NotHeld::LiftOff),
                    _ => Err(NotHeld::Sticks),
                },
            });
        }
        Ok(recorded)
    }
}

/// The torques of the joints as generalised ones, for torques of one on each joint.
fn unit_torques() -> [Vector2<f64>; 2] {
    [[1.0, 0.0], [0.0, 1.0]].map(|unit| *JointTorque::from_array(unit).to_links().vector())
}

/// The force of the tip along the belt and normal to it.
fn tip_commands(jacobian: &Matrix2<f64>, to_force: &Matrix2<f64>) -> [Command; 2] {
    let [first, second] = unit_torques().map(|torque| to_force * torque);
    [("position", 0), ("force", 1)].map(|(name, row)| Command {
        name,
        torque_nm: jacobian.row(row).transpose(),
        weights: [first[row], second[row]],
        size: FORCE_N,
    })
}

/// The torques of the joints.
fn joint_commands() -> [Command; 2] {
    let [first, second] = unit_torques();
    [
        ("joint 1", first, [1.0, 0.0]),
        ("joint 2", second, [0.0, 1.0]),
    ]
    .map(|(name, torque_nm, weights)| Command {
        name,
        torque_nm,
        weights,
        size: TORQUE_NM,
    })
}

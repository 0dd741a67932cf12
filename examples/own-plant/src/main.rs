//! A user-defined plant behind the controller: a point mass on a spring, pressed on the moving belt
//! by a massless arm.

use std::error::Error;
use std::io;

use painleve_plant::closed_loop::ClosedLoop;
use painleve_plant::controller_host::InProcess;
use painleve_plant::scenario::Scenario;
use painleve_plant::simulation::Simulation;
use painleve_plant::{ContactMode, Plant, PlantError, Probe, Snapshot};
use painleve_shared::{Arm, JointTorque, Pose, Posture};

const MASS_KG: f64 = 0.5;
const STIFFNESS_N_M: f64 = 20.0;
const FRICTION: f64 = 0.6;
const STEP_S: f64 = 1e-4;

struct MassOnBelt {
    arm: Arm<f64>,
    now: Snapshot,
}

impl MassOnBelt {
    fn at(tip_t_m: f64, arm: Arm<f64>) -> Self {
        let mut now = Snapshot {
            tip_t_m,
            belt_speed_m_s: -0.4,
            slip_velocity_m_s: 0.4,
            mode: ContactMode::SlidePositive,
            ..Snapshot::default()
        };
        now.theta_rad = arm
            .link_angles_on_belt_rad(tip_t_m, Posture::ElbowDown)
            .unwrap_or_default();
        Self { arm, now }
    }
}

impl Plant for MassOnBelt {
    fn snapshot(&self) -> Snapshot {
        self.now
    }

    fn command_torque(&mut self, target_nm: JointTorque<f64>, _lag_s: f64) {
        self.now.torque_nm = target_nm;
    }

    fn advance(&mut self, until_s: f64, _: &mut dyn Probe) -> Result<(), PlantError> {
        let stretched = || PlantError::new(io::Error::other("the arm is stretched"));
        let (arm, now) = (&self.arm, &mut self.now);
        while now.time_s < until_s {
            let step_s = STEP_S.min(until_s - now.time_s);
            let jacobian = arm.jacobian(&Pose::new(&now.theta_rad));
            let torque_nm = now.torque_nm.to_links();
            let push_n = jacobian.transpose().lu().solve(torque_nm.vector());
            let push_n = push_n.ok_or_else(stretched)?;
            now.normal_force_n = (MASS_KG * 9.81 - push_n.y).max(0.0);
            now.tangential_force_n =
                -FRICTION * now.normal_force_n * now.slip_velocity_m_s.signum();
            let force_n = push_n.x + now.tangential_force_n - STIFFNESS_N_M * now.tip_t_m;
            now.slip_velocity_m_s += step_s * force_n / MASS_KG;
            now.tip_t_m += step_s * (now.slip_velocity_m_s + now.belt_speed_m_s);
            let theta_rad = arm.link_angles_on_belt_rad(now.tip_t_m, Posture::ElbowDown);
            now.theta_rad = theta_rad.ok_or_else(stretched)?;
            now.time_s += step_s;
        }
        now.time_s = until_s;
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let scenario = Scenario::load("pid-elbow-down", &[])?;
    let plant = MassOnBelt::at(-0.16, Arm::new(scenario.arm)?);
    let controller = InProcess::new(&scenario.controller_configuration())?;
    let mut closed_loop = ClosedLoop::new(Simulation::of(plant, &scenario)?, controller);
    for _ in 0..scenario.run.ticks() {
        closed_loop.tick(&mut ())?;
    }
    let (result, _) = closed_loop.finish();
    let tip_m = result.final_tip_t_m;
    let reference_m = result
        .final_reference_m
        .ok_or("the controller follows no reference")?;
    println!("tip at {tip_m:.4} m, reference {reference_m:.4} m");
    if (tip_m - reference_m).abs() > 1e-3 {
        return Err("the tip is more than 1 mm from its reference".into());
    }
    Ok(())
}

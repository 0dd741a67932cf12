//! A tick of a real arm in SI units: converter counts through the controller's own scalings and arm model.

use painleve_plant::converters::encoder::links_rad;
use painleve_plant::sample::{Sample, reference_tip_t_m};
use painleve_plant::{Configuration, ContactMode, Snapshot};
use painleve_shared::frame::{ActuatorFrame, SensorFrame, StatusFlags};
use painleve_shared::kinematics::Pose;
use painleve_shared::range::OutOfRange;
use painleve_shared::{Arm, JointTorque, LinkMotion};

/// Scalings of a configured arm.
#[derive(Clone, Debug)]
pub struct Measured {
    configuration: Configuration,
    arm: Arm<f64>,
}

impl Measured {
    /// Uses the scalings of this configuration.
    ///
    /// # Errors
    /// [`OutOfRange`] if the arm's parameters are out of range.
    pub fn new(configuration: &Configuration) -> Result<Self, OutOfRange> {
        Ok(Self {
            configuration: configuration.clone(),
            arm: Arm::new(configuration.arm.cast())?,
        })
    }

    /// Returns a tick as it is recorded. Angles, tip, gap, forces and torques are measured or
    /// commanded; quantities without a sensor are NaN.
    pub fn sample(&self, sensor: &SensorFrame, answer: &ActuatorFrame) -> Sample {
        Sample {
            plant: self.snapshot(sensor, answer),
            sensor: *sensor,
            actuator: *answer,
            reference_tip_t_m: reference_tip_t_m(answer),
            delivered: true,
            answered: answer.tick == sensor.tick,
        }
    }

    fn snapshot(&self, sensor: &SensorFrame, answer: &ActuatorFrame) -> Snapshot {
        let converters = &self.configuration.converters;
        let encoders_rad = [0, 1].map(|joint| {
            let scale = &converters.encoders[joint];
            let counts = scale.counts_from_zero(sensor.joints[joint]);
            f64::from(counts) * scale.rad_per_count::<f64>()
        });
        let estimator = &self.configuration.settings.estimator;
        let theta = links_rad(&estimator.encoders, encoders_rad);
        let pose = Pose::new(&theta);
        let tip_m = self.arm.tip_m(&pose);
        let force_n = |counts| f64::from(converters.force.value(counts));
        let torque_nm = answer
            .torques
            .map(|torque| f64::from(converters.torque.value(torque.0)));
        let flags = answer.flags;
        let slides_back = flags.contains(StatusFlags::SLIP_NEGATIVE);
        let mode = match () {
            () if !flags.contains(StatusFlags::CONTACT) => ContactMode::Flight,
            () if flags.contains(StatusFlags::STICKS) => ContactMode::Stick,
            () if slides_back => ContactMode::SlideNegative,
            () => ContactMode::SlidePositive,
        };
        Snapshot {
            time_s: f64::from(sensor.tick) / f64::from(self.configuration.tick_hz),
            theta_rad: theta,
            theta_dot_rad_s: LinkMotion::new(f64::NAN, f64::NAN),
            theta_ddot_rad_s2: LinkMotion::new(f64::NAN, f64::NAN),
            tip_t_m: tip_m.x,
            gap_m: self.arm.gap_m(&pose),
            gap_rate_m_s: f64::NAN,
            slip_velocity_m_s: f64::NAN,
            belt_speed_m_s: f64::NAN,
            normal_force_n: force_n(sensor.normal_force.0),
            tangential_force_n: force_n(sensor.tangential_force.0),
            b_m_s2: f64::NAN,
            p_per_kg: f64::NAN,
            torque_nm: JointTorque::from_array(torque_nm),
            mode,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_plant::scenario::Scenario;
    use painleve_plant::simulation::Simulation;
    use painleve_plant::statistics::Statistics;

    /// The simulated arm's counts, corrected and scaled back, agree with the arm within a count.
    #[test]
    #[allow(clippy::unwrap_used)]
    fn scaled_counts_agree_with_the_arm() {
        let overrides = [
            "converters.encoder.mounting_error_rad=[-0.03, 0.02]".to_owned(),
            "controller.estimator.encoders.zero_rad=[0.03, -0.02]".to_owned(),
        ];
        let scenario = Scenario::default()
            .with_overrides("corrected", &overrides)
            .unwrap();
        let configuration = scenario.controller_configuration();
        let measured = Measured::new(&configuration).unwrap();
        let mut simulation = Simulation::new(&scenario).unwrap();
        let sensor = simulation.sample(&mut Statistics::new(0.05)).unwrap();
        let answer = ActuatorFrame::default();
        let truth = simulation.describe(&sensor, &answer).plant;
        let sample = measured.sample(&sensor, &answer).plant;
        assert!((sample.theta_rad - truth.theta_rad).amax() < 1e-3);
        assert!((sample.tip_t_m - truth.tip_t_m).abs() < 5e-4);
        assert!((sample.normal_force_n - truth.normal_force_n).abs() < 0.1);
        assert!(sample.slip_velocity_m_s.is_nan());
    }
}

//! Estimates the torque that the model does not explain.
//!
//! In the equations of motion, M θ̈ + w + c − Jᵀ f − u = d, the residual d shows an error of a mass,
//! spring or dashpot. Every term on the left is measured or known in contact as well as in the air, so d
//! needs no contact model. Near the edge d matters most: an error of the free normal acceleration b
//! changes f_n = −b/p by that error over p.
//!
//! The residual passes a low-pass. The torque of a tick acts one to a few ticks later than the force and
//! motion it is compared with. This closes a loop through the contact with gain Q22/p, so the filter's
//! bandwidth falls with p to keep the loop stable.

use nalgebra::Vector2;
use painleve_shared::{GeneralisedTorque, JointTorque, LinkMotion, Real, settings};

use crate::estimate::ContactEstimate;
use crate::estimate::model::Model;
use crate::schedule::Turn;

/// Largest disturbance of either link, as a part of the largest torque. Half and two and a half times of it lose no run (lab book,
/// *Factors on constants*).
const LARGEST: f32 = 0.2;

settings! {
    /// Settings of the disturbance observer.
    #[derive(Copy)]
    pub struct DisturbanceSettings {
        /// Bandwidth in the air. On the belt it falls with p/Q22; 0 for no estimate.
        bandwidth_rad_s: f32 = 20.0, 0.0..=1e3, "rad/s";
    }
}

/// The low-pass of the residual.
#[derive(Clone, Copy, Debug, Default)]
pub struct DisturbanceEstimator {
    /// Fraction of the residual adopted at once in the air.
    weight: f32,
    limit_nm: f32,
    tick_s: f32,
    /// Generalised torque d on the arm in addition to the model's torques, N·m.
    pub torque_nm: GeneralisedTorque<f32>,
    /// θ̇ at the previous update, rad/s.
    rate_rad_s: Option<LinkMotion<f32>>,
    /// What has acted since then.
    acted: Acted,
}

/// Sums over the ticks since the last update, with those whose readings were lost.
#[derive(Clone, Copy, Debug, Default)]
struct Acted {
    torque_nm: JointTorque<f32>,
    force_n: Vector2<f32>,
    ticks: f32,
}

impl DisturbanceEstimator {
    /// Makes an estimator that is updated in each of its turns, at ticks `tick_s` long, for stages with torques up to
    /// `torque_limit_nm`.
    pub fn new(settings: &DisturbanceSettings, torque_limit_nm: f32, tick_s: f32) -> Self {
        Self {
            weight: settings.bandwidth_rad_s * (Turn::COUNT * tick_s),
            limit_nm: LARGEST * torque_limit_nm,
            tick_s,
            ..Self::default()
        }
    }

    /// Updates the estimate of an arm whose `model` includes the present d with the ticks added since the last update.
    /// In contact, the weight falls with p/Q22, to what a loop through the contact may remove in a tick at most.
    #[inline(never)]
    pub fn update(&mut self, model: &Model, contact: &ContactEstimate) {
        let rate_rad_s = model.theta_dot_rad_s;
        let acted = core::mem::take(&mut self.acted);
        if acted.ticks == 0.0 {
            return;
        }
        let per_tick = 1.0 / acted.ticks;
        let (torque_nm, force_n) = (acted.torque_nm * per_tick, acted.force_n * per_tick);
        let Some(before) = &mut self.rate_rad_s else {
            self.rate_rad_s = Some(rate_rad_s);
            return;
        };
        let change = rate_rad_s - *before;
        *before = rate_rad_s;
        let acceleration = change / (acted.ticks * self.tick_s);
        let needed_nm = model.inverse_dynamics_nm(&acceleration, &force_n);
        let residual_nm = (needed_nm - torque_nm).to_links();
        let limit_nm = self.limit_nm;
        // Estimate and disturbance may be at the limit with opposite signs; more is an impact.
        if residual_nm.amax() > 2.0 * limit_nm {
            return;
        }
        // Limited by the contact's response alone, without p/Q22, fewer runs were kept (lab book, *Parts of the friction
        // estimate left out*).
        let weight = if contact.touches {
            let p_ratio = contact.p_per_kg / model.q22_per_kg;
            (self.weight * p_ratio.at_most(1.0)).limited(0.0, contact.response.loop_share)
        } else {
            self.weight.at_most(1.0)
        };
        self.torque_nm =
            (self.torque_nm + residual_nm * weight).map(|torque| torque.within(limit_nm));
    }

    /// Adds the readings that follow the previous ones after `elapsed_ticks`, with the joint torques (N·m) until then and
    /// the contact force (f_t, f_n), N.
    #[inline]
    pub fn add(
        &mut self,
        torque_nm: &JointTorque<f32>,
        force_n: &Vector2<f32>,
        elapsed_ticks: u32,
    ) {
        let (acted, ticks) = (&mut self.acted, elapsed_ticks as f32);
        acted.torque_nm += *torque_nm * ticks;
        acted.force_n += force_n * ticks;
        acted.ticks += ticks;
    }

    /// Passes over a tick without information: contact or a reading is in doubt, or the drive is off. What a drive that was
    /// on (`drove`) has learnt is forgotten once it is off: somebody may have held the arm.
    #[inline]
    pub fn pause(&mut self, drove: bool) {
        if !drove {
            self.torque_nm = GeneralisedTorque::zeros();
        }
        self.rate_rad_s = None;
        self.acted = Acted::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::{Arm, ArmParameters};
    use proptest::prelude::*;

    const TICK_S: f32 = 1e-3;

    /// Returns a contact at this p/Q22, whose response allows everything; without it, the tip is in the air.
    fn at_p_ratio(model: &Model, p_ratio: Option<f32>) -> ContactEstimate {
        let mut contact = ContactEstimate {
            touches: p_ratio.is_some(),
            p_per_kg: p_ratio.unwrap_or(0.0) * model.q22_per_kg,
            ..Default::default()
        };
        contact.response.loop_share = 1.0;
        contact
    }

    /// Runs the estimator on an arm with an unknown torque, moving with a constant acceleration under a
    /// contact force; returns the final estimate.
    fn observed(
        disturbance_nm: GeneralisedTorque<f32>,
        acceleration: LinkMotion<f32>,
        force_n: Vector2<f32>,
        p_ratio: Option<f32>,
        ticks: u32,
    ) -> GeneralisedTorque<f32> {
        let arm = Arm::<f32>::new(ArmParameters::default()).unwrap();
        let theta = LinkMotion::new(-0.3, 0.7);
        let mut estimator = DisturbanceEstimator::new(&DisturbanceSettings::default(), 5.0, TICK_S);
        for tick in 0..ticks {
            let rate = acceleration * (tick as f32 * TICK_S);
            let truth = Model::new(&arm, theta, rate, &disturbance_nm);
            let model = Model::new(&arm, theta, rate, &estimator.torque_nm);
            let torque_nm = truth.inverse_dynamics_nm(&acceleration, &force_n);
            estimator.add(&torque_nm, &force_n, 1);
            estimator.update(&model, &at_p_ratio(&model, p_ratio));
        }
        estimator.torque_nm
    }

    proptest! {
        /// For every force and motion, only the unknown torque is found.
        #[test]
        fn an_unknown_torque_is_found(
            d1 in -0.8_f32..0.8, d2 in -0.8_f32..0.8, a1 in -5.0_f32..5.0, a2 in -5.0_f32..5.0,
            f_t in -15.0_f32..15.0, f_n in 0.0_f32..15.0,
        ) {
            let truth = GeneralisedTorque::new(d1, d2);
            let found = observed(truth, LinkMotion::new(a1, a2), Vector2::new(f_t, f_n), None, 500);
            prop_assert!((found - truth).amax() < 2e-3, "{found:?} {truth:?}");
        }
    }

    #[test]
    fn the_estimate_is_slow_where_p_is_small() {
        let truth = GeneralisedTorque::new(0.5, -0.3);
        let after = |p_ratio| {
            let (rest, unloaded) = (LinkMotion::zeros(), Vector2::zeros());
            observed(truth, rest, unloaded, Some(p_ratio), 50).amax() / truth.amax()
        };
        // 1 − (1 − 0.08)⁴⁹ and 1 − (1 − 0.08 · 0.02)⁴⁹.
        assert!((after(1.0) - 0.9832).abs() < 2e-3, "{}", after(1.0));
        assert!((after(0.02) - 0.0755).abs() < 2e-3, "{}", after(0.02));
        assert_eq!(after(-0.1), 0.0);
    }

    #[test]
    fn the_estimate_is_limited() {
        let found = observed(
            GeneralisedTorque::new(1.9, -1.5),
            LinkMotion::zeros(),
            Vector2::zeros(),
            None,
            500,
        );
        assert_eq!(found, GeneralisedTorque::new(1.0, -1.0));
    }

    /// Returns the estimate for an arm in balance after a sudden change of its rates.
    fn after_a_jump(rate_rad_s: LinkMotion<f32>) -> GeneralisedTorque<f32> {
        let arm = Arm::<f32>::new(ArmParameters::default()).unwrap();
        let mut estimator = DisturbanceEstimator::new(&DisturbanceSettings::default(), 5.0, TICK_S);
        for rate in [LinkMotion::zeros(), rate_rad_s] {
            let model = Model::new(
                &arm,
                LinkMotion::new(-0.3, 0.7),
                rate,
                &GeneralisedTorque::zeros(),
            );
            let force_n = Vector2::zeros();
            let torque_nm = model.inverse_dynamics_nm(&LinkMotion::zeros(), &force_n);
            estimator.add(&torque_nm, &force_n, 1);
            estimator.update(&model, &ContactEstimate::default());
        }
        estimator.torque_nm
    }

    /// A torque that acts while readings are lost acts for longer than the others.
    #[test]
    fn lost_readings_are_not_mistaken_for_a_torque() {
        let arm = Arm::<f32>::new(ArmParameters::default()).unwrap();
        let mut estimator = DisturbanceEstimator::new(&DisturbanceSettings::default(), 5.0, TICK_S);
        let (unloaded, mut rate) = (Vector2::zeros(), LinkMotion::zeros());
        for round in 0..20 {
            // Accelerations in turn, each for the ticks until the next readings.
            let turn = if round % 2 == 0 { 1.0 } else { -1.0 };
            for (acceleration, ticks) in [(1.0, 1), (-9.0, 4)] {
                let acceleration = LinkMotion::new(acceleration * turn, 0.0);
                let model = |rate| {
                    let theta = LinkMotion::new(-0.3, 0.7);
                    Model::new(&arm, theta, rate, &GeneralisedTorque::zeros())
                };
                let torque_nm = model(rate).inverse_dynamics_nm(&acceleration, &unloaded);
                rate += acceleration * (ticks as f32 * TICK_S);
                estimator.add(&torque_nm, &unloaded, ticks);
            }
            let theta = LinkMotion::new(-0.3, 0.7);
            let model = Model::new(&arm, theta, rate, &estimator.torque_nm);
            estimator.update(&model, &ContactEstimate::default());
            let found_nm = estimator.torque_nm.amax();
            assert!(found_nm < 3e-4, "{round}: {found_nm}");
        }
    }

    #[test]
    fn an_impact_is_not_mistaken_for_a_torque() {
        assert_ne!(
            after_a_jump(LinkMotion::new(0.1, -0.1)),
            GeneralisedTorque::zeros()
        );
        assert_eq!(
            after_a_jump(LinkMotion::new(3.0, -2.0)),
            GeneralisedTorque::zeros()
        );
    }
}

//! Collision of the tip with the belt: Routh's impulse process.
//!
//! During the collision positions stay fixed and the normal impulse P takes the place of time. With
//! slip direction s, the tip velocity (v_r, v_n) relative to the belt changes as
//!
//! ```text
//! dv_r/dP = Q12 − μ s Q11     dv_n/dP = Q22 − μ s Q12 = p
//! ```
//!
//! When slip vanishes the tip sticks if |Q12/Q11| ≤ μ (then dv_n/dP = Q22 − Q12²/Q11) and slips
//! back otherwise. Compression ends at v_n = 0; the restitution determines the impulse that
//! follows. The velocities are piecewise linear in P, so the process is solved in closed form,
//! phase by phase.
//!
//! The paper does not state an impact law. An impact without collision (Génot and Brogliato 1999)
//! is the same process started at v_n = 0 with p < 0.

use nalgebra::{Matrix2, Vector2};
use painleve_shared::{Pose, Slip, settings};

use super::motion::{Motion, theta};
use crate::plant::State;

settings! {
    /// Restitution of impacts. Poisson with e = 0.10 reproduces the paper's bouncing window.
    #[derive(Copy)]
    pub struct ImpactLaw {
        /// Definition of the coefficient of restitution. Rigid contact only.
        law: Restitution = Restitution::Poisson;
        /// Coefficient of restitution e. Rigid contact only.
        restitution: f64 = 0.10, 0.0..=1.0;
    }
}

settings! {
    /// Definition of the coefficient of restitution.
    #[derive(Copy, Eq)]
    pub enum Restitution {
        /// Poisson: impulse of restitution = e · impulse of compression.
        "poisson" => Poisson,
        /// Stronge: work of restitution = e² · work of compression.
        "energetic" => Energetic,
    }
}

/// Result of a collision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impact {
    /// Tip velocity relative to the belt after the impact, (v_r, v_n), m/s.
    pub velocity_m_s: Vector2<f64>,
    /// Impulse on the tip, (P_t, P_n), N·s.
    pub impulse_ns: Vector2<f64>,
}

/// A collision without end. This requires a singular Q: at full stretch, an impulse along the links
/// cannot move the tip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the impact process does not end: the arm is straight, and no impulse turns its tip")]
pub struct EndlessImpact;

/// The process at a given impulse.
#[derive(Clone, Copy)]
struct ImpactProcess<'a> {
    q: &'a Matrix2<f64>,
    friction: f64,
    /// (v_r, v_n), m/s.
    velocity: Vector2<f64>,
    /// (P_t, P_n), N·s.
    impulse: Vector2<f64>,
    /// Work of the normal impulse, J.
    work: f64,
    slip: Option<Slip>,
}

/// Largest number of phases: the direction of slip changes at most twice, when slip vanishes and
/// when it then sticks or reverses for good.
const MAXIMUM_PHASES: usize = 4;

impl<'a> ImpactProcess<'a> {
    fn new(q: &'a Matrix2<f64>, friction: f64, velocity: Vector2<f64>) -> Self {
        let mut process = Self {
            q,
            friction,
            velocity,
            impulse: Vector2::zeros(),
            work: 0.0,
            slip: None,
        };
        process.slip = if velocity.x == 0.0 {
            process.slip_from_rest()
        } else {
            Some(Slip::of(velocity.x))
        };
        process
    }

    /// Returns the slip direction that starts from rest; `None` if the tip sticks.
    fn slip_from_rest(&self) -> Option<Slip> {
        let (coupling, tangential) = (self.q.m12, self.q.m11);
        if coupling.abs() <= self.friction * tangential {
            None
        } else {
            Some(Slip::of(coupling))
        }
    }

    /// Returns the tangential impulse per normal impulse, f_t/f_n.
    fn friction_ratio(&self) -> f64 {
        match self.slip {
            Some(slip) => -self.friction * slip.sign::<f64>(),
            None => -self.q.m12 / self.q.m11,
        }
    }

    /// Returns (dv_r/dP, dv_n/dP), 1/kg.
    fn rates(&self) -> Vector2<f64> {
        let ratio = self.friction_ratio();
        Vector2::new(
            self.q.m12 + ratio * self.q.m11,
            self.q.m22 + ratio * self.q.m12,
        )
    }

    /// Returns the impulse until slip vanishes, if it does.
    fn until_slip_dies(&self) -> f64 {
        let (Some(slip), rates) = (self.slip, self.rates()) else {
            return f64::INFINITY;
        };
        let slip_speed = slip.sign::<f64>() * self.velocity.x;
        let closing = -slip.sign::<f64>() * rates.x;
        if closing > 0.0 && slip_speed > 0.0 {
            slip_speed / closing
        } else {
            f64::INFINITY
        }
    }

    /// Adds a normal impulse within the present phase.
    fn add(&mut self, normal: f64) {
        let rates = self.rates();
        let before = self.velocity.y;
        self.impulse += Vector2::new(self.friction_ratio() * normal, normal);
        self.velocity += rates * normal;
        self.work += 0.5 * (before + self.velocity.y) * normal;
    }

    /// Ends the present phase at the impulse where slip dies.
    fn end_slip(&mut self, normal: f64) {
        self.add(normal);
        self.velocity.x = 0.0;
        self.slip = self.slip_from_rest();
    }

    /// Runs phase by phase until `finish` returns the impulse that ends the process within the
    /// present phase.
    fn run(mut self, finish: impl Fn(&Self) -> Option<f64>) -> Result<Self, EndlessImpact> {
        for _ in 0..MAXIMUM_PHASES {
            let until_slip_dies = self.until_slip_dies();
            match finish(&self) {
                Some(normal) if normal <= until_slip_dies => {
                    self.add(normal);
                    return Ok(self);
                }
                _ if until_slip_dies.is_finite() => self.end_slip(until_slip_dies),
                _ => return Err(EndlessImpact),
            }
        }
        Err(EndlessImpact)
    }

    /// Returns the impulse until v_n = 0 in the present phase. For p ≤ 0 compression continues and
    /// this phase cannot end it.
    fn until_compressed(&self) -> Option<f64> {
        let rate = self.rates().y;
        (rate > 0.0).then(|| (-self.velocity.y / rate).max(0.0))
    }

    /// Returns the impulse until the work has grown by `work` from `start` in the present phase.
    fn until_work(&self, start: f64, work: f64) -> Option<f64> {
        // This order avoids cancellation while no work has been returned yet.
        let missing = work - (self.work - start);
        let (speed, rate) = (self.velocity.y.max(0.0), self.rates().y);
        if missing <= 0.0 {
            Some(0.0)
        } else if rate > 0.0 || speed > 0.0 {
            // speed P + rate P²/2 = missing, in the form without cancellation.
            let root = speed * speed + 2.0 * rate * missing;
            (root >= 0.0).then(|| 2.0 * missing / (speed + root.sqrt()))
        } else {
            None
        }
    }
}

/// Collision at tip velocity `velocity_m_s` = (v_r, v_n < 0) relative to the belt.
///
/// # Errors
/// [`EndlessImpact`] if compression never ends, which is impossible for a positive definite Q.
pub fn collide(
    q: &Matrix2<f64>,
    friction: f64,
    law: &ImpactLaw,
    velocity_m_s: Vector2<f64>,
) -> Result<Impact, EndlessImpact> {
    rebound(ImpactProcess::new(q, friction, velocity_m_s), law)
}

/// Impact without collision: the tip slides with `slip_m_s` ≠ 0 along the belt, p is zero or
/// negative, and the contact force grows beyond all bounds until slip has vanished.
///
/// # Errors
/// As [`collide`].
pub fn throw(
    q: &Matrix2<f64>,
    friction: f64,
    law: &ImpactLaw,
    slip_m_s: f64,
) -> Result<Impact, EndlessImpact> {
    let mut start = ImpactProcess::new(q, friction, Vector2::new(slip_m_s, 0.0));
    let until_slip_dies = start.until_slip_dies();
    if !until_slip_dies.is_finite() {
        return Err(EndlessImpact);
    }
    start.end_slip(until_slip_dies);
    rebound(start, law)
}

/// Cause of an impact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImpactKind {
    /// The tip arrives with a normal velocity.
    Collision,
    /// The tip has no normal velocity and is thrown off an inconsistent contact.
    WithoutCollision,
}

/// What an impact leads to.
#[derive(Clone, Copy, Debug)]
pub struct AfterImpact {
    /// The state after it.
    pub state: State,
    /// Impulse on the tip, (P_t, P_n), N·s.
    pub impulse_ns: Vector2<f64>,
}

/// Returns what an impact of the tip at belt height leads to.
///
/// # Errors
/// As [`collide`].
pub fn state_after(
    motion: &Motion<'_>,
    law: &ImpactLaw,
    time_s: f64,
    state: &State,
    kind: ImpactKind,
) -> Result<AfterImpact, EndlessImpact> {
    let velocity = motion.relative_velocity_m_s(time_s, state);
    let q = motion
        .arm
        .inverse_tip_inertia_per_kg(&Pose::new(&theta(state)));
    let impact = match kind {
        ImpactKind::Collision => collide(&q, motion.friction, law, velocity),
        ImpactKind::WithoutCollision => throw(&q, motion.friction, law, velocity.x),
    }?;
    Ok(AfterImpact {
        state: motion.apply_impulse(state, &impact.impulse_ns),
        impulse_ns: impact.impulse_ns,
    })
}

/// The rest of a collision: compression to its end, then restitution.
fn rebound(start: ImpactProcess<'_>, law: &ImpactLaw) -> Result<Impact, EndlessImpact> {
    let compressed = start.run(ImpactProcess::until_compressed)?;
    let end = match law.law {
        Restitution::Poisson => {
            let total = (1.0 + law.restitution) * compressed.impulse.y;
            compressed.run(|process| Some((total - process.impulse.y).max(0.0)))?
        }
        Restitution::Energetic => {
            let returned = -law.restitution * law.restitution * compressed.work;
            compressed.run(|process| process.until_work(compressed.work, returned))?
        }
    };
    Ok(Impact {
        velocity_m_s: end.velocity,
        impulse_ns: end.impulse,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    prop_compose! {
        /// Random positive definite Q that is not too flat.
        fn mobility()(q11 in 0.5_f64..40.0, q22 in 0.5_f64..40.0, r in -0.98_f64..0.98) -> Matrix2<f64> {
            let q12 = r * (q11 * q22).sqrt();
            Matrix2::new(q11, q12, q12, q22)
        }
    }

    prop_compose! {
        fn law()(energetic: bool, restitution in 0.0_f64..=1.0) -> ImpactLaw {
            let law = if energetic { Restitution::Energetic } else { Restitution::Poisson };
            ImpactLaw { law, restitution }
        }
    }

    fn kinetic(q: &Matrix2<f64>, v: &Vector2<f64>) -> f64 {
        0.5 * v.dot(&(q.try_inverse().unwrap() * v))
    }

    proptest! {
        #[test]
        fn impulse_momentum_and_friction_hold(
            q in mobility(), law in law(), friction in 0.0_f64..1.5,
            v_r in -2.0_f64..2.0, v_n in -2.0_f64..-1e-6,
        ) {
            let before = Vector2::new(v_r, v_n);
            let impact = collide(&q, friction, &law, before).unwrap();
            let change = impact.velocity_m_s - before;
            prop_assert!((change - q * impact.impulse_ns).norm() < 1e-9);
            prop_assert!(impact.velocity_m_s.y > -1e-12);
            prop_assert!(impact.impulse_ns.x.abs() <= friction * impact.impulse_ns.y * (1.0 + 1e-9));
        }

        /// Poisson's law can add energy with friction (Stronge 1990); the
        /// energetic law cannot, and neither can any law without friction.
        #[test]
        fn energy_does_not_grow(
            q in mobility(), restitution in 0.0_f64..=1.0, friction in 0.0_f64..1.5,
            v_r in -2.0_f64..2.0, v_n in -2.0_f64..-1e-6,
        ) {
            let before = Vector2::new(v_r, v_n);
            let start = kinetic(&q, &before);
            let energetic = ImpactLaw { law: Restitution::Energetic, restitution };
            let end = collide(&q, friction, &energetic, before).unwrap().velocity_m_s;
            prop_assert!(kinetic(&q, &end) <= start * (1.0 + 1e-9));
            let poisson = ImpactLaw { law: Restitution::Poisson, restitution };
            let end = collide(&q, 0.0, &poisson, before).unwrap().velocity_m_s;
            prop_assert!(kinetic(&q, &end) <= start * (1.0 + 1e-9));
        }

        #[test]
        fn without_friction_every_law_reverses_the_normal_velocity(
            q in mobility(), law in law(), v_r in -2.0_f64..2.0, v_n in -2.0_f64..-1e-6,
        ) {
            let end = collide(&q, 0.0, &law, Vector2::new(v_r, v_n)).unwrap();
            prop_assert!((end.velocity_m_s.y + law.restitution * v_n).abs() < 1e-12);
        }

        #[test]
        fn mirrored_collisions_have_mirrored_results(
            q in mobility(), law in law(), friction in 0.0_f64..1.5,
            v_r in -2.0_f64..2.0, v_n in -2.0_f64..-1e-6,
        ) {
            let mirror = Matrix2::new(q.m11, -q.m12, -q.m21, q.m22);
            let here = collide(&q, friction, &law, Vector2::new(v_r, v_n)).unwrap();
            let there = collide(&mirror, friction, &law, Vector2::new(-v_r, v_n)).unwrap();
            prop_assert!((here.velocity_m_s.x + there.velocity_m_s.x).abs() < 1e-12);
            prop_assert!((here.velocity_m_s.y - there.velocity_m_s.y).abs() < 1e-12);
        }
    }

    #[test]
    fn a_tiny_restitution_loses_no_digits() {
        let q = Matrix2::new(0.5, 0.0, 0.0, 0.5);
        let law = ImpactLaw {
            law: Restitution::Energetic,
            restitution: 1.121_366_726_204_905_8e-5,
        };
        let v_n = -1.247_754_208_626_461;
        let end = collide(&q, 0.0, &law, Vector2::new(0.0, v_n)).unwrap();
        assert!((end.velocity_m_s.y + law.restitution * v_n).abs() < 1e-15);
    }

    #[test]
    fn an_inconsistent_contact_is_thrown_off_without_collision() {
        // p = 2 − 0.6 · 4 < 0 for positive slip.
        let q = Matrix2::new(10.0, 4.0, 4.0, 2.0);
        let impact = throw(&q, 0.6, &ImpactLaw::default(), 0.4).unwrap();
        assert!(impact.velocity_m_s.y > 0.0);
        assert!(impact.impulse_ns.y > 0.0);
    }
}

//! Equations of motion and contact force in each contact mode.

use nalgebra::{Matrix2, Vector2};
use painleve_shared::range::{self, OutOfRange};
use painleve_shared::{Arm, ContactTerms, GeneralisedTorque, JointTorque, LinkMotion, Pose, Slip};

use crate::plant::{ContactMode, Snapshot, State};

use super::belt::BeltProfile;
use super::effects::surface::SurfacePoint;
use super::torque::TorqueSegment;
use super::turned_pose::KnownPose;

/// Returns the link angles of a state, rad.
#[inline]
pub fn theta(state: &State) -> LinkMotion<f64> {
    LinkMotion::new(state[0], state[1])
}

/// Returns the link rates of a state, rad/s.
#[inline]
pub fn theta_dot(state: &State) -> LinkMotion<f64> {
    LinkMotion::new(state[2], state[3])
}

/// Height below which a tip counts as touching the belt at the start, m: the paper gives its
/// initial conditions to three digits.
const CONTACT_AT_START_M: f64 = 1e-4;

/// What is out of range if a start is inside the belt: no setting by itself, but what follows from several.
pub(crate) const INITIAL_HEIGHT: &str = "initial tip height over the belt in m";

/// Deepest start inside the belt that is treated as a rounding error, m.
const INSIDE_AT_START_M: f64 = 1e-3;

/// Distance from the belt that is a rounding error, m.
const ON_BELT_M: f64 = 1e-12;

/// Largest turn of the links that moves a start onto the belt. The short links of a small arm, or an uneven belt, take
/// several degrees; an arm that points straight at the belt takes any turn.
const LARGEST_TURN_AT_START_DEG: f64 = 30.0;

/// Changes of the angles whose squares are below rounding, rad.
const FIRST_ORDER_RAD: f64 = 1e-9;

/// Terms of the equations at one state, which hold for any torque.
#[derive(Clone, Copy, Debug)]
pub struct StateTerms {
    /// Link angles with their sines and cosines.
    pub known: KnownPose,
    /// Link rates, rad/s.
    rates: LinkMotion<f64>,
    /// M⁻¹, 1/(kg·m²).
    mobility: Matrix2<f64>,
    /// J̇ θ̇, m/s².
    centripetal_m_s2: Vector2<f64>,
    /// Passive and centrifugal torques w + c, N·m.
    resistance_nm: GeneralisedTorque<f64>,
}

impl StateTerms {
    /// Evaluates the terms of a state.
    #[inline(always)]
    pub fn new(arm: &Arm<f64>, state: &State) -> Self {
        Self::of(arm, KnownPose::new(&theta(state)), theta_dot(state))
    }

    #[inline(always)]
    fn of(arm: &Arm<f64>, known: KnownPose, rates: LinkMotion<f64>) -> Self {
        let KnownPose { angles, pose } = &known;
        Self {
            known,
            rates,
            mobility: arm.inverse_mass_matrix(pose),
            centripetal_m_s2: arm.centripetal_m_s2(pose, &rates),
            resistance_nm: arm.passive_torque_nm(angles, &rates, pose)
                + arm.centrifugal_torque_nm(&rates, pose),
        }
    }
}

/// The equations of a mode evaluated at one state.
#[derive(Clone, Copy, Debug)]
pub struct Evaluation {
    /// Time derivative of the state.
    pub slope: State,
    /// Contact force (f_t, f_n), N.
    pub force_n: Vector2<f64>,
    /// Position of the tip along the belt, m.
    pub tip_t_m: f64,
    /// Height of the tip above the belt (m), its rate (m/s) and its acceleration (m/s²).
    pub gap: [f64; 3],
    /// Velocity of the tip along the belt relative to the belt (m/s), and its rate (m/s²).
    pub slip: [f64; 2],
    /// Free normal acceleration b, m/s².
    pub b_m_s2: f64,
    /// p = Q22 − μ s Q21, 1/kg, for the mode's direction of slip; in flight, for that of the motion; of a sticking tip, for
    /// the slip that friction prevents.
    pub p_per_kg: f64,
    /// Q22, 1/kg.
    pub q22_per_kg: f64,
}

/// The arm, the belt and the torque of one stretch of motion.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    /// The arm.
    pub arm: &'a Arm<f64>,
    /// The belt's speed.
    pub belt: &'a BeltProfile,
    /// Friction coefficient μ.
    pub friction: f64,
    /// Joint torques.
    pub torque: TorqueSegment,
}

impl Motion<'_> {
    /// Returns the contact terms at a state.
    pub fn terms(&self, t_s: f64, state: &State) -> ContactTerms<f64> {
        let angles = theta(state);
        let torque = self.torque.at(t_s).to_links();
        self.arm
            .contact_terms(&angles, &theta_dot(state), &Pose::new(&angles), &torque)
    }

    /// Returns the contact force (f_t, f_n), N, of a mode with given contact terms. It is zero for
    /// a stick that the straight arm makes singular.
    pub fn force_n(&self, t_s: f64, mode: ContactMode, terms: &ContactTerms<f64>) -> Vector2<f64> {
        match mode {
            ContactMode::Flight => Vector2::zeros(),
            ContactMode::SlidePositive | ContactMode::SlideNegative => {
                let slip = mode.slip().unwrap_or(Slip::Positive);
                let normal = terms.sliding_normal_force_n(self.friction, slip);
                Vector2::new(-self.friction * slip.sign::<f64>() * normal, normal)
            }
            ContactMode::Stick => {
                let belt = Vector2::new(self.belt.acceleration_m_s2(t_s), 0.0);
                terms
                    .force_for_acceleration_n(&belt)
                    .unwrap_or_else(Vector2::zeros)
            }
        }
    }

    /// Returns the snapshot of an instant.
    pub fn snapshot(&self, mode: ContactMode, t_s: f64, state: &State) -> Snapshot {
        self.snapshot_of(mode, t_s, state, &self.evaluate(mode, t_s, state))
    }

    /// Returns the snapshot of an instant at which the equations have been evaluated.
    // Always, so that a probe computes only what it reads.
    #[inline(always)]
    pub fn snapshot_of(
        &self,
        mode: ContactMode,
        t_s: f64,
        state: &State,
        here: &Evaluation,
    ) -> Snapshot {
        Snapshot {
            time_s: t_s,
            theta_rad: LinkMotion::new(state[0], state[1]),
            theta_dot_rad_s: LinkMotion::new(state[2], state[3]),
            theta_ddot_rad_s2: LinkMotion::new(here.slope[2], here.slope[3]),
            tip_t_m: here.tip_t_m,
            gap_m: here.gap[0],
            gap_rate_m_s: here.gap[1],
            slip_velocity_m_s: here.slip[0],
            belt_speed_m_s: self.belt.speed_m_s(t_s),
            normal_force_n: here.force_n.y,
            tangential_force_n: here.force_n.x,
            b_m_s2: here.b_m_s2,
            p_per_kg: here.p_per_kg,
            torque_nm: self.torque.at(t_s),
            mode,
        }
    }

    /// Returns the time derivative of the state in a mode.
    #[inline]
    pub fn derivative(&self, mode: ContactMode, t_s: f64, state: &State) -> State {
        self.evaluate(mode, t_s, state).slope
    }

    /// Returns the time derivative of the state in a mode at given joint torques, at a state near a
    /// known pose; for short steps.
    ///
    /// A sliding tip moves along the belt, j2 θ̈ = −j̇2 θ̇, and the contact force has no component
    /// across its direction v = Jᵀ (−μ s, 1): with v⊥ · v = 0, v⊥ᵀ M θ̈ = v⊥ · load. These two
    /// equations give θ̈ without M⁻¹ and without the force.
    #[inline(always)]
    pub fn derivative_near(
        &self,
        known: &KnownPose,
        mode: ContactMode,
        t_s: f64,
        torque_nm: JointTorque<f64>,
        state: &State,
    ) -> State {
        let (angles, rates) = (theta(state), theta_dot(state));
        let pose = known.turned_to(&angles);
        let Some(slip) = mode.slip() else {
            let terms = StateTerms::of(self.arm, KnownPose { angles, pose }, rates);
            return self.under_torque(mode, t_s, torque_nm, &terms).slope;
        };
        let jacobian = self.arm.jacobian(&pose);
        let along = Vector2::new(jacobian.m11, jacobian.m12);
        let normal = Vector2::new(jacobian.m21, jacobian.m22);
        let push = normal - along * (self.friction * slip.sign::<f64>());
        let across = Vector2::new(-push.y, push.x);
        let inertia = self.arm.mass_matrix(&pose) * across;
        let load = torque_nm.to_links()
            - self.arm.passive_torque_nm(&angles, &rates, &pose)
            - self.arm.centrifugal_torque_nm(&rates, &pose);
        let moment = across.dot(load.vector());
        let centripetal = self.arm.centripetal_m_s2(&pose, &rates).y;
        let scale = 1.0 / (normal.x * inertia.y - normal.y * inertia.x);
        State::new(
            rates.first(),
            rates.second(),
            -(centripetal * inertia.y + normal.y * moment) * scale,
            (centripetal * inertia.x + normal.x * moment) * scale,
        )
    }

    /// Evaluates the equations of a mode at a state.
    #[inline(always)]
    pub fn evaluate(&self, mode: ContactMode, t_s: f64, state: &State) -> Evaluation {
        self.with_terms(mode, t_s, &StateTerms::new(self.arm, state))
    }

    /// Evaluates the equations of a mode at a state whose terms are known.
    #[inline(always)]
    pub fn with_terms(&self, mode: ContactMode, t_s: f64, terms: &StateTerms) -> Evaluation {
        self.under_torque(mode, t_s, self.torque.at(t_s), terms)
    }

    /// Evaluates the equations of a mode at a state whose terms are known, at given joint torques.
    ///
    /// A sliding tip needs no Q: with the edge of the friction cone d = (−μ s, 1), f = f_n d,
    /// p = j2 M⁻¹ Jᵀ d and θ̈ = M⁻¹ load + M⁻¹ Jᵀ d f_n, where f_n = −b/p.
    #[inline(always)]
    pub fn under_torque(
        &self,
        mode: ContactMode,
        t_s: f64,
        torque_nm: JointTorque<f64>,
        terms: &StateTerms,
    ) -> Evaluation {
        let (pose, mobility) = (&terms.known.pose, terms.mobility);
        let jacobian = self.arm.jacobian(pose);
        let along = Vector2::new(jacobian.m11, jacobian.m12);
        let normal = Vector2::new(jacobian.m21, jacobian.m22);
        let centripetal = terms.centripetal_m_s2;
        let load = torque_nm.to_links() - terms.resistance_nm;

        let free = mobility * load.vector();
        let rates = terms.rates.vector();
        let slip_m_s = along.dot(rates) - self.belt.speed_m_s(t_s);
        let direction = mode.slip().unwrap_or_else(|| Slip::of(slip_m_s));
        let friction = self.friction * direction.sign::<f64>();
        let response = mobility * (normal - along * friction);
        let b_m_s2 = normal.dot(&free) + centripetal.y;
        let mut p_per_kg = normal.dot(&response);
        let (force_n, acceleration) = match mode {
            ContactMode::Flight => (Vector2::zeros(), free),
            ContactMode::SlidePositive | ContactMode::SlideNegative => {
                let normal_n = -b_m_s2 / p_per_kg;
                (
                    Vector2::new(-friction * normal_n, normal_n),
                    free + response * normal_n,
                )
            }
            ContactMode::Stick => {
                let contact = ContactTerms {
                    q: jacobian * mobility * jacobian.transpose(),
                    free_acceleration_m_s2: jacobian * free + centripetal,
                };
                let force = self.force_n(t_s, mode, &contact);
                // Its own slip is rounding.
                p_per_kg = contact.p_per_kg(self.friction, Slip::of(-force.x));
                (force, free + mobility * (jacobian.transpose() * force))
            }
        };
        Evaluation {
            slope: State::new(rates.x, rates.y, acceleration.x, acceleration.y),
            force_n,
            tip_t_m: self.arm.tip_m(pose).x,
            gap: [
                self.arm.gap_m(pose),
                normal.dot(rates),
                normal.dot(&acceleration) + centripetal.y,
            ],
            slip: [
                slip_m_s,
                along.dot(&acceleration) + centripetal.x - self.belt.acceleration_m_s2(t_s),
            ],
            b_m_s2,
            p_per_kg,
            q22_per_kg: normal.dot(&(mobility * normal)),
        }
    }

    /// Returns the tip velocity relative to the belt, (v_r, v_n), m/s.
    pub fn relative_velocity_m_s(&self, t_s: f64, state: &State) -> Vector2<f64> {
        let velocity = self.arm.jacobian(&Pose::new(&theta(state))) * theta_dot(state).vector();
        Vector2::new(velocity.x - self.belt.speed_m_s(t_s), velocity.y)
    }

    /// Returns the height of the tip above the belt, m.
    pub fn gap_m(&self, state: &State) -> f64 {
        self.arm.gap_m(&Pose::new(&theta(state)))
    }

    /// Returns the position of the tip along the belt, m.
    pub fn tip_t_m(&self, state: &State) -> f64 {
        self.arm.tip_m(&Pose::new(&theta(state))).x
    }

    /// Changes the link rates by a tip impulse (P_t, P_n), N·s.
    pub fn apply_impulse(&self, state: &State, impulse_ns: &Vector2<f64>) -> State {
        let pose = Pose::new(&theta(state));
        let change = self.arm.inverse_mass_matrix(&pose)
            * (self.arm.jacobian(&pose).transpose() * impulse_ns);
        state + State::new(0.0, 0.0, change.x, change.y)
    }

    /// Returns the nearest state, in the metric of kinetic energy, with the tip on the belt and no
    /// normal velocity. Removes integration errors.
    pub fn onto_belt(&self, state: &State) -> State {
        self.onto_belt_from(&Pose::new(&theta(state)), state)
    }

    /// Returns [`Motion::onto_belt`] of a state whose pose is known.
    #[inline]
    pub fn onto_belt_from(&self, pose: &Pose<f64>, state: &State) -> State {
        let (mut angles, rates) = (theta(state), *theta_dot(state).vector());
        let [mut along, mut normal, mut direction, mut change] = self.towards_belt(pose);
        if change.amax() > FIRST_ORDER_RAD {
            angles = theta(&self.lowered_onto_belt(state));
            [along, normal, direction, change] = self.towards_belt(&Pose::new(&angles));
        }
        angles += LinkMotion::from_vector(change);
        // ∂²z_n/∂θ² is the row along the belt.
        normal += along.component_mul(&change);
        let rates = rates - direction * (normal.dot(&rates) / normal.dot(&direction));
        State::new(angles.first(), angles.second(), rates.x, rates.y)
    }

    /// Returns the Jacobian's rows along and normal to the belt, the direction M⁻¹ j2, and the
    /// change of the angles along it that moves the tip onto the belt, to first order.
    #[inline]
    fn towards_belt(&self, pose: &Pose<f64>) -> [Vector2<f64>; 4] {
        let jacobian = self.arm.jacobian(pose);
        let along = Vector2::new(jacobian.m11, jacobian.m12);
        let normal = Vector2::new(jacobian.m21, jacobian.m22);
        let direction = self.arm.inverse_mass_matrix(pose) * normal;
        let change = direction * (-self.arm.gap_m(pose) / normal.dot(&direction));
        [along, normal, direction, change]
    }

    /// Returns the start with its tip on the belt, if the tip is at most 0.1 mm above it; `None` for a higher tip.
    /// `surface` is that of the belt at each z_t (m).
    ///
    /// # Errors
    /// [`OutOfRange`] if the tip is more than 1 mm inside the flat belt, or if the arm has to turn far.
    pub fn start_on_belt(
        &self,
        start: &State,
        surface: impl Fn(f64) -> SurfacePoint,
    ) -> Result<Option<State>, OutOfRange> {
        let gap_m = self.gap_m(start);
        range::check(
            INITIAL_HEIGHT,
            gap_m,
            -INSIDE_AT_START_M,
            self.arm.height_m() + self.arm.reach_m(),
        )?;
        let gap_over = |state: &State| self.gap_m(state) - surface(self.tip_t_m(state)).height_m;
        if gap_m.min(gap_over(start)) >= CONTACT_AT_START_M {
            return Ok(None);
        }
        let on_belt = self.lowered_onto(start, &surface);
        let turn_deg = if gap_over(&on_belt).abs() < ON_BELT_M {
            (on_belt - start).norm().to_degrees()
        } else {
            f64::INFINITY
        };
        range::check(
            "turn of initial.theta1_deg and initial.theta2_deg onto the belt in degrees",
            turn_deg,
            0.0,
            LARGEST_TURN_AT_START_DEG,
        )?;
        Ok(Some(on_belt))
    }

    /// Returns the nearest state with the tip at belt height and unchanged velocities.
    pub fn lowered_onto_belt(&self, state: &State) -> State {
        self.lowered_onto(state, |_| SurfacePoint::default())
    }

    #[inline]
    fn lowered_onto(&self, state: &State, surface: impl Fn(f64) -> SurfacePoint) -> State {
        let mut state = *state;
        // Newton's method: two iterations remove any integration error to rounding; the others are
        // for initial conditions set by the user.
        for _ in 0..8 {
            let pose = Pose::new(&theta(&state));
            let SurfacePoint {
                height_m, slope, ..
            } = surface(self.arm.tip_m(&pose).x);
            let gap = self.arm.gap_m(&pose) - height_m;
            if gap.abs() < 1e-16 {
                break;
            }
            let jacobian = self.arm.jacobian(&pose);
            let normal = (jacobian.row(1) - jacobian.row(0) * slope).transpose();
            let direction = self.arm.inverse_mass_matrix(&pose) * normal;
            let change = direction * (-gap / normal.dot(&direction));
            state += State::new(change.x, change.y, 0.0, 0.0);
        }
        state
    }

    /// Returns the state with the tip at (`tip_t_m`, belt height), moving with the belt.
    pub fn onto_stick(&self, t_s: f64, tip_t_m: f64, state: &State) -> State {
        let mut state = *state;
        for _ in 0..4 {
            let pose = Pose::new(&theta(&state));
            let error = Vector2::new(tip_t_m - self.arm.tip_m(&pose).x, -self.arm.gap_m(&pose));
            if error.norm() < 1e-16 {
                break;
            }
            let Some(change) = self.arm.jacobian(&pose).lu().solve(&error) else {
                break;
            };
            state += State::new(change.x, change.y, 0.0, 0.0);
        }
        let jacobian = self.arm.jacobian(&Pose::new(&theta(&state)));
        let belt = Vector2::new(self.belt.speed_m_s(t_s), 0.0);
        match jacobian.lu().solve(&belt) {
            Some(rates) => State::new(state[0], state[1], rates.x, rates.y),
            None => state,
        }
    }
}

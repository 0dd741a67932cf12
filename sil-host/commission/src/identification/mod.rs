//! Identification of an arm's geometry and joints by slides of its tip along the belt.
//!
//! The arm's own controller makes the slides: with a small force, slowly, to and fro, and with the governor's distance for an
//! arm that is known badly. The operator sets the tip down in each posture, and lets the belt run in the direction in which
//! friction does not press the tip into it. A first round, short of the edges, corrects the zeros; a second one goes nearer. The
//! torques of the slides show the joints' friction and springs.
//!
//! The belt's waves and vibration, and whatever else the controller does not know, accelerate the tip by some a. The normal
//! force ripples by a/p, as the slides show. In use, the governor keeps p so large that the ripple leaves most of the force.

mod found;
mod known;
mod slid;

use core::convert::Infallible;

use painleve_firmware::law::LawSettings;
use painleve_identify::forces::MEAN_S;
use painleve_identify::parameters::Drawn;
use painleve_identify::verdict::{check_friction, misread};
use painleve_identify::{Limits, Prior, Refusal, Slide, identify};
use painleve_plant::decimal::as_written;
use painleve_plant::mechanics::motion::theta;
use painleve_plant::scenario::{Scenario, ScenarioError};
use painleve_shared::{Arm, OutOfRange, Posture};

use known::{setting, told_m};

pub use found::Found;
pub use known::{is_new, prior};
pub(crate) use known::{suppose_drawn, terms};
pub use slid::{Slid, SlideTick, Surprise, readings};

/// Normal force of a slide, N.
pub const FORCE_N: f64 = 4.0;

/// Least normal force of a tip on the belt in a slide, N.
const CONTACT_N: f64 = 0.25 * FORCE_N;

/// Speed of a slide, m/s.
const SPEED_M_S: f64 = 0.06;

/// Time before a slide in which the drive arms and the friction is found, s.
const REST_S: f64 = 0.5;

/// Ends of the slides of each round, as a part of the reach; the governor stops them earlier where it has to.
const ROUNDS: [f64; 2] = [0.6, 0.93];

/// Number of slides: one in each posture a round.
pub const SLIDES: usize = 2 * ROUNDS.len();

/// Least p of a slide, 1/kg: where a belt's vibration of 5 m/s² takes a fifth of the force.
const LEAST_P_PER_KG: f64 = 6.0;

/// The same of a heavy arm, as a part of Q22 at the middle.
const LEAST_OF_Q22: f64 = 0.6;

/// Largest deviation of the tip's position, as a part of the reach, of a long arm: a small one may have that of its limits.
const DEVIATION_OF_REACH: f64 = 0.0027;

/// Speed at which a tip that has left the belt is lowered onto it in the second round, m/s: on a belt that hangs, a faster tip
/// bounces off again and again. In the first round the belt may be farther off than that finds in time.
const LANDING_M_S: f32 = 0.005;

/// Speed of the belt in a slide, m/s. Waves and seam shake a tip with the square of the speed.
const BELT_M_S: f64 = 0.15;

/// Speed of a tip along the belt, in its direction, from which the belt carries it, m/s: between that of a slide and that of
/// its belt.
const CARRIED_M_S: f64 = (SPEED_M_S + BELT_M_S) / 2.0;

/// Normal forces of the attempts at a slide whose tip leaves the belt or is thrown along it, N: torques that a badly known
/// model takes for those of the arm may lift a tip that presses less.
const ATTEMPTS_N: [f64; 3] = [FORCE_N, 1.25 * FORCE_N, 1.5 * FORCE_N];

/// An arm whose controller slides its tip, and its operator.
pub trait SlideRig {
    /// Failure of the rig.
    type Error: std::error::Error;

    /// Makes the slide with this index, of [`SLIDES`]: has the tip set down in a posture and the belt run as the scenario
    /// says, runs the controller with its settings and reference, and returns the ticks from the start of the reference to
    /// its end, or until the tip was lost or there is a [surprise](Slid::surprise).
    ///
    /// # Errors
    /// If the operator gives up, or the rig or its drive fails.
    fn slide(
        &mut self,
        index: usize,
        scenario: &Scenario,
        posture: Posture,
    ) -> Result<Slid, Self::Error>;

    /// Tells the operator why the last slide is repeated, with the tip pressed by `force_n` (N).
    fn repeats(&mut self, reason: &Refusal, force_n: f64) {
        let _ = (reason, force_n);
    }
}

/// Reason for the end of an identification without a result.
#[derive(Debug, thiserror::Error)]
pub enum IdentificationError<E: std::error::Error> {
    /// The rig failed.
    #[error(transparent)]
    Rig(E),
    /// The slides do not give a result.
    #[error("{0}")]
    Refused(#[from] Refusal),
    /// The scenario cannot slide.
    #[error("{0}")]
    Scenario(#[from] ScenarioError),
    /// The scenario's start is out of range.
    #[error("{0}")]
    Range(#[from] OutOfRange),
}

/// Returns the limits for a scenario's converters.
pub fn limits(scenario: &Scenario) -> Limits {
    let counts = f64::from(1_u32 << scenario.converters.encoder.bits);
    let reach_m = Arm::new(scenario.controller_configuration().arm)
        .map_or(0.0, |arm| f64::from(arm.reach_on_belt_m()));
    let least = Limits::default();
    Limits {
        torque_limit_nm: as_written(scenario.controller.torque_limit_nm),
        count_rad: core::f64::consts::TAU / counts,
        contact_n: CONTACT_N,
        carried_m_s: CARRIED_M_S,
        tip_deviation_m: least.tip_deviation_m.max(DEVIATION_OF_REACH * reach_m),
        ..least
    }
}

/// Returns the slide of ticks in a posture, of the ticks that a `whole` one has.
pub fn slide_of(
    scenario: &Scenario,
    posture: Posture,
    ticks: Vec<SlideTick>,
    whole: usize,
) -> Slide {
    let count = ticks.len();
    let readings = readings(scenario, ticks);
    Slide {
        posture,
        missing: count - readings.len(),
        whole,
        readings,
    }
}

/// Returns the scenario of a slide in a posture, under a normal force (N), to both ends, a part of the reach from the
/// middle. The belt runs in the direction in which p is larger.
///
/// # Errors
/// [`ScenarioError`] if the arm does not reach the belt, or a value is out of range.
pub fn slide_scenario(
    scenario: &Scenario,
    share: f64,
    posture: Posture,
    force_n: f64,
) -> Result<Scenario, ScenarioError> {
    let arm = Arm::new(scenario.controller_configuration().arm)
        .map_err(|source| ScenarioError::range(&scenario.name, source))?;
    let end_m = share * f64::from(arm.reach_on_belt_m());
    let half_s = end_m / SPEED_M_S;
    let duration_s = 4.0 * half_s + 3.0 * REST_S;
    let reference = format!(
        "controller.reference=[{{ hold = {{ duration_s = {REST_S} }} }}, \
         {{ ramp = {{ target_m = {from}, duration_s = {half_s} }} }}, \
         {{ ramp = {{ target_m = {end_m}, duration_s = {both_s} }} }}, \
         {{ ramp = {{ target_m = 0.0, duration_s = {half_s} }} }}]",
        from = -end_m,
        both_s = 2.0 * half_s,
    );
    // p = Q22 − μ s Q12 with the slip's direction s, against that of the belt.
    let row = arm.inverse_inertia_row_on_belt(0.0, posture);
    let speed_m_s = BELT_M_S.copysign(row.map_or(1.0, |row| f64::from(row.q12)));
    let light = row.map_or(f64::INFINITY, |row| f64::from(row.q22 / row.factor));
    let least_p_per_kg = LEAST_P_PER_KG.min(LEAST_OF_Q22 * light);
    // A hybrid law keeps its gains.
    let law = match scenario.controller.law.of_set() {
        Some(LawSettings::Hybrid(_)) => {
            format!("controller.law.hybrid.normal_force_n={force_n:?}")
        }
        _ => format!("controller.law={{ hybrid = {{ normal_force_n = {force_n:?} }} }}"),
    };
    let overrides = [
        law,
        reference,
        format!("run.duration_s={duration_s}"),
        "controller.governor.enabled=true".to_owned(),
        format!("controller.governor.p_per_kg={least_p_per_kg:?}"),
        format!("belt.profile={{ kind = 'constant', speed_m_s = {speed_m_s:?} }}"),
    ];
    scenario.clone().with_overrides(&scenario.name, &overrides)
}

/// Identifies an arm by slides that have been made.
///
/// # Errors
/// [`IdentificationError`] with the reason.
pub fn identify_slides(
    slides: &[Slide],
    scenario: &Scenario,
    drawn: &Drawn,
) -> Result<Found, IdentificationError<Infallible>> {
    let prior = prior(scenario, drawn);
    let identified = identify(slides, &prior, &limits(scenario))?;
    Ok(Found::new(identified, prior, slides, scenario)?)
}

/// Slides once, and returns the slide with the reason to refuse it.
fn attempt<R: SlideRig>(
    rig: &mut R,
    program: &Scenario,
    index: usize,
    posture: Posture,
    prior: &Prior,
    limits: &Limits,
) -> Result<(Slide, Option<Refusal>), R::Error> {
    let slid = rig.slide(index, program, posture)?;
    let surprise = slid.surprise(program);
    let whole = if slid.is_complete {
        slid.ticks.len()
    } else {
        program.run.ticks() as usize
    };
    let slide = slide_of(program, posture, slid.ticks, whole);
    let of_friction = || {
        let belt_m_s = program.belt.profile.speed_m_s(0.0);
        check_friction(index, &slide, belt_m_s, limits).err()
    };
    let refusal = if let Err(limited) = slide.check_torque(index, limits) {
        Some(limited)
    } else if let Some(surprise) = surprise {
        // A tip that was thrown at once shows no friction.
        let slid_s = slide.on_belt(limits).count() as f64 / f64::from(program.run.tick_hz);
        let has_slid = slid_s >= MEAN_S;
        misread(index, &slide, prior, limits)
            .or_else(|| of_friction().filter(|_| has_slid))
            .or(Some(surprise.refusal(index)))
    } else {
        let of_belt = slide.check_on_belt(index, limits).err();
        of_belt.or_else(of_friction)
    };
    Ok((slide, refusal))
}

/// Slides in both postures, and identifies the arm. The scenario's posture comes first, so that the operator turns the
/// elbow once for each round.
///
/// # Errors
/// [`IdentificationError`] with the reason.
pub fn identify_arm<R: SlideRig>(
    rig: &mut R,
    scenario: &Scenario,
    drawn: &Drawn,
) -> Result<Found, IdentificationError<R::Error>> {
    let prior = prior(scenario, drawn);
    let limits = limits(scenario);
    let first = posture(scenario)?;
    let mut slides = Vec::new();
    let mut slide = |known: &Scenario, share: f64, postures: [Posture; 2]| {
        for posture in postures {
            let index = slides.len();
            let attempt = |rig: &mut R, force_n| {
                let program = slide_scenario(known, share, posture, force_n)?;
                attempt(rig, &program, index, posture, &prior, &limits)
                    .map_err(IdentificationError::Rig)
            };
            let [first_n, others_n @ ..] = ATTEMPTS_N;
            let (mut slide, mut refusal) = attempt(rig, first_n)?;
            for force_n in others_n {
                match &refusal {
                    Some(lost @ (Refusal::MovedTooFast { .. } | Refusal::NotOnBelt { .. })) => {
                        rig.repeats(lost, force_n);
                        (slide, refusal) = attempt(rig, force_n)?;
                    }
                    _ => break,
                }
            }
            match refusal {
                // What is left of a lost tip may be refused for a better reason.
                None | Some(Refusal::NotOnBelt { .. }) => slides.push(slide),
                Some(refusal) => return Err(refusal.into()),
            }
        }
        Ok::<_, IdentificationError<R::Error>>(slides.clone())
    };
    let [near, far] = ROUNDS;
    let mut known = scenario.clone();
    let deviation_m = libm::hypot(prior.tip_deviation_m(), told_m(scenario));
    known.controller.estimator.tip_deviation_m = setting(deviation_m);
    let slid = slide(&known, near, [first, first.mirrored()])?;
    let identified = identify(&slid, &prior, &limits.of_first_look())?;
    let known = Found::new(identified, prior, &slid, scenario)?;
    let mut known = known.applied_to(scenario, "first look")?;
    let landing_m_s = &mut known.controller.recovery.landing_speed_m_s;
    *landing_m_s = landing_m_s.min(LANDING_M_S);
    // The elbow stays as it is.
    let slid = slide(&known, far, [first.mirrored(), first])?;
    let identified = identify(&slid, &prior, &limits)?;
    Ok(Found::new(identified, prior, &slid, scenario)?)
}

/// Returns the posture of a scenario's start.
fn posture(scenario: &Scenario) -> Result<Posture, OutOfRange> {
    Ok(Posture::of(&theta(&scenario.initial.state(&scenario.arm)?)))
}

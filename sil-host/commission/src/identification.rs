//! Identification of an arm's geometry and joints by slides of its tip along the belt.
//!
//! The arm's own controller makes the slides: with a small force, slowly, to and fro, and with the governor's distance for an
//! arm that is known badly. The operator sets the tip down in each posture, and lets the belt run in the direction in which
//! friction does not press the tip into it. A first round, short of the edges, corrects the zeros; a second one goes nearer. The
//! torques of the slides show the joints' friction and springs.
//!
//! The belt's waves and vibration, and whatever else the controller does not know, accelerate the tip by some a. The normal
//! force ripples by a/p, as the slides show. In use, the governor keeps p so large that the ripple leaves most of the force.

mod slid;

use core::convert::Infallible;

use painleve_firmware::estimate::encoder_correction::EncoderCorrection;
use painleve_firmware::law::LawSettings;
use painleve_identify::geometry::joint_rad;
use painleve_identify::parameters::Drawn;
use painleve_identify::torques::{Estimate, Joints};
use painleve_identify::verdict::{check_friction, misread};
use painleve_identify::{
    Identified, Limits, Parameter, Parameters, Prior, Reading, Refusal, Slide, identify,
};
use painleve_plant::decimal::as_written;
use painleve_plant::mechanics::motion::theta;
use painleve_plant::scenario::{Knowledge, Scenario, ScenarioError};
use painleve_shared::{Arm, ArmParameters, LinkMotion, OutOfRange, Pose, Posture};

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

/// Multiple of the ripple's root mean square that the wanted normal force must exceed in use.
const RIPPLES: f64 = 8.0;

/// Time constant of the mean force from which the ripple is taken, s.
const MEAN_S: f64 = 0.1;

/// Where the values of an arm come from that has been drawn and commissioned.
const DRAWN: &str = "drawn, zeros by plumb line";

/// Largest deviation of a joint's friction or stiffness, as a part of the larger of its values before and now, with which the
/// new value is better than the old one.
const BETTER: f64 = 0.5;

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

/// Returns what the scenario's controller knows: values, with the deviations of an arm that has been drawn.
pub fn prior(scenario: &Scenario, drawn: &Drawn) -> Prior {
    let configuration = scenario.controller_configuration();
    let arm = configuration.arm;
    let mut correction = configuration.settings.estimator.encoders;
    let mut parameters =
        Parameters::of_arm(arm.link_length_m.map(as_written), as_written(arm.height_m));
    for (parameter, values_rad) in terms(&mut correction) {
        for (joint, value_rad) in values_rad.iter().enumerate() {
            parameters.set(parameter(joint), as_written(*value_rad));
        }
    }
    drawn.prior(parameters)
}

/// A parameter of each joint's encoder.
pub(crate) type OfJoint = fn(usize) -> Parameter;

/// Returns the parameters of the encoders, each with its setting.
pub(crate) fn terms(correction: &mut EncoderCorrection) -> [(OfJoint, &mut [f32; 2]); 5] {
    [
        (Parameter::Zero, &mut correction.zero_rad),
        (Parameter::Sine, &mut correction.sine_rad),
        (Parameter::Cosine, &mut correction.cosine_rad),
        (Parameter::SecondSine, &mut correction.second_sine_rad),
        (Parameter::SecondCosine, &mut correction.second_cosine_rad),
    ]
}

/// Forgets what slides have shown, and lets the governor keep a distance for what a drawing, a plumb line and a tape leave
/// unknown.
pub(crate) fn suppose_drawn(scenario: &mut Scenario) {
    let told_m = told_m(scenario);
    let prior = prior(scenario, &Drawn::default());
    let deviation_m = libm::hypot(prior.tip_deviation_m(), told_m);
    scenario.controller.estimator.tip_deviation_m = setting(deviation_m);
    let deviation = |parameter: Parameter| prior.deviations[parameter.index()];
    scenario.knowledge = Knowledge {
        source: DRAWN.into(),
        told_m: rounded(told_m),
        ..of_geometry(&prior.parameters, deviation)
    };
}

/// Returns the knowledge of the geometry alone.
fn of_geometry(parameters: &Parameters, deviation: impl Fn(Parameter) -> f64) -> Knowledge {
    let deviation = |parameter: Parameter| rounded(deviation(parameter));
    let larger = |one: OfJoint, other: OfJoint| {
        [0, 1].map(|joint| deviation(one(joint)).max(deviation(other(joint))))
    };
    let [length_1, _] = parameters.link_length_m();
    let ratio = deviation(Parameter::Ratio) * length_1;
    let length = deviation(Parameter::Length);
    let length_2 = libm::hypot(parameters.get(Parameter::Ratio) * length, ratio);
    Knowledge {
        encoder_zero_rad: [0, 1].map(|joint| deviation(Parameter::Zero(joint))),
        encoder_once_rad: larger(Parameter::Sine, Parameter::Cosine),
        encoder_twice_rad: larger(Parameter::SecondSine, Parameter::SecondCosine),
        link_length_m: [length, rounded(length_2)],
        height_m: deviation(Parameter::Height),
        ..Knowledge::default()
    }
}

/// Returns whether a scenario has never been commissioned or identified.
pub fn is_new(scenario: &Scenario) -> bool {
    let of_new = Knowledge {
        told_m: scenario.knowledge.told_m,
        ..Knowledge::default()
    };
    scenario.knowledge == of_new
}

/// Returns the deviation of the tip that the operator has told, m: for play of the gears, say.
fn told_m(scenario: &Scenario) -> f64 {
    let told_m = scenario.knowledge.told_m;
    if is_new(scenario) {
        told_m.max(as_written(scenario.controller.estimator.tip_deviation_m))
    } else {
        told_m
    }
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

/// Returns a deviation of the tip, m, as a setting.
fn setting(deviation_m: f64) -> f32 {
    rounded(deviation_m) as f32
}

/// Returns a number to eight decimals, which is what a file needs.
fn rounded(value: f64) -> f64 {
    (value * 1e8).round() / 1e8
}

/// An identified arm.
#[derive(Clone, Debug)]
pub struct Found {
    /// The result.
    pub identified: Identified,
    /// What was known before.
    pub prior: Prior,
    /// What the torques show.
    pub joints: Joints,
    /// Acceleration of the tip off the belt by what the controller does not know, root mean square, m/s²: the ripple of the
    /// normal force times p. Zero without a reading on the belt.
    pub ripple_m_s2: f64,
    /// Friction coefficient of the tip on the belt; not a number if the belt has carried the tip all the time.
    pub friction: f64,
    /// The same by the scenario.
    pub told_friction: f64,
}

impl Found {
    fn new(
        identified: Identified,
        prior: Prior,
        slides: &[Slide],
        scenario: &Scenario,
    ) -> Result<Self, Refusal> {
        let geometry = &identified.fit.parameters;
        let known = ArmParameters {
            link_length_m: geometry.link_length_m(),
            height_m: geometry.get(Parameter::Height),
            ..scenario.controller_configuration().arm.cast()
        };
        let limits = limits(scenario);
        let tick_hz = f64::from(scenario.run.tick_hz);
        let joints = Joints::of(slides, geometry, &known, tick_hz, &limits)?;
        joints.check()?;
        let arm = Arm::new(known)?;
        Ok(Self {
            joints,
            friction: friction(slides, geometry, &arm, tick_hz, &limits),
            told_friction: scenario.belt.friction,
            ripple_m_s2: ripple_m_s2(slides, geometry, &arm, tick_hz, &limits),
            identified,
            prior,
        })
    }

    /// Returns the scenario with the values and deviations. `source` says where they come from.
    ///
    /// # Errors
    /// [`Refusal::OutOfRange`] for a value that the controller does not take.
    pub fn applied_to(&self, scenario: &Scenario, source: &str) -> Result<Scenario, Refusal> {
        let fit = &self.identified.fit;
        let parameters = &fit.parameters;
        let mut corrected = scenario.clone();
        let mut arm = scenario.controller_configuration().arm;
        arm.link_length_m = parameters.link_length_m().map(|it| rounded(it) as f32);
        arm.height_m = rounded(parameters.get(Parameter::Height)) as f32;
        let Knowledge {
            mut coulomb_friction_nm,
            mut stiffness_nm_rad,
            ..
        } = scenario.knowledge;
        // Torques that show nothing leave what was known.
        let has_torques = self.joints.left_over_nm.is_some();
        for (joint, found) in self.joints.joints.iter().enumerate() {
            for (value, deviation, estimate) in [
                (
                    &mut arm.coulomb_friction_nm[joint],
                    &mut coulomb_friction_nm[joint],
                    found.friction_nm,
                ),
                (
                    &mut arm.stiffness_nm_rad[joint],
                    &mut stiffness_nm_rad[joint],
                    found.stiffness_nm_rad,
                ),
            ] {
                if has_torques && is_better(estimate, *value) {
                    *value = rounded(estimate.value).max(0.0) as f32;
                    *deviation = rounded(estimate.deviation);
                }
            }
        }
        corrected.arm_model = Some(arm);
        let estimator = &mut corrected.controller.estimator;
        for (parameter, values_rad) in terms(&mut estimator.encoders) {
            *values_rad = [0, 1].map(|joint| rounded(parameters.get(parameter(joint))) as f32);
        }
        let deviation_m = libm::hypot(self.identified.tip_deviation_m, told_m(scenario));
        estimator.tip_deviation_m = setting(deviation_m);
        let ripple_m_s2 = self.ripple_m_s2;
        if let Some(LawSettings::Hybrid(law)) = corrected.controller.law.of_set() {
            let least = RIPPLES * ripple_m_s2 / f64::from(law.normal_force_n).max(1e-3);
            corrected.controller.governor.p_per_kg = rounded(least) as f32;
        }
        corrected.knowledge = Knowledge {
            source: source.into(),
            tip_m: rounded(self.identified.place_deviation_m),
            told_m: rounded(told_m(scenario)),
            off_line_m: rounded(self.identified.off_line_m[1]),
            ripple_m_s2: rounded(ripple_m_s2),
            coulomb_friction_nm,
            stiffness_nm_rad,
            ..of_geometry(parameters, |parameter| fit.deviation(parameter))
        };
        painleve_shared::settings::Settings::validate(&corrected)?;
        Ok(corrected)
    }
}

/// Returns the friction coefficient of slides: the sum of |f_t| over that of f_n, as long as the belt does not carry the tip.
fn friction(
    slides: &[Slide],
    geometry: &Parameters,
    arm: &Arm<f64>,
    tick_hz: f64,
    limits: &Limits,
) -> f64 {
    let tip_t_m = |reading: &Reading| arm.tip_m(&pose(geometry, reading)).x;
    let ticks = (MEAN_S * tick_hz).max(1.0) as u32;
    let mut sums_n = [0.0; 2];
    for slide in slides {
        let touching: Vec<&Reading> = slide.on_belt(limits).collect();
        let Some(first) = touching.first() else {
            continue;
        };
        let time = |reading: &Reading| reading.tick.wrapping_sub(first.tick) / ticks;
        for of_time in touching.chunk_by(|one, other| time(one) == time(other)) {
            let [from, .., to] = of_time else {
                continue;
            };
            let time_s = f64::from(to.tick.wrapping_sub(from.tick)) / tick_hz;
            let speed_m_s = (tip_t_m(to) - tip_t_m(from)) / time_s;
            let along_n: f64 = of_time.iter().map(|it| it.force_n[0]).sum();
            // Friction pushes the tip as the belt runs.
            if speed_m_s * along_n.signum() > CARRIED_M_S {
                continue;
            }
            for reading in of_time {
                for (sum_n, force_n) in sums_n.iter_mut().zip(reading.force_n) {
                    *sum_n += force_n.abs();
                }
            }
        }
    }
    let [tangential_n, normal_n] = sums_n;
    tangential_n / normal_n
}

/// Returns the pose of a reading.
fn pose(geometry: &Parameters, reading: &Reading) -> Pose<f64> {
    let [first, elbow] =
        [0, 1].map(|joint| joint_rad(geometry, joint, reading.encoders_rad[joint]));
    Pose::new(&LinkMotion::new(first, first + elbow))
}

/// Returns the ripple of [`Found::ripple_m_s2`].
fn ripple_m_s2(
    slides: &[Slide],
    geometry: &Parameters,
    arm: &Arm<f64>,
    tick_hz: f64,
    limits: &Limits,
) -> f64 {
    let mean_ticks = MEAN_S * tick_hz;
    let (mut sum, mut count) = (0.0, 0_u32);
    for slide in slides {
        let touching = || slide.on_belt(limits);
        let Some(first) = touching().next() else {
            continue;
        };
        let since = |tick: u32, reading: &Reading| f64::from(reading.tick.wrapping_sub(tick));
        let (mut mean_n, mut beginning) = (0.0, 0.0);
        for reading in touching().take_while(|it| since(first.tick, it) < mean_ticks) {
            mean_n += reading.force_n[1];
            beginning += 1.0;
        }
        mean_n /= f64::max(beginning, 1.0);
        let mut before = first.tick;
        for reading in touching() {
            let [tangential_n, normal_n] = reading.force_n;
            let share = (since(before, reading) / mean_ticks).min(1.0);
            before = reading.tick;
            mean_n += share * (normal_n - mean_n);
            let q = arm.inverse_tip_inertia_per_kg(&pose(geometry, reading));
            let p = q.m22 + q.m12 * tangential_n / normal_n;
            let off_m_s2 = p * (normal_n - mean_n);
            sum += off_m_s2 * off_m_s2;
            count += 1;
        }
    }
    libm::sqrt(sum / f64::from(count.max(1)))
}

/// Returns whether a value found is better than the one before; it may be known so badly that it is not.
fn is_better(found: Estimate, before: f32) -> bool {
    found.deviation <= BETTER * found.value.max(f64::from(before))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_that_is_known_badly_does_not_replace_another() {
        let found = |value, deviation| Estimate { value, deviation };
        // No friction to speak of, where there was said to be some; then the other way round, and nothing known.
        assert!(is_better(found(0.001, 0.002), 0.05));
        assert!(is_better(found(0.06, 0.004), 0.0));
        assert!(!is_better(found(0.3, 0.4), 0.05));
        assert!(!is_better(found(-0.01, 0.02), 0.0));
    }

    #[test]
    fn a_force_that_stays_the_same_has_no_ripple_whatever_it_is() {
        let scenario = Scenario::default();
        let geometry = prior(&scenario, &Drawn::default()).parameters;
        let arm = Arm::new(scenario.arm).unwrap();
        let ripple_m_s2 = |ripple_n: f64, ticks: usize| {
            let readings = (0..3000_u32).step_by(ticks).map(|tick| Reading {
                tick,
                encoders_rad: [-0.5, 1.0],
                force_n: [0.0, 12.0 + ripple_n * libm::sin(0.2 * f64::from(tick))],
                torque_nm: [0.0; 2],
            });
            let slide = Slide {
                posture: Posture::ElbowUp,
                readings: readings.collect(),
                missing: 0,
                whole: 3000,
            };
            super::ripple_m_s2(&[slide], &geometry, &arm, 1000.0, &limits(&scenario))
        };
        assert!(ripple_m_s2(0.0, 1) < 1e-9);
        let rippling = ripple_m_s2(1.0, 1);
        assert!(rippling > 1.0, "{rippling}");
        // Whether every tick arrives does not matter.
        let sparse = ripple_m_s2(1.0, 4);
        assert!(
            (sparse / rippling - 1.0).abs() < 0.05,
            "{sparse} {rippling}"
        );
    }

    #[test]
    fn a_tip_that_its_belt_carries_shows_no_friction() {
        let scenario = Scenario::default();
        let geometry = prior(&scenario, &Drawn::default()).parameters;
        let arm = Arm::new(scenario.arm).unwrap();
        let reading = |tick: u32, tip_t_m: f64, along_n: f64| {
            let theta = arm.link_angles_on_belt_rad(tip_t_m, Posture::ElbowUp);
            Reading {
                tick,
                encoders_rad: theta.unwrap().to_joints().to_array(),
                force_n: [along_n, 4.0],
                torque_nm: [0.0; 2],
            }
        };
        let friction = |belt: f64, is_slid: bool| {
            let slid = (0..1000).map(|tick| {
                let tip_t_m = -0.06 * belt * f64::from(tick) * 1e-3;
                reading(tick, tip_t_m, 2.4 * belt)
            });
            let carried = (1000..2000).map(|tick| {
                let tip_t_m = BELT_M_S * belt * f64::from(tick - 1000) * 1e-3;
                reading(tick, tip_t_m, 0.8 * belt)
            });
            let slide = Slide {
                posture: Posture::ElbowUp,
                readings: slid.filter(|_| is_slid).chain(carried).collect(),
                missing: 0,
                whole: 2000,
            };
            super::friction(&[slide], &geometry, &arm, 1000.0, &limits(&scenario))
        };
        for belt in [1.0, -1.0] {
            let friction_of_slid = friction(belt, true);
            assert!((friction_of_slid - 0.6).abs() < 1e-9, "{friction_of_slid}");
            assert!(friction(belt, false).is_nan());
        }
    }

    #[test]
    fn a_told_deviation_is_kept_beside_what_is_known() {
        for key in ["controller.estimator.tip_deviation_m", "knowledge.told_m"] {
            let told = [format!("{key}=0.003")];
            let mut scenario = Scenario::default().with_overrides("play", &told).unwrap();
            assert!(is_new(&scenario) && told_m(&scenario) == 0.003);
            let mut deviations_m = Vec::new();
            for _ in 0..2 {
                suppose_drawn(&mut scenario);
                assert!(!is_new(&scenario) && told_m(&scenario) == 0.003);
                deviations_m.push(scenario.controller.estimator.tip_deviation_m);
            }
            let drawn_m = prior(&scenario, &Drawn::default()).tip_deviation_m();
            let expected_m = setting(libm::hypot(drawn_m, 0.003));
            assert_eq!(deviations_m, [expected_m; 2]);
        }
    }
}

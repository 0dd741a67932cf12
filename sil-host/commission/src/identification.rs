//! Identification of an arm's geometry and joints by slides of its tip along the belt.
//!
//! The arm's own controller makes the slides: with a small force, slowly, to and fro, and with the governor's distance for an
//! arm that is known badly. The operator sets the tip down in each posture, and lets the belt run in the direction in which
//! friction does not press the tip into it. A first round, short of the edges, corrects the zeros; a second one goes nearer. The
//! torques of the slides show the joints' friction and springs.
//!
//! The belt's waves and vibration, and whatever else the controller does not know, accelerate the tip by some a. The normal
//! force ripples by a/p, as the slides show. In use, the governor keeps p so large that the ripple leaves most of the force.

use core::convert::Infallible;

use painleve_firmware::estimate::encoder_correction::EncoderCorrection;
use painleve_firmware::law::LawSettings;
use painleve_identify::geometry::joint_rad;
use painleve_identify::parameters::Drawn;
use painleve_identify::passes::ON_BELT;
use painleve_identify::torques::{Estimate, Joints};
use painleve_identify::{
    Identified, Limits, Parameter, Parameters, Prior, Reading, Refusal, Slide, identify,
};
use painleve_plant::decimal::as_written;
use painleve_plant::mechanics::motion::theta;
use painleve_plant::scenario::{Knowledge, Scenario, ScenarioError};
use painleve_shared::counts::{EncoderScale, TorqueCounts};
use painleve_shared::frame::SensorFrame;
use painleve_shared::{Arm, ArmParameters, LinkMotion, OutOfRange, Pose, Posture};

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

/// Least p of a slide, 1/kg: where a belt's vibration of 5 m/s² takes a fifth of the force.
const LEAST_P_PER_KG: f64 = 6.0;

/// Speed of the belt in a slide, m/s. Waves and seam shake a tip with the square of the speed.
const BELT_M_S: f64 = 0.15;

/// Multiple of the ripple's root mean square that the wanted normal force must exceed in use.
const RIPPLES: f64 = 8.0;

/// Rate at which the mean force follows, from which the ripple is taken, per tick.
const MEAN_PER_TICK: f64 = 0.01;

/// Normal forces of the attempts at a slide whose tip leaves the belt, N: torques that a badly known model takes for
/// those of the arm may lift a tip that presses less.
const ATTEMPTS_N: [f64; 3] = [FORCE_N, 1.25 * FORCE_N, 1.5 * FORCE_N];

/// A tick of a slide.
#[derive(Clone, Copy, Debug, Default)]
pub struct SlideTick {
    /// The readings.
    pub sensor: SensorFrame,
    /// The torques that answered them.
    pub torques: [TorqueCounts; 2],
}

/// An arm whose controller slides its tip, and its operator.
pub trait SlideRig {
    /// Failure of the rig.
    type Error: std::error::Error;

    /// Has the tip set down in a posture and the belt run as the scenario says, runs the controller with its settings and
    /// reference, and returns the ticks in which it was tracking.
    ///
    /// # Errors
    /// If the operator gives up, or the rig or its drive fails.
    fn slide(
        &mut self,
        scenario: &Scenario,
        posture: Posture,
    ) -> Result<Vec<SlideTick>, Self::Error>;
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
    /// A value is out of range.
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

/// Lets the governor of an arm that has never been identified keep a distance for what a drawing, a plumb line and a
/// tape leave unknown.
pub(crate) fn suppose_drawn(scenario: &mut Scenario) {
    if scenario.knowledge == Knowledge::default() {
        let drawn_m = setting(prior(scenario, &Drawn::default()).tip_deviation_m());
        scenario.knowledge.source = "drawn, zeros by plumb line".into();
        let deviation_m = &mut scenario.controller.estimator.tip_deviation_m;
        *deviation_m = deviation_m.max(drawn_m);
    }
}

/// Returns the limits for a scenario's converters.
pub fn limits(scenario: &Scenario) -> Limits {
    let counts = f64::from(1_u32 << scenario.converters.encoder.bits);
    Limits {
        count_rad: core::f64::consts::TAU / counts,
        contact_n: CONTACT_N,
        ..Limits::default()
    }
}

/// Returns the readings of ticks, by the scenario's zeros and scales. Ticks without all readings are left out.
pub fn readings(scenario: &Scenario, ticks: impl IntoIterator<Item = SlideTick>) -> Vec<Reading> {
    let scales = scenario.converters.scales();
    let [scale_1, scale_2] = scales.encoders;
    let newtons = f64::from(scales.force.per_count());
    let newton_metres = f64::from(scales.torque.per_count());
    let is_whole = |frame: &SensorFrame| {
        scale_1.contains(frame.joints[0])
            && scale_2.contains(frame.joints[1])
            && scales.force.contains(frame.normal_force.0)
            && scales.force.contains(frame.tangential_force.0)
    };
    let rad = |scale: EncoderScale, reading| {
        f64::from(scale.counts_from_zero(reading)) * scale.rad_per_count::<f64>()
    };
    ticks
        .into_iter()
        .filter(|tick| is_whole(&tick.sensor))
        .map(|SlideTick { sensor, torques }| Reading {
            encoders_rad: [
                rad(scale_1, sensor.joints[0]),
                rad(scale_2, sensor.joints[1]),
            ],
            force_n: [sensor.tangential_force, sensor.normal_force]
                .map(|force| f64::from(force.0) * newtons),
            torque_nm: torques.map(|torque| f64::from(torque.0) * newton_metres),
        })
        .collect()
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
    let arm = Arm::new(scenario.controller_configuration().arm).map_err(|source| {
        ScenarioError::Range {
            origin: scenario.name.clone(),
            source,
        }
    })?;
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
    let coupling = arm.inverse_inertia_row_on_belt(0.0, posture);
    let speed_m_s =
        BELT_M_S.copysign(coupling.map_or(1.0, |(tangential, ..)| f64::from(tangential)));
    let overrides = [
        format!("controller.law={{ hybrid = {{ normal_force_n = {force_n:?} }} }}"),
        reference,
        format!("run.duration_s={duration_s}"),
        "run.enable_at_s=0.0".into(),
        format!("controller.governor.p_per_kg={LEAST_P_PER_KG:?}"),
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
            let mut attempt = |force_n| {
                let program = slide_scenario(known, share, posture, force_n)?;
                let ticks = rig.slide(&program, posture);
                Ok::<_, IdentificationError<R::Error>>(Slide {
                    posture,
                    readings: readings(scenario, ticks.map_err(IdentificationError::Rig)?),
                })
            };
            let [first_n, others_n @ ..] = ATTEMPTS_N;
            let mut slide = attempt(first_n)?;
            for force_n in others_n {
                if slide.share_on_belt(&limits) < ON_BELT {
                    slide = attempt(force_n)?;
                }
            }
            slides.push(slide);
        }
        Ok::<_, IdentificationError<R::Error>>(slides.clone())
    };
    let [near, far] = ROUNDS;
    let mut known = scenario.clone();
    known.controller.estimator.tip_deviation_m = setting(prior.tip_deviation_m());
    let slid = slide(&known, near, [first, first.mirrored()])?;
    let identified = identify(&slid, &prior, &limits.of_first_look())?;
    let known = Found::new(identified, prior, &slid, scenario)?;
    let known = known.applied_to(scenario, "first look")?;
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
    rounded(deviation_m).min(0.1) as f32
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
    slides: Vec<Slide>,
}

impl Found {
    fn new(
        identified: Identified,
        prior: Prior,
        slides: &[Slide],
        scenario: &Scenario,
    ) -> Result<Self, OutOfRange> {
        let geometry = &identified.fit.parameters;
        let known = ArmParameters {
            link_length_m: geometry.link_length_m(),
            height_m: geometry.get(Parameter::Height),
            ..scenario.controller_configuration().arm.cast()
        };
        let limits = limits(scenario);
        Ok(Self {
            joints: Joints::of(
                slides,
                geometry,
                &known,
                f64::from(scenario.run.tick_hz),
                &limits,
            )?,
            identified,
            prior,
            slides: slides.to_vec(),
        })
    }

    /// Returns the acceleration of the tip off the belt by what the controller does not know, root mean square, m/s²: the
    /// ripple of the normal force times p. Zero without a reading on the belt.
    ///
    /// # Errors
    /// [`OutOfRange`] for an arm that cannot be built.
    pub fn ripple_m_s2(&self, arm: ArmParameters<f32>) -> Result<f64, OutOfRange> {
        let arm = Arm::new(arm)?;
        let parameters = &self.identified.fit.parameters;
        let (mut sum, mut count) = (0.0, 0_u32);
        for slide in &self.slides {
            let mut mean_n = FORCE_N;
            for reading in &slide.readings {
                let [tangential_n, normal_n] = reading.force_n;
                if normal_n < CONTACT_N {
                    continue;
                }
                mean_n += MEAN_PER_TICK * (normal_n - mean_n);
                let [first, elbow] =
                    [0, 1].map(|joint| joint_rad(parameters, joint, reading.encoders_rad[joint]));
                let theta = LinkMotion::new(first as f32, (first + elbow) as f32);
                let q = arm.inverse_tip_inertia(&Pose::new(&theta));
                let p = f64::from(q.m22) + f64::from(q.m12) * tangential_n / normal_n;
                let off_m_s2 = p * (normal_n - mean_n);
                sum += off_m_s2 * off_m_s2;
                count += 1;
            }
        }
        Ok(libm::sqrt(sum / f64::from(count.max(1))))
    }

    /// Returns the scenario with the values and deviations. `source` says where they come from.
    ///
    /// # Errors
    /// [`OutOfRange`] for a value that the controller does not take.
    pub fn applied_to(&self, scenario: &Scenario, source: &str) -> Result<Scenario, OutOfRange> {
        let fit = &self.identified.fit;
        let parameters = &fit.parameters;
        let mut corrected = scenario.clone();
        let mut arm = scenario.controller_configuration().arm;
        arm.link_length_m = parameters.link_length_m().map(|it| rounded(it) as f32);
        arm.height_m = rounded(parameters.get(Parameter::Height)) as f32;
        let joints = &self.joints.joints;
        let value = |it: Estimate| rounded(it.value).max(0.0) as f32;
        arm.coulomb_friction_nm = joints.map(|it| value(it.friction_nm));
        arm.stiffness_nm_rad = joints.map(|it| value(it.stiffness_nm_rad));
        corrected.arm_model = Some(arm);
        let estimator = &mut corrected.controller.estimator;
        for (parameter, values_rad) in terms(&mut estimator.encoders) {
            *values_rad = [0, 1].map(|joint| rounded(parameters.get(parameter(joint))) as f32);
        }
        estimator.tip_deviation_m = setting(self.identified.tip_deviation_m);
        let ripple_m_s2 = self.ripple_m_s2(arm)?;
        if let Some(LawSettings::Hybrid(law)) = corrected.controller.law.of_set() {
            let least = RIPPLES * ripple_m_s2 / f64::from(law.normal_force_n).max(1e-3);
            corrected.controller.governor.p_per_kg = rounded(least) as f32;
        }
        let deviation = |parameter: Parameter| rounded(fit.deviation(parameter));
        let larger = |one: OfJoint, other: OfJoint| {
            [0, 1].map(|joint| deviation(one(joint)).max(deviation(other(joint))))
        };
        let [length_1, _] = parameters.link_length_m();
        let ratio = deviation(Parameter::Ratio) * length_1;
        let length = deviation(Parameter::Length);
        corrected.knowledge = Knowledge {
            source: source.into(),
            encoder_zero_rad: [0, 1].map(|joint| deviation(Parameter::Zero(joint))),
            encoder_once_rad: larger(Parameter::Sine, Parameter::Cosine),
            encoder_twice_rad: larger(Parameter::SecondSine, Parameter::SecondCosine),
            link_length_m: [length, rounded(libm::hypot(length, ratio))],
            height_m: deviation(Parameter::Height),
            tip_m: rounded(self.identified.place_deviation_m),
            off_line_m: rounded(self.identified.off_line_m[1]),
            ripple_m_s2: rounded(ripple_m_s2),
            coulomb_friction_nm: joints.map(|it| rounded(it.friction_nm.deviation)),
            stiffness_nm_rad: joints.map(|it| rounded(it.stiffness_nm_rad.deviation)),
        };
        painleve_shared::settings::Settings::validate(&corrected)?;
        Ok(corrected)
    }
}

//! The scenario of one run of the campaign, drawn at random.

use core::ops::Range;

use painleve_plant::belt_line::admissible_m;
use painleve_plant::mechanics::belt::BeltProfile;
use painleve_plant::scenario::Scenario;
use painleve_shared::{Arm, Posture, Slip};
use painleve_study_core::StudyError;
use painleve_study_core::case::{self, Reference};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

use super::Arms;
use super::judge::CAPTURE_LIMIT_S;

/// Smallest p at the start, as a fraction of Q22. Nearer to the edge, an arm without torque
/// presses on the belt with hundreds of newtons, and sticks to it before the first tick.
const START_P_RATIO: f64 = 0.2;
/// Largest distance of a target beyond an edge, m.
const BEYOND_M: f64 = 0.02;
/// Settling time after the end of the reference, s.
const REST_S: f64 = 2.0;

/// Returns the scenario of run `index` of the campaign with these arms and this seed.
///
/// # Errors
/// [`StudyError`] if the built-in scenario is unavailable.
pub fn scenario(arms: Arms, seed: u64, index: u64) -> Result<Scenario, StudyError> {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(index);
    let mut draw = |range: Range<f64>| generator.random_range(range);
    let mut scenario = Scenario::load_unplaced("hybrid-elbow-down", &[])?;
    scenario.name = format!("robustness-{seed}-{index}");
    scenario.description = format!("Run {index} of the robustness campaign with seed {seed}");
    scenario.run.seed = seed.wrapping_add(index.wrapping_mul(0x9e37_79b9_7f4a_7c15)) >> 1;
    // Logarithmic: equally many runs per octave.
    scenario.run.tick_hz = (500.0 * libm::exp2(draw(0.0..libm::log2(10.0)))) as u32;

    let friction = draw(0.2..1.0);
    let speed_m_s = draw(0.1..1.0) * if draw(0.0..1.0) < 0.5 { -1.0 } else { 1.0 };
    scenario.belt.friction = friction;
    scenario.belt.profile = BeltProfile::Constant { speed_m_s };

    arms.draw(&mut scenario, &mut draw);

    let converters = &mut scenario.converters;
    converters.encoder.bits = draw(12.0..19.0) as u8;
    converters.force.noise_n = draw(0.0..0.1);
    converters.torque.bits = draw(10.0..15.0) as u8;
    converters.torque.lag_s = draw(0.0..1e-3);
    converters.torque.delay_ticks = draw(0.0..2.0);
    converters.link.frame_loss = draw(0.0..0.01);

    let posture = if draw(0.0..1.0) < 0.5 {
        Posture::ElbowDown
    } else {
        Posture::ElbowUp
    };
    let arm = Arm::new(scenario.arm)?;
    let journey = Journey {
        arm: &arm,
        posture,
        slip: Slip::of(-speed_m_s),
        friction,
        target_p_ratio: 0.0,
        farthest_m: arms.farthest_m(arm.reach_on_belt_m()),
    };
    journey.draw(&mut scenario, &mut draw)?;
    Ok(scenario)
}

/// A start and a reference to draw at random.
pub(crate) struct Journey<'a> {
    /// The arm.
    pub arm: &'a Arm<f64>,
    /// Its posture.
    pub posture: Posture,
    /// Direction of slip.
    pub slip: Slip,
    /// Largest friction coefficient of the run.
    pub friction: f64,
    /// Smallest p at the target as a fraction of Q22; if it is zero, half of the targets are up to
    /// 20 mm beyond the edge.
    pub target_p_ratio: f64,
    /// Farthest target, m.
    pub farthest_m: f64,
}

impl Journey<'_> {
    /// Draws the start, the reference and with it the duration of a scenario.
    ///
    /// # Errors
    /// [`StudyError`] if no tip position is admissible.
    pub fn draw(
        &self,
        scenario: &mut Scenario,
        draw: &mut impl FnMut(Range<f64>) -> f64,
    ) -> Result<(), StudyError> {
        let stretches =
            |ratio| admissible_m(self.arm, self.posture, self.friction, self.slip, ratio);
        let first = |stretches: Vec<Range<f64>>| {
            let longest = stretches.into_iter().next();
            longest.ok_or(StudyError::NothingAdmissible)
        };
        let start_m = draw(first(stretches(START_P_RATIO))?);
        let mut around = stretches(self.target_p_ratio);
        around.retain(|stretch| stretch.contains(&start_m));
        let stretch = first(around)?;
        let beyond = draw(0.0..1.0) < 0.5;
        let mut target_m = if !beyond {
            draw(stretch.start..stretch.end)
        } else if draw(0.0..1.0) < 0.5 {
            stretch.start - draw(0.0..BEYOND_M)
        } else {
            stretch.end + draw(0.0..BEYOND_M)
        };
        if self.target_p_ratio > 0.0 {
            target_m = target_m.clamp(stretch.start, stretch.end);
        }
        let duration_s = draw(2.0..4.0) as f32;
        let reference = if draw(0.0..1.0) < 0.5 {
            Reference::MinimumJerk(duration_s)
        } else {
            Reference::Ramp(duration_s)
        };
        let target_m = target_m.clamp(-self.farthest_m, self.farthest_m);
        scenario.controller.reference = reference.to(target_m);
        scenario.run.duration_s = reference.duration_s() + CAPTURE_LIMIT_S + REST_S;
        scenario.initial = case::at_rest_on_belt(self.arm, start_m, self.posture)?;
        Ok(())
    }
}

//! Estimates how much the contact gives, from the response of the contact force to small changes of torque.
//!
//! On a rigid contact f_n = −b/p: the force follows a change of torque at once. On a spring and damper
//! the tip must move first, and within a tick T only the fraction ρ ≈ c p T + ½ k p T² shows. The
//! rounding of the torque to counts changes the torque like noise at every tick, by a known amount; near
//! the edge, a small probe is added until the contact is known to be rigid. ρ is the correlation of the
//! measured changes of force with those that a rigid contact would show.
//!
//! An observer that feeds the measured force back at the rate λ takes damping away from the contact. It
//! is stable while λ < c p²/(Q22 − p), near the edge λ T < ρ p/Q22. ρ therefore limits the share of the
//! force error that observers and integrals may remove in a tick.

use painleve_shared::{Real, settings};

settings! {
    /// Settings of the estimate of the contact's response.
    #[derive(Copy)]
    pub struct ResponseSettings {
        /// Whether the response is estimated; if not, the contact is taken to be rigid.
        enabled: bool = false;
        /// Averaging time of the correlation.
        averaging_s: f32 = 0.25, 1e-3..=1e3, "s";
        /// Number of standard deviations by which the observers' share is below the estimated response.
        share_deviations: f32 = 2.0, 0.0..=10.0;
        /// Number of standard deviations from the estimated response to the bounds that decide about probe
        /// and damping.
        deviations: f32 = 2.0, 0.0..=10.0;
        /// Response that allows the observers their full share.
        full_share: f32 = 0.3, 0.001..=10.0;
        /// Amplitude of the probe, a noise-like force that is added to the wanted normal force near the
        /// edge until the contact is known to be rigid.
        probe_n: f32 = 0.1, 0.0..=10.0, "N";
        /// Lower bound of the response above which there is no probe.
        rigid: f32 = 0.2, 0.001..=1.0;
        /// Upper bound of the response below which the law damps the contact.
        gives: f32 = 0.2, 0.001..=1.0;
        /// Least contact damping c that is assumed.
        least_damping_ns_m: f32 = 15.0, 1e-3..=1e9, "N·s/m";
        /// Least p/Q22 on the softest contact.
        gives_p_ratio: f32 = 0.04, 0.0..=0.9;
        /// Least p/Q22 until the contact has been observed for `proof_s` near the edge.
        proof_p_ratio: f32 = 0.1, 0.0..=0.9;
        /// Time of observation before the tip may go closer to the edge.
        proof_s: f32 = 0.3, 0.0..=100.0, "s";
    }
}

/// Number of delays between torque and force that are considered, in ticks.
const DELAYS: usize = 4;
/// Ticks of one block of sums. In the two ticks after a block the averages and the bounds are updated
/// instead, so that no tick does all of it.
const BLOCK_TICKS: u8 = 15;
/// Time in contact before the correlation starts, s.
const SETTLING_S: f32 = 0.05;
/// Time in contact before the contact is damped, s.
const DAMPING_AFTER_S: f32 = 0.1;
/// Multiple of `proof_p_ratio` below which the contact is observed.
const NEAR: f32 = 3.0;

/// Inputs of one tick in which the tip slides in contact.
#[derive(Clone, Copy, Debug)]
pub struct ForceReading {
    /// Measured normal force, N.
    pub normal_force_n: f32,
    /// Normal force that the torque withheld by rounding would cause on a rigid contact, N.
    pub withheld_n: f32,
    /// p/Q22.
    pub p_ratio: f32,
}

/// What the response allows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactResponse {
    /// Fraction of the largest gain that loops through the contact force may have, 0 … 1.
    pub observer_share: f32,
    /// How much the contact gives, 0 … 1: 0 if it is rigid.
    pub give: f32,
    /// Least p/Q22 at which the tip may be.
    pub least_p_ratio: f32,
    /// Probe to be added to the wanted normal force, N.
    pub probe_n: f32,
}

impl ContactResponse {
    /// The response of a rigid contact.
    pub const RIGID: Self = Self {
        observer_share: 1.0,
        give: 0.0,
        least_p_ratio: 0.0,
        probe_n: 0.0,
    };
}

/// The estimator's settings.
#[derive(Clone, Copy, Debug)]
pub struct ResponseEstimator {
    settings: ResponseSettings,
    tick_s: f32,
    /// Weight of one block in the averages.
    weight: f32,
    near_p_ratio: f32,
    /// Share for each unit of p that is always allowed, kg.
    least_share_kg: f32,
}

/// Sums or averages over blocks of ticks, N².
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    /// Change of force times expected change, for each delay.
    products: [f32; DELAYS],
    /// Square of the expected change.
    expected: f32,
    /// Square of the change of force.
    measured: f32,
}

/// The estimator's state.
#[derive(Clone, Copy, Debug)]
pub struct ResponseState {
    /// Last normal force, N.
    force_n: f32,
    /// Last withheld force, N.
    withheld_n: f32,
    /// Last change of force that was commanded in addition to the law's, N.
    excitation_n: f32,
    /// Present probe, N, and the random numbers from which it is drawn.
    probe_n: f32,
    random: u16,
    /// Expected changes of force, N, the latest first.
    expected_n: [f32; DELAYS],
    /// Sums over the present block.
    block: Moments,
    block_ticks: u8,
    /// Averages of the blocks.
    averages: Moments,
    blocks: f32,
    /// Weight of the last block.
    block_weight: f32,
    /// Bounds of ρ.
    lower: f32,
    upper: f32,
    /// ρ less a little of its uncertainty.
    cautious: f32,
    /// Time since the tip touched, s.
    touched_s: f32,
    /// Time of observation near the edge, s.
    near_s: f32,
}

impl Default for ResponseState {
    fn default() -> Self {
        Self {
            force_n: 0.0,
            withheld_n: 0.0,
            excitation_n: 0.0,
            probe_n: 0.0,
            random: 1,
            expected_n: [0.0; DELAYS],
            block: Moments::default(),
            block_ticks: 0,
            averages: Moments::default(),
            blocks: 0.0,
            block_weight: 1.0,
            lower: 0.0,
            upper: 1.0,
            cautious: 0.0,
            touched_s: 0.0,
            near_s: 0.0,
        }
    }
}

impl ResponseEstimator {
    /// Makes an estimator that is called every `tick_s`.
    pub fn new(settings: &ResponseSettings, tick_s: f32) -> Self {
        Self {
            settings: *settings,
            tick_s,
            weight: f32::from(BLOCK_TICKS + 2) * tick_s / settings.averaging_s,
            near_p_ratio: NEAR * settings.proof_p_ratio,
            least_share_kg: settings.least_damping_ns_m * tick_s,
        }
    }

    /// Returns whether the response is estimated.
    pub fn is_enabled(&self) -> bool {
        self.settings.enabled
    }

    /// Returns what the response allows where p is `p_per_kg`.
    #[inline]
    pub fn response(&self, state: &ResponseState, p_per_kg: f32) -> ContactResponse {
        let settings = &self.settings;
        let is_proved = state.near_s > settings.proof_s;
        if !settings.enabled {
            return ContactResponse::RIGID;
        }
        let give = if state.touched_s < DAMPING_AFTER_S {
            0.0
        } else {
            (1.0 - state.upper / settings.gives).at_least(0.0)
        };
        ContactResponse {
            observer_share: (state.cautious / settings.full_share)
                .at_least(self.least_share_kg * p_per_kg)
                .at_most(1.0),
            give,
            least_p_ratio: if is_proved {
                settings.gives_p_ratio * give
            } else {
                settings.proof_p_ratio
            },
            probe_n: state.probe_n,
        }
    }

    /// Updates the estimate with one tick of a tip that slides in contact.
    #[inline]
    pub fn update(&self, state: &mut ResponseState, reading: &ForceReading) {
        let excitation_n = reading.withheld_n - state.withheld_n + state.probe_n;
        let expected_n = excitation_n - state.excitation_n;
        state.withheld_n = reading.withheld_n;
        state.excitation_n = excitation_n;
        let [e0, e1, e2, _] = state.expected_n;
        state.expected_n = [expected_n, e0, e1, e2];
        let change = reading.normal_force_n - state.force_n;
        state.force_n = reading.normal_force_n;
        state.touched_s += self.tick_s;
        state.probe_n = 0.0;
        if state.touched_s < SETTLING_S {
            return;
        }
        state.block_ticks += 1;
        if state.block_ticks <= BLOCK_TICKS {
            let sums = &mut state.block;
            for (product, expected) in sums.products.iter_mut().zip(&state.expected_n) {
                *product += change * expected;
            }
            sums.expected += e0 * e0;
            sums.measured += change * change;
        } else if state.block_ticks == BLOCK_TICKS + 1 {
            self.average(state);
        } else {
            self.bound(state);
        }
        if reading.p_ratio < self.near_p_ratio {
            state.near_s += self.tick_s;
            if state.lower < self.settings.rigid {
                state.draw_probe(self.settings.probe_n);
            }
        }
    }

    /// Adds a block to the averages.
    #[inline(never)]
    fn average(&self, state: &mut ResponseState) {
        let sums = core::mem::take(&mut state.block);
        state.blocks += 1.0;
        // The plain mean of the first blocks, until it covers the averaging time.
        let weight = (1.0 / state.blocks).at_least(self.weight).at_most(1.0);
        state.block_weight = weight;
        let averages = &mut state.averages;
        for (average, sum) in averages.products.iter_mut().zip(sums.products) {
            *average += weight * (sum - *average);
        }
        averages.expected += weight * (sums.expected - averages.expected);
        averages.measured += weight * (sums.measured - averages.measured);
    }

    /// Updates the bounds of ρ from the averages.
    #[inline(never)]
    fn bound(&self, state: &mut ResponseState) {
        state.block_ticks = 0;
        let weight = state.block_weight;
        let averages = &state.averages;
        let largest = |most: f32, product: &f32| product.at_least(most);
        let most = averages.products.iter().fold(0.0, largest);
        let square = averages.expected.at_least(1e-12);
        let variance = weight / (2.0 - weight) * averages.measured * square;
        let deviation = (variance / f32::from(BLOCK_TICKS)).square_root() / square;
        let response = most / square;
        let settings = &self.settings;
        state.cautious = response - settings.share_deviations * deviation;
        state.lower = response - settings.deviations * deviation;
        state.upper = response + settings.deviations * deviation;
    }
}

impl ResponseState {
    /// Skips a tick without information: in the air, or with a reading in doubt.
    #[inline]
    pub fn pause(&mut self) {
        self.touched_s = 0.0;
        self.probe_n = 0.0;
        if self.block_ticks > 0 {
            self.block = Moments::default();
            self.block_ticks = 0;
        }
    }

    /// Draws the next probe, ±`amplitude_n` (N), from a shift register of 16 bits with the longest
    /// period.
    #[inline(never)]
    fn draw_probe(&mut self, amplitude_n: f32) {
        let feedback = if self.random & 1 == 1 { 0xb400 } else { 0 };
        self.random = (self.random >> 1) ^ feedback;
        self.probe_n = if self.random & 1 == 1 {
            amplitude_n
        } else {
            -amplitude_n
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_S: f32 = 1e-3;
    const P_PER_KG: f32 = 2.4;

    /// Returns uniform noise in −1 … 1 from a fixed stream.
    fn noise(step: u32) -> f32 {
        let bits = step
            .wrapping_mul(2_654_435_761)
            .rotate_left(13)
            .wrapping_mul(2_246_822_519);
        (bits >> 8) as f32 / (1 << 23) as f32 - 1.0
    }

    fn on() -> ResponseSettings {
        ResponseSettings {
            enabled: true,
            ..Default::default()
        }
    }

    /// Returns the response after `ticks` near the edge, for a contact that gives the force (N) in
    /// answer to the force commanded at the previous tick.
    fn observed(ticks: u32, mut contact: impl FnMut(f32) -> f32) -> ContactResponse {
        let estimator = ResponseEstimator::new(&on(), TICK_S);
        let mut state = ResponseState::default();
        let (mut withheld, mut commanded) = (0.0, 10.0);
        for tick in 0..ticks {
            let reading = ForceReading {
                normal_force_n: contact(commanded) + 0.03 * noise(3 * tick),
                withheld_n: withheld,
                p_ratio: 0.12,
            };
            estimator.update(&mut state, &reading);
            let next = 0.05 * noise(3 * tick + 1);
            commanded = 10.0 + next - withheld + state.probe_n;
            withheld = next;
        }
        estimator.response(&state, P_PER_KG)
    }

    /// A spring and damper under an arm of mobility p, in small steps.
    fn compliant(stiffness_n_m: f32, damping_ns_m: f32) -> impl FnMut(f32) -> f32 {
        let (mut depth, mut rate) = (10.0 / stiffness_n_m, 0.0);
        move |commanded| {
            let force = |depth: f32, rate: f32| stiffness_n_m * depth + damping_ns_m * rate;
            for _ in 0..100 {
                rate += P_PER_KG * (commanded - force(depth, rate)) * TICK_S / 100.0;
                depth += rate * TICK_S / 100.0;
            }
            force(depth, rate)
        }
    }

    #[test]
    fn a_rigid_contact_is_found_in_half_a_second_and_costs_nothing() {
        assert!(observed(100, |commanded| commanded).least_p_ratio > 0.0);
        let found = observed(450, |commanded| commanded);
        assert_eq!(found.observer_share, 1.0, "{found:?}");
        assert_eq!((found.give, found.least_p_ratio), (0.0, 0.0));
        assert_eq!(found.probe_n, 0.0, "there is nothing left to find out");
    }

    #[test]
    fn a_rigid_contact_behind_a_slow_torque_stage_is_rigid() {
        let mut force = 10.0;
        let share = 1.0 - libm::expf(-TICK_S / 0.5e-3);
        let found = observed(1000, |commanded| {
            force += share * (commanded - force);
            force
        });
        assert_eq!(found.observer_share, 1.0, "{found:?}");
    }

    #[test]
    fn the_share_of_a_contact_that_gives_falls_with_its_damping() {
        let of = |damping| observed(1000, compliant(1e5, damping));
        let (firm, soft) = (of(60.0), of(20.0));
        assert!(soft.observer_share < firm.observer_share && firm.observer_share < 1.0);
        assert!(soft.observer_share < 0.5, "{soft:?}");
        let softest = observed(1000, compliant(1e4, 5.0));
        assert!(
            softest.give > 0.0 && softest.least_p_ratio > 0.0,
            "{softest:?}"
        );
    }

    #[test]
    fn the_edge_has_to_wait_at_first_and_all_is_allowed_if_it_is_off() {
        let settings = on();
        let estimator = ResponseEstimator::new(&settings, TICK_S);
        let first = estimator.response(&ResponseState::default(), P_PER_KG);
        assert!(first.observer_share < 0.2, "{first:?}");
        assert_eq!(first.least_p_ratio, settings.proof_p_ratio);
        let off = ResponseSettings {
            enabled: false,
            ..settings
        };
        let estimator = ResponseEstimator::new(&off, TICK_S);
        let found = estimator.response(&ResponseState::default(), P_PER_KG);
        assert_eq!(found, ContactResponse::RIGID);
    }
}

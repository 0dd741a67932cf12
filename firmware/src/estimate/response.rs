//! Estimates how compliant the contact is, from the response of the contact force to small changes of torque.
//!
//! On a rigid contact f_n = −b/p: the force follows a change of torque at once. On a spring and damper
//! the tip must move first, and within a tick T only the fraction ρ ≈ c p T + ½ k p T² shows. The
//! rounding of the torque to counts changes the torque like noise at every tick, by a known amount; until ρ shows that
//! the contact is rigid, a small probe is added, the smaller the better ρ is known. ρ is the correlation of the measured
//! changes of force with those that a rigid contact would show.
//!
//! An observer that feeds the measured force back at the rate λ takes damping away from the contact. It
//! is stable while λ < c p²/(Q22 − p), near the edge λ T < ρ p/Q22. ρ therefore limits the part of the
//! force error that observers and integrals may remove in a tick.
//!
//! A vibration below 100 Hz drowns the response in first differences of the force, but hardly appears in second
//! differences. These show whether the contact certainly is not rigid.

use painleve_shared::{Real, settings};

use crate::schedule::Turn;

settings! {
    /// Settings of the estimate of the contact's response.
    #[derive(Copy)]
    pub struct ResponseSettings {
        /// Whether the response is estimated; if not, the contact is taken to be rigid.
        enabled: bool = true;
        /// Largest amplitude of the probe, a noise-like force that is added to the desired normal force until the contact
        /// is known to be rigid. It shrinks with the interval in which the response lies.
        probe_n: f32 = 0.08, 0.0..=10.0, "N";
        /// Least contact damping c that is assumed.
        least_damping_ns_m: f32 = 10.0, 1e-3..=1e9, "N·s/m";
    }
}

/// Averaging time of the correlation and of the friction coefficient, s.
pub const AVERAGING_S: f32 = 0.25;
/// Number of standard deviations from the estimated response to its bounds. With four more runs were lost (lab book, *Constants
/// merged*).
const DEVIATIONS: f32 = 3.0;
/// Lower bound of the response above which the contact is taken to be rigid, and the observers have their full gain. With 0.35
/// more runs were lost, with 0.75 the torque was noisier by a quarter (lab book, *Factors on constants*).
const RIGID: f32 = 0.5;
/// Part of what the contact allows that each loop through it takes. They add up: friction observer, disturbance estimate,
/// integral of the force. Equal parts kept as many runs as unequal ones, and more on a hanging belt (lab book, *Constants that
/// are not needed*).
const EACH_LOOP: f32 = 1.0 / 3.0;
/// Number of delays between torque and force that are considered, in ticks. With two the torque was noisier (the same).
const DELAYS: usize = 3;
/// Turns before which the bounds are not evaluated: fewer readings may agree by chance. From the first on, tips on standing belts
/// lifted off (lab book, *Constants merged*).
const LEAST_TURNS: f32 = 4.0;
/// The law damps a contact if the upper bound of its response is below this part of [`RIGID`]. With more the torque was noisier (the same).
const DAMPED: f32 = 0.4;
/// Time in contact before the correlation starts: a contact that lasts longer is not a bounce, s.
pub const SETTLING_S: f32 = 0.05;

/// What the response allows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactResponse {
    /// Part of the force error that each loop through the contact force may remove in a tick: a third of p/Q22 on a rigid
    /// contact.
    pub loop_share: f32,
    /// How compliant the contact is, 0 … 1: 0 if it is rigid.
    pub give: f32,
    /// How certainly the contact is not rigid, 0 … 1: 0 where the upper bound of the response is that of a
    /// rigid contact, 1 where it is half of that or less.
    pub lags: f32,
    /// Probe to be added to the desired normal force, N.
    pub probe_n: f32,
}

#[cfg(test)]
impl ContactResponse {
    /// The response of a rigid contact at this p/Q22.
    pub fn rigid(p_ratio: f32) -> Self {
        Self {
            loop_share: EACH_LOOP * p_ratio.at_least(0.0),
            ..Self::default()
        }
    }
}

/// The estimator: its settings, and the sums over the ticks in contact.
#[derive(Clone, Copy, Debug, Default)]
pub struct ResponseEstimator {
    pub(super) settings: ResponseSettings,
    tick_s: f32,
    /// Turns over which the averages are taken.
    most_turns: f32,
    /// Share for each unit of p that is always allowed, kg.
    least_share_kg: f32,
    /// Last normal force and its last change, N.
    force_n: f32,
    change_n: f32,
    /// Last withheld force, N.
    withheld_n: f32,
    /// Last change of force that was commanded in addition to the law's, N.
    excitation_n: f32,
    /// Probe in the torque that acts, N, and the random numbers from which the next one is drawn.
    acting_probe_n: f32,
    random: u16,
    /// Expected changes of force, N, the latest first.
    expected_n: [f32; DELAYS + 1],
    /// Sums of first and of second differences since the last turn.
    sums: [Moments; 2],
    /// Averages of such sums.
    averages: [Moments; 2],
    /// Turns in them, at most those of the averaging time.
    turns: f32,
    /// Sum of the squares of the turns' weights in the averages.
    spread: f32,
    /// Distance of the bounds of ρ from first differences.
    width: f32,
    /// Fraction of the observers' full gain that the lower bound allows.
    gain: f32,
    /// What the bounds allow, without the share of the loops, which p decides; `give` is from the upper bound of first
    /// differences, `lags` from that of second ones.
    allowed: ContactResponse,
    /// Time in contact without a pause, s.
    touched_s: f32,
}

/// Sums or averages over turns, N², of first or of second differences of the force.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    /// Measured times expected difference, for each delay.
    products: [f32; DELAYS],
    /// Square of the expected difference.
    expected: f32,
    /// Square of the measured difference.
    measured: f32,
}

impl Moments {
    /// Adds a measured difference, N, and the ones expected at each delay.
    #[inline]
    fn add(&mut self, measured_n: f32, expected_n: [f32; DELAYS]) {
        for (product, expected_n) in self.products.iter_mut().zip(expected_n) {
            *product += measured_n * expected_n;
        }
        let [_, expected_n, _] = expected_n;
        self.expected += expected_n * expected_n;
        self.measured += measured_n * measured_n;
    }

    /// Moves the averages by `weight` towards the sums of a turn.
    #[inline(never)]
    fn approach(&mut self, sums: &Self, weight: f32) {
        for (average, sum) in self.products.iter_mut().zip(sums.products) {
            *average += weight * (sum - *average);
        }
        self.expected += weight * (sums.expected - self.expected);
        self.measured += weight * (sums.measured - self.measured);
    }

    /// Returns ρ from averages of turns whose squared weights have this sum, and the distance of its bounds.
    #[inline(never)]
    fn response(&self, spread: f32) -> (f32, f32) {
        let largest = |most: f32, product: &f32| product.at_least(most);
        let most = self.products.iter().fold(0.0, largest);
        // Not zero where nothing was expected: the response is then unknown.
        let square = self.expected.at_least(1e-12);
        let variance = spread * self.measured * square;
        let deviation = (variance / Turn::COUNT).square_root() / square;
        (most / square, DEVIATIONS * deviation)
    }
}

impl ResponseEstimator {
    /// Makes an estimator that is called every `tick_s`.
    pub fn new(settings: &ResponseSettings, tick_s: f32) -> Self {
        Self {
            settings: *settings,
            tick_s,
            most_turns: (AVERAGING_S / (Turn::COUNT * tick_s)).at_least(LEAST_TURNS),
            least_share_kg: settings.least_damping_ns_m * tick_s,
            random: 1,
            spread: 1.0,
            width: 1.0,
            gain: if settings.enabled { 0.0 } else { 1.0 },
            ..Self::default()
        }
    }

    /// Returns what the response allows where p is `p_per_kg` and `p_ratio` of Q22.
    #[inline]
    pub fn response(&self, p_per_kg: f32, p_ratio: f32) -> ContactResponse {
        let gain = self.gain.at_least(self.least_share_kg * p_per_kg);
        let rest = 1.0 - p_ratio;
        let share = if gain < rest {
            gain * p_ratio / rest
        } else {
            p_ratio
        };
        ContactResponse {
            loop_share: EACH_LOOP * share.limited(0.0, p_ratio.at_least(0.0)),
            ..self.allowed
        }
    }

    /// Adds one tick of a tip that slides in contact to the sums. `normal_force_n` is the measured force (N),
    /// `withheld_n` the one that the torque withheld by rounding would cause on a rigid contact (N), and `elapsed_ticks`
    /// the time since the previous readings.
    #[inline]
    pub fn update(&mut self, normal_force_n: f32, withheld_n: f32, elapsed_ticks: u32) {
        if elapsed_ticks > 1 {
            // Forces before lost readings show nothing: skip the ticks with differences to them.
            let skipped_s = (DELAYS as f32 + 1.5) * self.tick_s;
            self.touched_s = self.touched_s.at_most(SETTLING_S - skipped_s);
        }
        let excitation_n = withheld_n - self.withheld_n + self.acting_probe_n;
        let e0 = excitation_n - self.excitation_n;
        self.withheld_n = withheld_n;
        self.excitation_n = excitation_n;
        let [e1, e2, e3, _] = self.expected_n;
        self.expected_n = [e0, e1, e2, e3];
        let change_n = normal_force_n - self.force_n;
        let change_of_change_n = change_n - self.change_n;
        self.force_n = normal_force_n;
        self.change_n = change_n;
        self.touched_s += self.tick_s;
        self.acting_probe_n = core::mem::take(&mut self.allowed.probe_n);
        if self.touched_s < SETTLING_S {
            return;
        }
        if self.gain < 1.0 {
            // As much as there is to find out, from a shift register of 16 bits with the longest period.
            let amplitude_n = self.width.at_most(1.0) * self.settings.probe_n;
            let feedback = if self.random & 1 == 1 { 0xb400 } else { 0 };
            self.random = (self.random >> 1) ^ feedback;
            let sign = if self.random & 1 == 1 { 1.0 } else { -1.0 };
            self.allowed.probe_n = sign * amplitude_n;
        }
        let [first, second] = &mut self.sums;
        first.add(change_n, [e0, e1, e2]);
        second.add(change_of_change_n, [e0 - e1, e1 - e2, e2 - e3]);
    }

    /// Updates the averages with the readings since the last turn.
    #[inline(never)]
    pub fn average(&mut self) {
        if self.touched_s < SETTLING_S {
            return;
        }
        // A plain mean until it covers the averaging time.
        self.turns = (self.turns + 1.0).at_most(self.most_turns);
        let weight = 1.0 / self.turns;
        let rest = 1.0 - weight;
        self.spread = rest * rest * self.spread + weight * weight;
        let sums = core::mem::take(&mut self.sums);
        for (averages, sums) in self.averages.iter_mut().zip(&sums) {
            averages.approach(sums, weight);
        }
    }

    /// Updates the bounds of ρ from the averages.
    #[inline(never)]
    pub fn bound(&mut self) {
        if self.turns < LEAST_TURNS {
            return;
        }
        let averages = self.averages.each_ref();
        let [first, second] = averages.map(|it| it.response(self.spread));
        let (response, distance) = first;
        self.width = 2.0 * distance;
        self.gain = (response - distance) / RIGID;
        self.allowed.give = (1.0 - (response + distance) / (DAMPED * RIGID)).at_least(0.0);
        let (response, distance) = second;
        self.allowed.lags = (2.0 - 2.0 * (response + distance) / RIGID).limited(0.0, 1.0);
    }

    /// Skips a tick without information: in the air, or with a reading in doubt.
    #[inline]
    pub fn pause(&mut self) {
        if self.touched_s != 0.0 {
            self.touched_s = 0.0;
            self.acting_probe_n = 0.0;
            self.allowed.probe_n = 0.0;
            // What the contact is stays known; the law's damping begins anew from the force after the pause.
            self.allowed.give = 0.0;
        }
    }
}

#[cfg(test)]
mod tests;

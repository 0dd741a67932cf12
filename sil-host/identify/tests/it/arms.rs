//! Random arms and their slides, with rounding, noise, an uneven belt and errors that the identification does not know.

use painleve_identify::fit::FAR;
use painleve_identify::geometry::{Place, encoder_rad, joint_rad};
use painleve_identify::parameters::Drawn;
use painleve_identify::{Limits, Parameter, Parameters, Prior, Reading, Slide};
use painleve_shared::Posture;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// One count of an encoder of 14 bits, rad.
const COUNT_RAD: f64 = core::f64::consts::TAU / 16384.0;

/// Speed of a slide at 1 kHz, m per reading.
const STEP_M: f64 = 1e-4;

/// Waves of 0.1 m on a belt of 0.4 m/s.
const WAVE_RAD_PER_TICK: f64 = core::f64::consts::TAU * 4e-3;

/// An arm with what is known of it.
pub struct Rig {
    pub actual: Parameters,
    pub prior: Prior,
    /// Amplitude of waves that pass under the tip as the belt runs, m.
    pub waves_m: f64,
    /// One count of its encoders, rad.
    pub count_rad: f64,
    /// Largest noise of its encoders, rad.
    pub noise_rad: f64,
    /// Amplitude of the belt's unevenness, m.
    pub uneven_m: f64,
    pub generator: Pcg64,
}

impl Rig {
    /// Draws an arm: zeros to ± 3°, an AS5048A's errors, links to ± 1 %, the belt to ± 2 %, link 1 measured to 0.1 mm.
    pub fn new(seed: u64) -> Self {
        let mut generator = Pcg64::seed_from_u64(seed);
        let mut draw = |most: f64| generator.random_range(-most..=most);
        let lengths = [0.21 * (1.0 + draw(0.2)), 0.21 * (1.0 + draw(0.2))];
        let height = (lengths[0] + lengths[1]) * (0.88 + draw(0.04));
        let nominal = Parameters::of_arm(
            [lengths[0], lengths[1] * (1.0 + draw(0.014))],
            height * (1.0 + draw(0.02)),
        );
        let mut actual = Parameters::of_arm(lengths, height);
        for joint in 0..2 {
            actual.set(Parameter::Zero(joint), draw(0.05));
            for (once, twice) in [
                (Parameter::Sine(joint), Parameter::SecondSine(joint)),
                (Parameter::Cosine(joint), Parameter::SecondCosine(joint)),
            ] {
                actual.set(once, draw(0.006));
                actual.set(twice, draw(0.0015));
            }
        }
        let measured = Drawn {
            length: 5e-4,
            ..Drawn::default()
        };
        let mut nominal = nominal;
        nominal.set(Parameter::Length, lengths[0] * (1.0 + draw(5e-4)));
        Self {
            actual,
            prior: measured.prior(nominal),
            waves_m: 0.0,
            count_rad: COUNT_RAD,
            noise_rad: 1e-4,
            uneven_m: 2e-5,
            generator,
        }
    }

    /// Draws an arm from what is known of it beforehand, with a link 1 that is known exactly.
    pub fn of_prior(seed: u64) -> Self {
        let known = Self::new(seed);
        let exactly = Drawn {
            length: 1e-6,
            ..Drawn::default()
        };
        let prior = exactly.prior(known.prior.parameters);
        let mut generator = known.generator;
        // A sum of twelve is nearly normal.
        let mut draw = || {
            (0..12)
                .map(|_| generator.random_range(-0.5..0.5))
                .sum::<f64>()
        };
        let mut actual = prior.parameters;
        for (value, deviation) in actual.0.iter_mut().zip(&prior.deviations) {
            *value += deviation * draw();
        }
        Self {
            actual,
            prior,
            waves_m: 0.0,
            count_rad: COUNT_RAD,
            noise_rad: 1e-4,
            uneven_m: 2e-5,
            generator,
        }
    }

    /// Slides to and fro between these parts of the reach.
    pub fn slide(&mut self, posture: Posture, from: f64, to: f64) -> Slide {
        let reach = painleve_identify::geometry::reach_m(&self.actual);
        let steps = (reach * (to - from) / STEP_M) as usize;
        let there = (0..=steps).map(|step| from * reach + STEP_M * step as f64);
        let places: Vec<f64> = there.clone().chain(there.rev()).collect();
        let readings = places.into_iter().enumerate().map(|(tick, tip)| {
            let raised_m = self.waves_m * (WAVE_RAD_PER_TICK * tick as f64).sin();
            Reading {
                tick: tick as u32,
                ..self.reading(posture, tip, raised_m)
            }
        });
        let readings: Vec<Reading> = readings.collect();
        Slide {
            posture,
            missing: 0,
            whole: readings.len(),
            readings,
        }
    }

    /// Returns the reading of a tip on the belt, raised by this much, m.
    pub fn reading(&mut self, posture: Posture, tip_t_m: f64, raised_m: f64) -> Reading {
        // Over some centimetres.
        let uneven_m = self.uneven_m * (tip_t_m / 0.012).sin();
        let mut here = self.actual;
        let height = here.get(Parameter::Height);
        here.set(Parameter::Height, height + uneven_m - raised_m);
        let exact = angles(&here, posture, tip_t_m);
        let rounded = exact.map(|angle| {
            let noise = self.noise_rad * self.generator.random_range(-1.0..1.0);
            ((angle + noise) / self.count_rad).round() * self.count_rad
        });
        Reading {
            tick: 0,
            encoders_rad: rounded,
            force_n: [0.0, 4.0 + self.generator.random_range(-0.3..0.3)],
            torque_nm: [0.0; 2],
        }
    }

    /// Slides in both postures, as the procedure does.
    pub fn slides(&mut self) -> Vec<Slide> {
        vec![
            self.slide(Posture::ElbowDown, -0.92, 0.85),
            self.slide(Posture::ElbowUp, -0.92, 0.92),
        ]
    }

    /// Returns the largest error of the tip's position by other parameters over the stretch in which it has to be known, m.
    pub fn tip_error_m(&self, found: &Parameters) -> f64 {
        let reach = painleve_identify::geometry::reach_m(&self.actual);
        let mut largest = 0.0_f64;
        for posture in [Posture::ElbowDown, Posture::ElbowUp] {
            for step in -20..=20 {
                let tip = f64::from(step) / 20.0 * FAR * reach;
                largest = largest.max((self.place(found, posture, tip).tip_t_m - tip).abs());
            }
        }
        largest
    }

    /// Returns the arm by other parameters, where the tip is at z_t on the belt, m.
    pub fn place(&self, found: &Parameters, posture: Posture, tip_t_m: f64) -> Place {
        Place::at(found, angles(&self.actual, posture, tip_t_m))
    }
}

/// Returns the angles of the encoders, rad, of a tip on the belt.
fn angles(parameters: &Parameters, posture: Posture, tip_t_m: f64) -> [f64; 2] {
    let [length_1, length_2] = parameters.link_length_m();
    let height = parameters.get(Parameter::Height);
    let distance = tip_t_m.hypot(height);
    let inner = |one: f64, other: f64| {
        ((one * one + distance * distance - other * other) / (2.0 * one * distance)).acos()
    };
    let (one, two) = (inner(length_1, length_2), inner(length_2, length_1));
    let direction = tip_t_m.atan2(height);
    let joints = match posture {
        Posture::ElbowUp => [direction - one, one + two],
        Posture::ElbowDown => [direction + one, -one - two],
    };
    let encoders = [0, 1].map(|joint| encoder_rad(parameters, joint, joints[joint]));
    debug_assert!((joint_rad(parameters, 0, encoders[0]) - joints[0]).abs() < 1e-9);
    encoders
}

pub fn limits() -> Limits {
    Limits::default()
}

//! Nonlinear least squares with prior knowledge: the most probable parameters, and their covariance.
//!
//! Each point contributes its depth, the prior each parameter's distance from its value, both in standard deviations
//! (Gauss–Newton, with steps halved until the sum of squares falls). The noise is what the fit leaves over, times the
//! number of neighbours that share an error, and at least the rounding of one reading.

use nalgebra::SMatrix;
use painleve_shared::Posture;

use crate::geometry::{Place, Range, reach_by, reach_m};
use crate::parameters::{COUNT, Parameter, Parameters, Prior, Values};
use crate::passes::Points;

/// A matrix over all parameters.
pub type Square = SMatrix<f64, COUNT, COUNT>;

/// Largest number of steps.
const STEPS: usize = 40;
/// Largest number of halvings of a step.
const HALVINGS: u32 = 12;
/// Relative change of the sum of squares that ends the steps.
const SETTLED: f64 = 1e-10;
/// Rounds in which the noise is estimated.
const ROUNDS: usize = 4;
/// Least noise, as a part of the assumed deviation.
const LEAST_NOISE: f64 = 0.2;
/// Largest |z_t| at which the tip's distance from the edges counts, as a part of the reach: the governor's margin.
const EDGE: f64 = 0.95;
/// Largest |z_t| at which the tip's place has to be known, and to which slides should go, as a part of the reach. A tip is
/// set down nearer, and the governor stops it before.
pub const FAR: f64 = 0.85;
/// Number of places between both ends.
const PLACES: u32 = 39;

/// The equation of one point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    /// Derivatives of the depth after each parameter.
    pub by: Values,
    /// Derivatives after the joints' angles, 1/rad.
    pub by_joint: [f64; 2],
    /// The depth.
    pub off: f64,
}

/// The most probable parameters.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The parameters.
    pub parameters: Parameters,
    /// Their covariance.
    pub covariance: Square,
    /// Standard deviation of a point's depth as a multiple of the assumed one.
    pub noise: f64,
    /// Information of the prior and the points, in deviations of the prior: the identity without points.
    pub(crate) information: Square,
}

impl Fit {
    /// Returns what is known without points.
    fn of_prior(prior: &Prior) -> Self {
        Self {
            parameters: prior.parameters,
            covariance: covariance(&Square::identity(), prior),
            noise: 1.0,
            information: Square::identity(),
        }
    }

    /// Fits the parameters to points.
    pub fn new(points: &Points, prior: &Prior) -> Self {
        let mut fit = Self::of_prior(prior);
        for _ in 0..ROUNDS {
            fit.settle(points, prior);
            fit.noise = noise(points, &fit.parameters);
        }
        fit.settle(points, prior);
        let (information, _) = fit.equations(points, prior);
        fit.information = information;
        fit.covariance = covariance(&information, prior);
        fit
    }

    /// Steps to the most probable parameters at the present noise.
    fn settle(&mut self, points: &Points, prior: &Prior) {
        let mut cost = self.cost(points, prior, &self.parameters);
        for _ in 0..STEPS {
            let (information, gradient) = self.equations(points, prior);
            let Some(decomposed) = information.cholesky() else {
                return;
            };
            let step = decomposed.solve(&gradient).component_mul(&prior.deviations);
            let mut share = 1.0;
            let mut better = None;
            for _ in 0..HALVINGS {
                let tried = Parameters(self.parameters.0 - step * share);
                let found = self.cost(points, prior, &tried);
                if found < cost {
                    better = Some((tried, found));
                    break;
                }
                share *= 0.5;
            }
            let Some((tried, found)) = better else {
                return;
            };
            let change = cost - found;
            (self.parameters, cost) = (tried, found);
            if change < SETTLED * cost {
                return;
            }
        }
    }

    /// Returns the sum of squares.
    fn cost(&self, points: &Points, prior: &Prior, parameters: &Parameters) -> f64 {
        let places = points.points.iter().map(|point| point.place(parameters));
        let of_points: f64 = places
            .map(|place| (place.depth_m / (self.noise * points.deviation_m(&place))).powi(2))
            .sum();
        let off = (parameters.0 - prior.parameters.0).component_div(&prior.deviations);
        of_points + off.norm_squared()
    }

    /// Returns the equations of all points, in deviations of noise and prior.
    pub(crate) fn rows(&self, points: &Points, prior: &Prior) -> impl Iterator<Item = Row> {
        points.points.iter().map(|point| {
            let place = point.place_by(&self.parameters);
            let deviation_m = self.noise * points.deviation_m(&place);
            Row {
                by: place.depth_by.component_mul(&prior.deviations) / deviation_m,
                by_joint: place.depth_by_joint.map(|by| by / deviation_m),
                off: place.depth_m / deviation_m,
            }
        })
    }

    /// Returns the normal equations: matrix and gradient, in deviations of the prior.
    fn equations(&self, points: &Points, prior: &Prior) -> (Square, Values) {
        let mut information = Square::identity();
        let mut gradient =
            (self.parameters.0 - prior.parameters.0).component_div(&prior.deviations);
        for Row { by, off, .. } in self.rows(points, prior) {
            information.ger(1.0, &by, &by, 1.0);
            gradient += by * off;
        }
        (information, gradient)
    }

    /// Returns the standard deviation of a parameter.
    pub fn deviation(&self, parameter: Parameter) -> f64 {
        let index = parameter.index();
        libm::sqrt(self.covariance[(index, index)])
    }

    /// Returns the standard deviation of the tip's distance from either edge, m: the largest in both postures, since the governor
    /// has one for both. The edges move with the reach. A wrong scale moves both, and does not matter.
    pub fn tip_deviation_m(&self) -> f64 {
        let (reach, reach_by) = (reach_m(&self.parameters), reach_by(&self.parameters));
        let postures = [Posture::ElbowDown, Posture::ElbowUp].into_iter();
        self.largest(postures, &self.covariance, EDGE, |place| {
            reach_by * (place.tip_t_m / reach) - place.tip_by
        })
    }

    /// Returns the standard deviation of the tip's position, m, if link 1 has its length: the largest in these postures
    /// within [`FAR`].
    pub fn place_deviation_m(
        &self,
        postures: impl Iterator<Item = Posture>,
        covariance: &Square,
    ) -> f64 {
        let length = Parameter::Length.index();
        let column = covariance.column(length).into_owned();
        let given = covariance - column * column.transpose() / column[length].max(1e-300);
        self.largest(postures, &given, FAR, |place| place.tip_by)
    }

    fn largest(
        &self,
        postures: impl Iterator<Item = Posture>,
        covariance: &Square,
        farthest: f64,
        by: impl Fn(&Place) -> Values,
    ) -> f64 {
        let reach = reach_m(&self.parameters);
        let mut largest = 0.0_f64;
        for posture in postures {
            for index in 0..PLACES {
                let share = 2.0 * f64::from(index) / f64::from(PLACES - 1) - 1.0;
                let tip_t_m = farthest * share * reach;
                if let Some(place) = Place::on_belt(&self.parameters, posture, tip_t_m) {
                    let by = by(&place);
                    largest = largest.max(libm::sqrt(by.dot(&(covariance * by)).max(0.0)));
                }
            }
        }
        largest
    }

    /// Returns the covariance that there would be with a further slide.
    pub(crate) fn covariance_with(&self, points: &Points, prior: &Prior, range: Range) -> Square {
        let mut information = self.information;
        for tip_t_m in range.places_m() {
            let Some(place) = Place::on_belt(&self.parameters, range.posture, tip_t_m) else {
                continue;
            };
            let deviation_m = self.noise * points.deviation_m(&place);
            let row = place.depth_by.component_mul(&prior.deviations) / deviation_m;
            information.ger(1.0, &row, &row, 1.0);
        }
        covariance(&information, prior)
    }
}

impl Prior {
    /// Returns the standard deviation of the tip's distance from either edge, m, before any slide.
    pub fn tip_deviation_m(&self) -> f64 {
        Fit::of_prior(self).tip_deviation_m()
    }
}

/// Returns the covariance of parameters.
fn covariance(information: &Square, prior: &Prior) -> Square {
    let scale = Square::from_diagonal(&prior.deviations);
    information
        .cholesky()
        .map_or(scale * scale, |it| scale * it.inverse() * scale)
}

/// Returns the noise: what is left over, times the root of the number of neighbours that share an error. It is at least that of
/// means which round like single readings: without noise, a tip that slides to and fro, or a joint that turns back, rounds alike.
fn noise(points: &Points, parameters: &Parameters) -> f64 {
    let places = points.points.iter().map(|point| point.place(parameters));
    let (off, rounding): (Vec<f64>, Vec<f64>) = places
        .map(|place| {
            let share = |it_m: f64| it_m / points.deviation_m(&place);
            let off = share(place.depth_m).clamp(-1e3, 1e3);
            (off, share(points.rounding_m(&place)))
        })
        .unzip();
    let square = |of: &[f64]| of.iter().map(|it| it * it).sum::<f64>();
    let freedom = off.len().saturating_sub(COUNT).max(1);
    let variance = square(&off) / freedom as f64 * sharing(&off);
    let least = square(&rounding) / rounding.len().max(1) as f64;
    libm::sqrt(variance.max(least)).max(LEAST_NOISE)
}

/// Returns the number of neighbours in a series that share an error: one and twice the sum of its correlations, up to the first
/// below a twentieth. Those behind it are noise.
pub(crate) fn sharing(off: &[f64]) -> f64 {
    let count = off.len();
    let power = |lag: usize| {
        let pairs = off.iter().zip(&off[lag.min(count)..]);
        pairs.map(|(one, other)| one * other).sum::<f64>()
    };
    let mut shared = 1.0;
    for lag in 1..count / 4 {
        let correlation = power(lag) / power(0).max(1e-300);
        if correlation < 0.05 {
            break;
        }
        shared += 2.0 * correlation;
    }
    shared
}

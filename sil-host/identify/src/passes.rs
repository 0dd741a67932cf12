//! Slides as means over short stretches, in order of time.
//!
//! Neighbouring readings of a slow slide share their rounding errors. The mean over a millimetre, which is some counts,
//! rounds much less, and its error is nearly independent of its neighbours'.
//!
//! Waves of the belt move the tip, and with it the angles at which the derivatives are taken. Plain least squares would
//! therefore make encoders' errors up by which the waves look lower. So a depth is measured by what the encoders turn for it,
//! as in Sampson's distance.

use painleve_shared::Posture;

use crate::geometry::{Place, Range, joint_rad};
use crate::parameters::{Parameters, Prior};
use crate::{Limits, Refusal, Slide};

/// Length of the stretches, m.
const STRETCH_M: f64 = 1e-3;

/// Unevenness of belt and tip that is always assumed, m.
const UNEVEN_M: f64 = 20e-6;

/// Largest share of ticks without all readings.
const MOST_MISSING: f64 = 0.2;

/// Least number of stretches of all slides.
const LEAST_POINTS: usize = 60;

/// Motion across the belt over which the derivatives of a depth change, m.
const ACROSS_M: f64 = 1e-4;

/// Mean angles of both encoders over a short stretch.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Index of the slide.
    pub slide: usize,
    /// The angles.
    pub encoders_rad: [f64; 2],
    /// How they turn when the tip moves into the belt, by what is known beforehand, rad/m.
    across_rad_m: [f64; 2],
}

impl Point {
    /// Makes a point; `known` is what is known beforehand.
    fn new(slide: usize, encoders_rad: [f64; 2], known: &Parameters) -> Self {
        Self {
            slide,
            encoders_rad,
            across_rad_m: Place::at(known, encoders_rad).across_rad_m(),
        }
    }

    /// Evaluates the arm. The depth is that which turns the encoders as much by what is known beforehand, but its
    /// derivatives are those of the depth itself.
    pub fn place(&self, parameters: &Parameters) -> Place {
        let place = Place::at(parameters, self.encoders_rad);
        Place {
            depth_m: place.depth_m / self.gain(&place),
            ..place
        }
    }

    /// The same with the derivatives of that depth.
    pub fn place_by(&self, parameters: &Parameters) -> Place {
        let place = self.place(parameters);
        let encoders_rad =
            [0, 1].map(|joint| self.encoders_rad[joint] + ACROSS_M * self.across_rad_m[joint]);
        let across = Place::at(parameters, encoders_rad);
        let gain_by = (across.depth_by - place.depth_by) / ACROSS_M;
        Place {
            depth_by: (place.depth_by - gain_by * place.depth_m) / self.gain(&place),
            ..place
        }
    }

    /// Returns how deep the tip gets for each metre by what is known beforehand.
    fn gain(&self, place: &Place) -> f64 {
        let of = |joint: usize| {
            place.depth_by_joint[joint] * place.joint_by_encoder[joint] * self.across_rad_m[joint]
        };
        of(0) + of(1)
    }
}

/// Returns the posture of an arm with this angle of the elbow, rad.
pub(crate) fn posture(elbow_rad: f64) -> Posture {
    if elbow_rad > 0.0 {
        Posture::ElbowUp
    } else {
        Posture::ElbowDown
    }
}

/// Where a point is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// The posture of its slide.
    pub posture: Posture,
    /// Position along the belt, m.
    pub tip_t_m: f64,
    /// Depth in the belt, m.
    pub depth_m: f64,
}

/// All slides.
#[derive(Clone, Debug)]
pub struct Points {
    /// The means, in order of time.
    pub points: Vec<Point>,
    /// The postures, as told.
    pub postures: Vec<Posture>,
    /// Number of readings on the belt.
    pub readings: usize,
    count_rad: f64,
}

impl Points {
    /// Collects the readings on the belt.
    pub(crate) fn of(slides: &[Slide], prior: &Prior, limits: &Limits) -> Result<Self, Refusal> {
        let mut points = Self {
            points: Vec::new(),
            postures: slides.iter().map(|slide| slide.posture).collect(),
            readings: 0,
            count_rad: limits.count_rad,
        };
        for (index, slide) in slides.iter().enumerate() {
            points.add(index, slide, &prior.parameters, limits)?;
        }
        if points.points.len() < LEAST_POINTS {
            return Err(Refusal::TooShort {
                slid_mm: 1e3 * STRETCH_M * points.points.len() as f64,
                least_mm: 1e3 * STRETCH_M * LEAST_POINTS as f64,
            });
        }
        Ok(points)
    }

    fn add(
        &mut self,
        slide: usize,
        of: &Slide,
        parameters: &Parameters,
        limits: &Limits,
    ) -> Result<(), Refusal> {
        let is_finite = |it: &&crate::Reading| {
            it.encoders_rad.iter().all(|angle| angle.is_finite())
                && it.force_n.iter().all(|force_n| force_n.is_finite())
        };
        if let Some(reading) = of.readings.iter().find(|it| !is_finite(it)) {
            let tick = reading.tick;
            return Err(Refusal::NotFinite { slide, tick });
        }
        if of.readings.is_empty() && of.missing == 0 {
            return Err(Refusal::NeverTracked { slide });
        }
        let missing = of.missing as f64 / (of.missing + of.readings.len()) as f64;
        if missing > MOST_MISSING {
            return Err(Refusal::MissingReadings {
                slide,
                percent: 100.0 * missing,
            });
        }
        of.check_torque(slide, limits)?;
        of.check_on_belt(slide, limits)?;
        let touching: Vec<_> = of.on_belt(limits).collect();
        let tip_t_m = |encoders_rad| Place::at(parameters, encoders_rad).tip_t_m;
        let mut rest = touching.as_slice();
        while let Some(first) = rest.first() {
            let start_m = tip_t_m(first.encoders_rad);
            let is_near =
                |it: &&crate::Reading| (tip_t_m(it.encoders_rad) - start_m).abs() < STRETCH_M;
            let count = rest.iter().take_while(|it| is_near(it)).count().max(1);
            let (these, others) = rest.split_at(count);
            rest = others;
            let mean = |joint: usize| {
                let angles = these.iter().map(|it| it.encoders_rad[joint]);
                angles.sum::<f64>() / count as f64
            };
            self.points
                .push(Point::new(slide, [mean(0), mean(1)], parameters));
        }
        self.readings += touching.len();
        Ok(())
    }

    /// Returns the standard deviation of the depth at a point by rounding and unevenness, m.
    pub fn deviation_m(&self, place: &Place) -> f64 {
        libm::hypot(self.rounding_m(place), UNEVEN_M)
    }

    /// Returns the standard deviation of the depth at a point by rounding, m.
    pub(crate) fn rounding_m(&self, place: &Place) -> f64 {
        let [by_1, by_2] = place.depth_by_joint;
        self.count_rad / libm::sqrt(12.0) * libm::hypot(by_1, by_2)
    }

    /// Returns a distance from the line with what rounding adds to it by these parameters, root mean square, m.
    pub(crate) fn with_rounding_m(&self, off_line_m: f64, parameters: &Parameters) -> f64 {
        let rounding_m = |point: &Point| self.rounding_m(&point.place(parameters));
        let squares = self.points.iter().map(|point| rounding_m(point).powi(2));
        let mean = squares.sum::<f64>() / self.points.len() as f64;
        libm::hypot(off_line_m, libm::sqrt(mean))
    }

    /// Returns how far the tip is from the line by these parameters, root mean square, m.
    pub fn off_line_m(&self, parameters: &Parameters) -> f64 {
        let depths_m = self.depths_m(parameters);
        libm::sqrt(
            depths_m.map(|depth_m| depth_m * depth_m).sum::<f64>() / self.points.len() as f64,
        )
    }

    /// Returns the depth of the tip in the belt at each point, m.
    pub fn depths_m(&self, parameters: &Parameters) -> impl Iterator<Item = f64> {
        let points = self.points.iter();
        points.map(|point| point.place(parameters).depth_m)
    }

    /// Returns where each point is by these parameters.
    pub fn residuals(&self, parameters: &Parameters) -> impl Iterator<Item = Residual> {
        self.points.iter().map(|point| {
            let place = point.place(parameters);
            Residual {
                posture: self.postures[point.slide],
                tip_t_m: place.tip_t_m,
                depth_m: place.depth_m,
            }
        })
    }

    /// Returns the stretch of each slide, with its posture by the elbow.
    pub fn ranges(&self, parameters: &Parameters) -> Vec<Range> {
        let range = |slide| {
            let mut range = Range {
                posture: Posture::ElbowDown,
                from_m: f64::INFINITY,
                to_m: f64::NEG_INFINITY,
            };
            let mut elbow_rad = 0.0;
            for point in self.points.iter().filter(|point| point.slide == slide) {
                let tip_t_m = Place::at(parameters, point.encoders_rad).tip_t_m;
                range.from_m = range.from_m.min(tip_t_m);
                range.to_m = range.to_m.max(tip_t_m);
                elbow_rad += joint_rad(parameters, 1, point.encoders_rad[1]);
            }
            range.posture = posture(elbow_rad);
            range
        };
        (0..self.postures.len()).map(range).collect()
    }

    /// Returns the same with other angles.
    pub(crate) fn with(&self, known: &Parameters, change: impl Fn([f64; 2]) -> [f64; 2]) -> Self {
        let mut changed = self.clone();
        for point in &mut changed.points {
            *point = Point::new(point.slide, change(point.encoders_rad), known);
        }
        changed
    }
}

//! Whether a result is to be refused, and why.

use painleve_shared::Posture;

use crate::fit::{FAR, Fit, Row, Square};
use crate::geometry::{Place, Range, joint_rad, reach_m};
use crate::parameters::{Parameter, Prior, Values};
use crate::passes::{Points, posture};
use crate::refusal::{Missing, Refusal};
use crate::{Limits, Slide};

/// A model explains readings that another does not if it leaves less than this part over.
const EXPLAINS: f64 = 0.7;

/// Part of what is left over that a slip has to explain.
const SLIPPED: f64 = 0.7;

/// Factor by which the deviations of a looser prior are larger.
const LOOSER: f64 = 10.0;

/// Least part of a slip's effect that no parameter explains.
const OWN: f64 = 1e-3;

/// Least slip of an encoder on its shaft that is told, counts.
const SLIP_COUNTS: f64 = 4.0;

/// Largest deviation from what is known beforehand, standard deviations.
pub(crate) const BELIEVED: f64 = 4.0;

/// Least distance of the stretch to slide along from that slid along, as a part of the reach, to be told.
const FARTHER: f64 = 0.02;

/// Least friction that says in which direction a surface passes under the tip, as a part of the normal force.
const FRICTION: f64 = 0.1;

/// Least share of the readings with friction in which it has to push the tip as the belt runs.
const PUSHED: f64 = 0.8;

/// A change of both encoders' angles.
type Change = fn([f64; 2]) -> [f64; 2];

/// Other ways in which the encoders may be mounted or wired: the change that makes their angles right, and the reason.
const OTHERS: [(Change, Refusal); 3] = [
    (|[one, two]| [two, one], Refusal::EncodersSwapped),
    (
        |[one, two]| [-one, two],
        Refusal::EncoderReversed { joint: 0 },
    ),
    (
        |[one, two]| [one, -two],
        Refusal::EncoderReversed { joint: 1 },
    ),
];

/// Returns which other way of mounting the encoders puts the tip, where it first touches the belt, on that belt and in the
/// posture told, or that only the posture is another one; `None` if the angles as they are do, or nothing explains them. For
/// a slide that ends before it shows a line.
pub fn misread(index: usize, slide: &Slide, prior: &Prior, limits: &Limits) -> Option<Refusal> {
    let encoders_rad = slide.on_belt(limits).next()?.encoders_rad;
    let found = |encoders_rad: [f64; 2]| posture(joint_rad(&prior.parameters, 1, encoders_rad[1]));
    let is_on_belt = |encoders_rad: [f64; 2]| {
        let place = Place::at(&prior.parameters, encoders_rad);
        let deviation_m = place.depth_by.component_mul(&prior.deviations).norm();
        place.depth_m.abs() <= BELIEVED * deviation_m
    };
    let is_as_told =
        |encoders_rad: [f64; 2]| is_on_belt(encoders_rad) && found(encoders_rad) == slide.posture;
    if is_as_told(encoders_rad) {
        return None;
    }
    let mut others = OTHERS.into_iter();
    let other = others.find(|(change, _)| is_as_told(change(encoders_rad)));
    let in_posture = || {
        is_on_belt(encoders_rad).then(|| Refusal::OtherPosture {
            slide: index,
            found: found(encoders_rad),
        })
    };
    other.map(|(_, refusal)| refusal).or_else(in_posture)
}

/// Checks that friction pushes the tip as a belt does that runs at this speed, m/s, faster than the tip.
///
/// # Errors
/// [`Refusal::OtherFriction`] if it does not. A belt without friction passes.
pub fn check_friction(
    index: usize,
    slide: &Slide,
    belt_m_s: f64,
    limits: &Limits,
) -> Result<(), Refusal> {
    let (mut pushed, mut all) = (0, 0);
    for reading in slide.on_belt(limits) {
        let [along_n, off_n] = reading.force_n;
        if along_n.abs() >= FRICTION * off_n {
            all += 1;
            pushed += usize::from(along_n * belt_m_s > 0.0);
        }
    }
    let share = pushed as f64 / all as f64;
    if share < PUSHED {
        return Err(Refusal::OtherFriction {
            slide: index,
            percent: 100.0 * share,
        });
    }
    Ok(())
}

/// Checks that the arm is rigid and its tip on a line, `off_line_m` from it.
pub(crate) fn check_line(
    points: &Points,
    prior: &Prior,
    limits: &Limits,
    fit: &Fit,
    off_line_m: f64,
) -> Result<(), Refusal> {
    let most_m = points.with_rounding_m(limits.off_line_m, &fit.parameters);
    let is_off = off_line_m > most_m;
    let other = other_posture(points, fit);
    if is_off || other.is_some() {
        for (change, refusal) in OTHERS {
            let changed = points.with(&prior.parameters, change);
            let fit = Fit::new(&changed, prior);
            let left_m = changed.off_line_m(&fit.parameters);
            let is_whole = left_m <= most_m && other_posture(&changed, &fit).is_none();
            if left_m < EXPLAINS * off_line_m || is_whole {
                return Err(refusal);
            }
        }
    }
    // What contradicts the prior only is no slip: with a looser prior, the other parameters explain it.
    let looser = Prior {
        deviations: prior.deviations * LOOSER,
        ..*prior
    };
    let with_looser = || slip(points, &looser, limits, &Fit::new(points, &looser));
    let slipped = slip(points, prior, limits, fit).and_then(|slip| with_looser().and(Some(slip)));
    if let Some(refusal) = slipped.or(other) {
        return Err(refusal);
    }
    if is_off {
        return Err(Refusal::NotALine {
            off_mm: 1e3 * off_line_m,
            most_mm: 1e3 * most_m,
        });
    }
    Ok(())
}

/// Finds a slide in another posture than told.
fn other_posture(points: &Points, fit: &Fit) -> Option<Refusal> {
    let ranges = points.ranges(&fit.parameters);
    let mut pairs = ranges.iter().zip(&points.postures).enumerate();
    pairs.find_map(|(slide, (range, told))| {
        let found = range.posture;
        (found != *told).then_some(Refusal::OtherPosture { slide, found })
    })
}

/// Finds the instant from which another zero of one encoder explains what the fit leaves over.
///
/// A change δ of a zero from a point on adds a column v to the equations. Of it, the parameters explain the part c = Jᵀ v
/// already: with the information matrix A of the fit, whose gradient is zero, δ = vᵀ r/(vᵀ v − cᵀ A⁻¹ c), and the sum of
/// squares falls by δ vᵀ r.
fn slip(points: &Points, prior: &Prior, limits: &Limits, fit: &Fit) -> Option<Refusal> {
    let rows: Vec<Row> = fit.rows(points, prior).collect();
    let total: f64 = rows.iter().map(|row| row.off * row.off).sum();
    let decomposed = fit.information.cholesky()?;
    let mut best: Option<(f64, Refusal)> = None;
    for joint in 0..2 {
        let mut common = Values::zeros();
        let (mut square, mut product) = (0.0, 0.0);
        for (row, point) in rows.iter().zip(&points.points).rev() {
            let by = row.by_joint[joint];
            common += row.by * by;
            square += by * by;
            product += by * row.off;
            let own = square - common.dot(&decomposed.solve(&common));
            if own < OWN * square {
                continue;
            }
            let slipped_rad = (product / own).abs();
            let falls = product * product / own;
            let is_clear = falls > SLIPPED * total && slipped_rad > SLIP_COUNTS * limits.count_rad;
            if is_clear && best.as_ref().is_none_or(|(most, _)| falls > *most) {
                let refusal = Refusal::Slipped {
                    joint,
                    slide: point.slide,
                    slipped_deg: slipped_rad.to_degrees(),
                };
                best = Some((falls, refusal));
            }
        }
    }
    best.map(|(_, refusal)| refusal)
}

/// Checks that the result agrees with what is known beforehand.
pub(crate) fn check_prior(fit: &Fit, prior: &Prior) -> Result<(), Refusal> {
    let off = |parameter: Parameter| {
        let index = parameter.index();
        let distance = fit.parameters.0[index] - prior.parameters.0[index];
        distance.abs() / prior.deviations[index]
    };
    let mut worst = Parameter::ALL[0];
    for parameter in Parameter::ALL {
        if off(parameter) > off(worst) {
            worst = parameter;
        }
    }
    if off(worst) <= BELIEVED {
        return Ok(());
    }
    Err(Refusal::Contradicts {
        parameter: worst,
        found: fit.parameters.get(worst),
        known: prior.parameters.get(worst),
        deviation: prior.deviations[worst.index()],
    })
}

/// Checks that the slides determine the tip's position; names the motion that is missing otherwise.
pub(crate) fn check_observed(
    points: &Points,
    ranges: &[Range],
    fit: &Fit,
    prior: &Prior,
    limits: &Limits,
) -> Result<(), Refusal> {
    let postures = || ranges.iter().map(|range| range.posture);
    let deviation_m = |covariance: &Square| fit.place_deviation_m(postures(), covariance);
    let now_m = deviation_m(&fit.covariance);
    if now_m <= limits.tip_deviation_m {
        return Ok(());
    }
    let reach = reach_m(&fit.parameters);
    let mut candidates = Vec::new();
    for posture in [Posture::ElbowDown, Posture::ElbowUp] {
        let is_new = postures().all(|it| it != posture);
        let full = Range {
            posture,
            from_m: -FAR * reach,
            to_m: FAR * reach,
        };
        let is_farther = ranges.iter().all(|range| {
            range.posture != posture
                || range.from_m > full.from_m + FARTHER * reach
                || range.to_m < full.to_m - FARTHER * reach
        });
        if is_new || is_farther {
            candidates.push(Missing {
                range: full,
                is_new,
            });
        }
    }
    let mut least: Option<(f64, Missing)> = None;
    for missing in candidates {
        let covariance = fit.covariance_with(points, prior, missing.range);
        let then_m = deviation_m(&covariance);
        if least.as_ref().is_none_or(|(least_m, _)| then_m < *least_m) {
            least = Some((then_m, missing));
        }
    }
    Err(Refusal::NotObserved {
        deviation_mm: 1e3 * now_m,
        limit_mm: 1e3 * limits.tip_deviation_m,
        off_mm: 1e3 * points.off_line_m(&fit.parameters),
        missing: least.map(|(_, missing)| missing),
    })
}

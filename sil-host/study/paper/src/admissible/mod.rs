//! Table II: the tip positions at which p > 0, away from all indeterminate and
//! inconsistent solutions, and the critical friction coefficient of the paradox.

mod figure;
mod options;
mod outcome;
mod page;

use painleve_plant::belt_line::{BeltLine, least, positive_stretches};
use painleve_shared::range::{self, OutOfRange};
use painleve_shared::{Arm, ArmParameters, Posture, Slip};
use painleve_study_core::{Study, StudyError};
use serde::Serialize;

use crate::printed;

pub use options::Options;

/// The admissible tip positions (p > 0) at one friction coefficient, in one direction of slip.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Admissible {
    /// Friction coefficient μ.
    pub mu: f64,
    /// Direction of slip.
    pub slip: Slip,
    /// Smallest friction coefficient with which p = 0 somewhere on the belt.
    pub critical_friction: f64,
    /// Tip position at which this happens, m.
    pub critical_tip_t_m: f64,
    /// Posture in which this happens.
    pub critical_posture: Posture,
    /// Largest tip position that the arm reaches on the belt, m.
    pub reach_m: f64,
    /// Elbow posture with θ2 > θ1.
    pub elbow_up: Intervals,
    /// Elbow posture with θ2 < θ1.
    pub elbow_down: Intervals,
    #[serde(skip)]
    arm: ArmParameters<f64>,
}

/// The admissible tip positions in one posture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Intervals {
    /// Intervals of the tip position z_t, m, in ascending order.
    pub intervals_m: Vec<[f64; 2]>,
    /// The paper's interval, if it gives one.
    pub paper_m: Option<[f64; 2]>,
    /// Computed upper end minus the paper's, m.
    pub difference_m: Option<f64>,
    /// Friction coefficient of the paper's grid (steps of 0.1) whose upper end matches the paper's
    /// three digits, and that upper end, m. It is the paper's own μ except for a misprint.
    pub paper_fits: Option<PaperFits>,
}

/// The friction coefficient that matches a printed value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PaperFits {
    /// Friction coefficient μ.
    pub mu: f64,
    /// Upper end at that coefficient, m.
    pub to_m: f64,
}

/// Settings of the study.
#[derive(Clone, Debug)]
pub struct AdmissibleStudy {
    /// The arm.
    pub arm: ArmParameters<f64>,
    /// Friction coefficient μ.
    pub mu: f64,
    /// Direction of slip.
    pub slip: Slip,
}

/// The single row of the study.
impl Study for AdmissibleStudy {
    type Row = Admissible;

    fn len(&self) -> usize {
        1
    }

    fn row(&self, _: usize) -> Result<Admissible, StudyError> {
        admissible(&self.arm, self.mu, self.slip)
    }
}

/// Checks a friction coefficient.
fn check_friction(mu: f64) -> Result<(), OutOfRange> {
    range::check("--mu", mu, 0.0, 10.0)
}

/// Computes the admissible intervals of an arm at one friction coefficient, in one direction of slip.
///
/// # Errors
/// [`StudyError::Range`] if the arm or the friction coefficient is out of range.
pub fn admissible(
    parameters: &ArmParameters<f64>,
    mu: f64,
    slip: Slip,
) -> Result<Admissible, StudyError> {
    check_friction(mu)?;
    let arm = Arm::new(*parameters)?;
    let critical = |posture| {
        let line = BeltLine::new(&arm, posture);
        let least = least(|tau| line.friction_of_zero_p(tau, slip));
        (least.value, line.tip_t_m(least.tau), posture)
    };
    let (up, down) = (critical(Posture::ElbowUp), critical(Posture::ElbowDown));
    let (critical_friction, critical_tip_t_m, critical_posture) =
        if up.0 < down.0 { up } else { down };
    Ok(Admissible {
        mu,
        slip,
        critical_friction,
        critical_tip_t_m,
        critical_posture,
        reach_m: arm.reach_on_belt_m(),
        elbow_up: intervals(parameters, &arm, Posture::ElbowUp, mu, slip),
        elbow_down: intervals(parameters, &arm, Posture::ElbowDown, mu, slip),
        arm: *parameters,
    })
}

fn intervals(
    parameters: &ArmParameters<f64>,
    arm: &Arm<f64>,
    posture: Posture,
    mu: f64,
    slip: Slip,
) -> Intervals {
    let line = BeltLine::new(arm, posture);
    let at = |mu: f64| -> Vec<[f64; 2]> {
        positive_stretches(|tau| line.p_per_kg(tau, mu, slip))
            .into_iter()
            .map(|(from, to)| [line.tip_t_m(from), line.tip_t_m(to)])
            .collect()
    };
    let intervals_m = at(mu);
    let paper_m = printed::admissible_m(parameters, mu, posture, slip);
    let upper = paper_m.map(|[_, upper]| upper);
    let fits = |upper: f64| {
        (1..=10).find_map(|tenths| {
            let mu = f64::from(tenths) / 10.0;
            let to_m = at(mu).first()?[1];
            ((to_m - upper).abs() <= 5e-4).then_some(PaperFits { mu, to_m })
        })
    };
    Intervals {
        difference_m: upper
            .zip(intervals_m.first())
            .map(|(upper, ours)| ours[1] - upper),
        paper_fits: upper.and_then(fits),
        intervals_m,
        paper_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(mu: f64) -> Admissible {
        admissible(&ArmParameters::default(), mu, Slip::Positive).unwrap()
    }

    #[test]
    fn table_two_of_the_paper_and_its_one_error() {
        let ours = at(0.6);
        let [[from, to]] = ours.elbow_up.intervals_m[..] else {
            panic!("{ours:?}");
        };
        assert!(
            (from + 0.184_102_6).abs() < 1e-6 && (to - 0.182_686).abs() < 5e-7,
            "{ours:?}"
        );
        assert_eq!(format!("{to:.3}"), "0.183");
        let [[from, to]] = ours.elbow_down.intervals_m[..] else {
            panic!("{ours:?}");
        };
        assert!(
            (from + 0.184_102_6).abs() < 1e-6 && (to - 0.164_705).abs() < 5e-7,
            "{ours:?}"
        );
        // The paper's elbow-down value belongs to μ = 0.5.
        assert_eq!(
            format!("{:.3}", at(0.5).elbow_down.intervals_m[0][1]),
            "0.168"
        );
        assert_eq!(ours.elbow_down.paper_fits.unwrap().mu, 0.5);
        assert_eq!(ours.elbow_up.paper_fits.unwrap().mu, 0.6);
        assert!((ours.elbow_down.difference_m.unwrap() + 0.003_29).abs() < 1e-5);
    }

    #[test]
    fn the_other_slip_is_the_mirror_image_in_the_other_posture() {
        let ours = at(0.6);
        let other = admissible(&ArmParameters::default(), 0.6, Slip::Negative).unwrap();
        let [[from, to]] = other.elbow_up.intervals_m[..] else {
            panic!("{other:?}");
        };
        let [[mirrored_to, mirrored_from]] = ours.elbow_down.intervals_m[..] else {
            panic!("{ours:?}");
        };
        assert!((from + mirrored_from).abs() < 1e-9 && (to + mirrored_to).abs() < 1e-9);
        assert_eq!(other.elbow_up.paper_m, None);
    }

    #[test]
    fn p_vanishes_at_the_ends_to_rounding() {
        let arm = Arm::new(ArmParameters::default()).unwrap();
        for mu in [0.37, 0.4, 0.6, 1.0, 3.0] {
            let ours = at(mu);
            for (posture, intervals) in [
                (Posture::ElbowUp, &ours.elbow_up),
                (Posture::ElbowDown, &ours.elbow_down),
            ] {
                let line = BeltLine::new(&arm, posture);
                for end in intervals.intervals_m.iter().flatten() {
                    if end.abs() < ours.reach_m {
                        let p = line.p_per_kg(line.tau(*end).unwrap(), mu, Slip::Positive);
                        assert!(p.abs() < 1e-11, "p({end}) = {p}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_critical_friction_separates_one_interval_from_two() {
        let critical = at(0.6).critical_friction;
        assert!((critical - 0.363_96).abs() < 5e-6, "{critical}");
        assert!((at(0.6).critical_tip_t_m - 0.1782).abs() < 5e-5);
        let whole = at(critical - 1e-9);
        assert_eq!(whole.elbow_down.intervals_m.len(), 1);
        assert_eq!(whole.elbow_down.intervals_m[0][1], whole.reach_m);
        assert_eq!(at(critical + 1e-9).elbow_down.intervals_m.len(), 2);
        assert_eq!(at(0.0).elbow_up.intervals_m.len(), 1);
    }

    #[test]
    fn friction_out_of_range_is_refused_by_name() {
        for mu in [f64::NAN, -0.1, 11.0] {
            let error = admissible(&ArmParameters::default(), mu, Slip::Positive).unwrap_err();
            assert!(error.to_string().starts_with("--mu = "), "{error}");
        }
    }
}

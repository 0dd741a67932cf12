//! The inconsistent start x0,a up to the end of its first contact.

use painleve_plant::{Event, Plant, Probe, State, Step};
use painleve_study_core::StudyError;
use painleve_study_core::initial::Initial;

use super::Stiffness;

/// Longest first contact, s.
const LONGEST_S: f64 = 0.1;
/// Spacing and end of the traces, s.
const TRACE_STEP_S: f64 = 1e-5;
const TRACE_S: f64 = 8e-3;

/// The first contact from x0,a.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FirstContact {
    /// Normal impulse, N·s.
    pub impulse_ns: f64,
    /// Duration, s.
    pub contact_s: f64,
    /// Largest normal force, N; `None` for an impulse.
    pub peak_force_n: Option<f64>,
    /// Normal velocity of the tip at its end, m/s.
    pub throw_m_s: f64,
    /// Slip at its end, m/s.
    pub slip_m_s: f64,
    ended: bool,
}

/// Time (s) with normal force (N), slip (m/s) and height of the tip (m).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Normal force, N.
    pub force_n: Vec<f64>,
    /// Slip, m/s.
    pub slip_m_s: Vec<f64>,
    /// Height of the tip above the belt, m.
    pub gap_m: Vec<f64>,
}

impl Probe for FirstContact {
    fn step(&mut self, step: &dyn Step) {
        if self.ended {
            return;
        }
        let (start, end) = (step.start(), step.end());
        let mean_n = 0.5 * (start.normal_force_n + end.normal_force_n);
        self.impulse_ns += mean_n * (step.end_s() - step.start_s());
        let peak_n = self.peak_force_n.unwrap_or(0.0).max(end.normal_force_n);
        if peak_n > 0.0 {
            self.peak_force_n = Some(peak_n);
        }
        if self.impulse_ns > 0.0 && end.normal_force_n == 0.0 {
            self.contact_s = step.end_s();
            self.throw_m_s = end.gap_rate_m_s;
            self.slip_m_s = end.slip_velocity_m_s;
            self.ended = true;
        }
    }

    fn event(&mut self, _: f64, event: Event, _: &State) {
        if let (Event::ImpactWithoutCollision { impulse_ns }, false) = (event, self.ended) {
            self.impulse_ns = impulse_ns[1];
            self.ended = true;
        }
    }
}

impl Stiffness {
    /// Returns the first contact from x0,a at a stiffness (N/m), or that of the rigid plant, and its trace.
    ///
    /// # Errors
    /// [`StudyError`] if the plant cannot continue.
    pub fn first_contact(
        &self,
        stiffness_n_m: Option<f64>,
    ) -> Result<(FirstContact, Trace), StudyError> {
        let failed = |source| self.failed(stiffness_n_m, source);
        let speed_m_s = self.parameters.belt.speed_m_s(0.0);
        let mass_kg = self.sticking_mass_kg()?;
        let at_rest = self.start(Initial::A)?;
        let start = || self.plant(stiffness_n_m, speed_m_s, at_rest, mass_kg);
        let mut first = FirstContact::default();
        let mut plant = start()?;
        let mut time_s = 0.0;
        while !first.ended && time_s < LONGEST_S {
            plant.advance(time_s, &mut first).map_err(failed)?;
            if first.ended && stiffness_n_m.is_none() {
                let now = plant.snapshot();
                first.throw_m_s = now.gap_rate_m_s;
                first.slip_m_s = now.slip_velocity_m_s;
            }
            time_s += 1e-3;
        }
        let mut trace = Trace::default();
        let mut plant = start()?;
        for point in 0..=(TRACE_S / TRACE_STEP_S) as u32 {
            let time_s = f64::from(point) * TRACE_STEP_S;
            plant.advance(time_s, &mut ()).map_err(failed)?;
            let now = plant.snapshot();
            trace.time_s.push(time_s);
            trace.force_n.push(now.normal_force_n);
            trace.slip_m_s.push(now.slip_velocity_m_s);
            trace.gap_m.push(now.gap_m);
        }
        Ok((first, trace))
    }
}

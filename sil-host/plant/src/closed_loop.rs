//! The closed loop: sample, exchange, record, advance, tick by tick.

use hdrhistogram::Histogram;
use painleve_shared::LinkMotion;
use painleve_shared::frame::{ActuatorFrame, SensorFrame, StatusFlags};
use painleve_shared::status::Fault;
use xxhash_rust::xxh3::Xxh3;

use crate::contact_probe::{CAPTURE_S, ContactProbe};
use crate::controller_host::{Answer, ControllerHost, HostError};
use crate::mechanics::BuiltInPlant;
use crate::plant::{Event, Plant, PlantError, Probe, State, Step};
use crate::sample::{Sample, reference_tip_t_m};
use crate::simulation::Simulation;
use crate::smoothness::Smoothness;
use crate::statistics::Statistics;

/// Settling time at the start of a run, within which the normal force is not recorded, s.
const SETTLING_S: f64 = 0.05;

/// Upper bound of the histogram of round trips, ns.
const LONGEST_ROUND_TRIP_NS: u64 = 60_000_000_000;

/// Why a run ended early.
#[derive(Debug, thiserror::Error)]
pub enum LoopError {
    /// The plant cannot continue.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The controller is no longer available.
    #[error(transparent)]
    Host(#[from] HostError),
    /// The controller's answer has a state or fault number unknown to this version.
    #[error(
        "the controller answers with state {state} and fault {fault}, at least one of which \
         is unknown to this version: use the same build on both sides"
    )]
    NotUnderstood {
        /// Number of its supervisor's state.
        state: u8,
        /// Number of its fault, 0 for none.
        fault: u8,
    },
    /// A monitor of the run failed: its record cannot be written, for example.
    #[error(transparent)]
    Monitor(Box<dyn std::error::Error + Send + Sync>),
    /// A request to end has been received.
    #[error("interrupted")]
    Interrupted,
}

/// Observes a run tick by tick, and may end it.
pub trait Monitor {
    /// Returns whether [`Monitor::sample`] should be called at all.
    fn wants_samples(&self) -> bool {
        true
    }

    /// Receives the complete data of one tick.
    ///
    /// # Errors
    /// [`LoopError`] ends the run.
    fn sample(&mut self, sample: &Sample) -> Result<(), LoopError>;

    /// Receives the controller's last answer at every tick, before the tick's sample; costs far less than a sample.
    fn answer(&mut self, _time_s: f64, _answer: &ActuatorFrame) {}

    /// Receives every discontinuity of the plant's motion, in order of time.
    fn event(&mut self, _time_s: f64, _event: Event) {}

    /// Called at the end of every tick.
    ///
    /// # Errors
    /// [`LoopError`] ends the run.
    fn tick(&mut self) -> Result<(), LoopError> {
        Ok(())
    }
}

/// Ignores everything.
impl Monitor for () {
    fn wants_samples(&self) -> bool {
        false
    }

    fn sample(&mut self, _: &Sample) -> Result<(), LoopError> {
        Ok(())
    }
}

/// Passes the plant's motion to the statistics, and its discontinuities to the monitor as well.
struct Watched<'a, M> {
    statistics: &'a mut Statistics,
    monitor: &'a mut M,
}

impl<M: Monitor> Probe for Watched<'_, M> {
    #[inline]
    fn step(&mut self, step: &dyn Step) {
        self.statistics.step(step);
    }

    fn event(&mut self, time_s: f64, event: Event, state: &State) {
        self.statistics.event(time_s, event, state);
        self.monitor.event(time_s, event);
    }
}

/// A simulation and its controller host, with the counts of the run.
///
/// ```
/// use painleve_plant::closed_loop::ClosedLoop;
/// use painleve_plant::controller_host::InProcess;
/// use painleve_plant::scenario::Scenario;
/// use painleve_plant::simulation::Simulation;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let scenario = Scenario::load("hybrid-elbow-down", &["run.duration_s=0.2".into()])?;
/// let controller = InProcess::new(&scenario.controller_configuration())?;
/// let mut closed_loop = ClosedLoop::new(Simulation::new(&scenario)?, controller);
/// for _ in 0..scenario.run.ticks() {
///     closed_loop.tick(&mut ())?;
/// }
/// let (result, _) = closed_loop.finish();
/// assert_eq!(result.statistics.lift_offs, 0);
/// # Ok(())
/// # }
/// ```
pub struct ClosedLoop<H, P = BuiltInPlant> {
    simulation: Simulation<P>,
    host: H,
    statistics: Statistics,
    smoothness: Smoothness,
    log: LogHash,
    round_trips_ns: Histogram<u64>,
    last_answer: ActuatorFrame,
    saturated_ticks: u64,
    stale_ticks: u64,
    drive_watchdog_tick: Option<u64>,
}

/// Hash of all sensor and actuator frames in order. Each field enters as little-endian bytes, so
/// that the hash is the same on every host.
#[derive(Clone)]
struct LogHash {
    hash: Xxh3,
    /// Bytes that do not count yet, at most [`HASHED_AT_ONCE`]: many small updates would cost twice as much.
    pending: Vec<u8>,
}

/// Bytes of one update of a [`LogHash`].
const HASHED_AT_ONCE: usize = 4096;

impl LogHash {
    fn new() -> Self {
        Self {
            hash: Xxh3::default(),
            pending: Vec::with_capacity(HASHED_AT_ONCE),
        }
    }

    fn sensor(&mut self, frame: &SensorFrame) {
        let [joint_1, joint_2] = frame.joints.map(|joint| joint.0);
        self.words([
            frame.tick,
            frame.sequence,
            joint_1,
            joint_2,
            frame.normal_force.0.cast_unsigned(),
            frame.tangential_force.0.cast_unsigned(),
            frame.inputs.0,
        ]);
    }

    fn actuator(&mut self, frame: &ActuatorFrame) {
        let [torque_1, torque_2] = frame.torques.map(|torque| torque.0.cast_unsigned());
        self.words([
            frame.tick,
            frame.sequence,
            torque_1,
            torque_2,
            frame.reference_tip.0.cast_unsigned(),
            frame.estimated_tip.0.cast_unsigned(),
            u32::from(frame.state) | u32::from(frame.fault) << 8,
            u32::from(frame.flags.0),
        ]);
    }

    fn words<const N: usize>(&mut self, words: [u32; N]) {
        let bytes = words.map(u32::to_le_bytes);
        let bytes = bytes.as_flattened();
        if self.pending.len() + bytes.len() > HASHED_AT_ONCE {
            self.hash.update(&self.pending);
            self.pending.clear();
        }
        self.pending.extend_from_slice(bytes);
    }

    fn hex(mut self) -> String {
        self.hash.update(&self.pending);
        format!("{:032x}", self.hash.digest128())
    }
}

/// Results of a run.
#[derive(Clone, Debug)]
pub struct LoopResult {
    /// Ticks run.
    pub ticks: u64,
    /// Counts and extremes of the plant.
    pub statistics: Statistics,
    /// Smoothness of torque and force while the controller tracks.
    pub smoothness: Smoothness,
    /// Tip position at the end, m.
    pub final_tip_t_m: f64,
    /// Link angles at the end, rad.
    pub final_theta_rad: LinkMotion<f64>,
    /// p at the end, 1/kg.
    pub final_p_per_kg: f64,
    /// Reference at the end, m; `None` if the controller follows none then, as after a fault or without an answer.
    pub final_reference_m: Option<f64>,
    /// Whether an edge holds the reference back at the end.
    pub at_edge: bool,
    /// Ticks on which the controller limited its torque.
    pub saturated_ticks: u64,
    /// Ticks whose answer does not arrive in time.
    pub stale_ticks: u64,
    /// Tick at which the torque stages removed the torque because commands were missing.
    pub drive_watchdog_tick: Option<u64>,
    /// Fault latched at the end.
    pub fault: Option<Fault>,
    /// Round trips, ns.
    pub round_trips_ns: Histogram<u64>,
    /// Hash of all frames, 32 hexadecimal digits.
    pub log_hash: String,
}

impl LoopResult {
    /// Returns whether the tip was kept on the belt: captured since ENABLE, not lifted off again, and no fault.
    pub fn is_kept(&self) -> bool {
        let contact = &self.statistics.contact;
        contact.captured_s.is_some() && contact.lift_offs == 0 && self.fault.is_none()
    }
}

impl<H: ControllerHost, P: Plant> ClosedLoop<H, P> {
    /// Creates a loop at the start of its simulation.
    pub fn new(simulation: Simulation<P>, host: H) -> Self {
        let smoothness = Smoothness::new(simulation.tick_hz());
        let mut statistics = Statistics::new(SETTLING_S);
        // What touches before the drive is on, no controller has captured.
        statistics.contact = ContactProbe::new(simulation.enable_at_s(), CAPTURE_S);
        Self {
            simulation,
            host,
            statistics,
            smoothness,
            log: LogHash::new(),
            // Three significant digits, as everywhere. It grows with the longest round trip, because to clear the
            // memory of all possible ones would take some per cent of a short run.
            round_trips_ns: Histogram::new(3)
                .unwrap_or_else(|_| unreachable!("constant histogram precision")),
            last_answer: ActuatorFrame::default(),
            saturated_ticks: 0,
            stale_ticks: 0,
            drive_watchdog_tick: None,
        }
    }

    /// Returns the simulation, to change it while it runs.
    pub fn simulation_mut(&mut self) -> &mut Simulation<P> {
        &mut self.simulation
    }

    /// Returns the controller host, to change it while it runs.
    pub fn host_mut(&mut self) -> &mut H {
        &mut self.host
    }

    /// Runs one control tick.
    ///
    /// # Errors
    /// [`LoopError`] if plant, controller or monitor cannot continue.
    pub fn tick(&mut self, monitor: &mut impl Monitor) -> Result<(), LoopError> {
        let mut probe = Watched {
            statistics: &mut self.statistics,
            monitor: &mut *monitor,
        };
        let sensor = self.simulation.sample(&mut probe)?;
        self.log.sensor(&sensor);
        let Answer { frame, round_trip } = if self.simulation.sensor_frame_is_lost() {
            self.host.skip()?
        } else {
            self.host.exchange(&sensor)?
        };
        if let Some(round_trip) = round_trip {
            let nanoseconds = u64::try_from(round_trip.as_nanos()).unwrap_or(u64::MAX);
            let nanoseconds = nanoseconds.min(LONGEST_ROUND_TRIP_NS);
            self.round_trips_ns
                .record(nanoseconds)
                .unwrap_or_else(|_| unreachable!("the histogram grows up to its upper bound"));
        }
        if let Some(answer) = &frame {
            if !answer.is_understood() {
                return Err(LoopError::NotUnderstood {
                    state: answer.state,
                    fault: answer.fault,
                });
            }
            self.log.actuator(answer);
            self.last_answer = *answer;
            let saturated = answer.flags.contains(StatusFlags::SATURATED);
            self.saturated_ticks += u64::from(saturated);
        }
        // A late answer that reports a fault takes effect, but does not answer this tick.
        let answered = frame.is_some_and(|answer| answer.tick == sensor.tick);
        let arrives = answered && !self.simulation.actuator_frame_is_lost();
        self.stale_ticks += u64::from(!arrives);
        monitor.answer(self.simulation.plant().time_s(), &self.last_answer);
        if monitor.wants_samples() {
            monitor.sample(&Sample {
                answered,
                ..self.simulation.describe(&sensor, &self.last_answer)
            })?;
        }
        let mut probe = Watched {
            statistics: &mut self.statistics,
            monitor: &mut *monitor,
        };
        let tick = self.simulation.ticks();
        self.simulation.advance(frame.as_ref(), &mut probe)?;
        self.smoothness
            .add(frame.as_ref(), self.statistics.normal_force_n);
        if self.simulation.drive_watchdog_has_tripped() && self.drive_watchdog_tick.is_none() {
            self.drive_watchdog_tick = Some(tick);
        }
        monitor.tick()
    }

    /// Ends the run and returns its results.
    pub fn finish(self) -> (LoopResult, H) {
        let last = self.simulation.plant().snapshot();
        let result = LoopResult {
            ticks: self.simulation.ticks(),
            statistics: self.statistics,
            smoothness: self.smoothness,
            final_tip_t_m: last.tip_t_m,
            final_theta_rad: last.theta_rad,
            final_p_per_kg: last.p_per_kg,
            final_reference_m: Some(reference_tip_t_m(&self.last_answer))
                .filter(|it| it.is_finite()),
            at_edge: self.last_answer.flags.contains(StatusFlags::AT_EDGE),
            saturated_ticks: self.saturated_ticks,
            stale_ticks: self.stale_ticks,
            drive_watchdog_tick: self.drive_watchdog_tick,
            fault: self.last_answer.latched_fault(),
            round_trips_ns: self.round_trips_ns,
            log_hash: self.log.hex(),
        };
        (result, self.host)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::converters::link_loss::LossyLink;
    use crate::scenario::{Scenario, built_in};

    /// Answers every frame with the same state and fault.
    #[derive(Default)]
    struct Fixed {
        state: u8,
        fault: u8,
        /// Ticks by which the answers are late.
        late: u32,
    }

    impl ControllerHost for Fixed {
        fn exchange(&mut self, frame: &SensorFrame) -> Result<Answer, HostError> {
            Ok(Answer {
                frame: Some(ActuatorFrame {
                    tick: frame.tick.wrapping_sub(self.late),
                    state: self.state,
                    fault: self.fault,
                    ..ActuatorFrame::default()
                }),
                round_trip: None,
            })
        }
    }

    #[test]
    fn an_unknown_answer_ends_the_run() {
        let scenario = Scenario::load(built_in::DEFAULT, &[]).unwrap();
        for (state, fault, understood) in [(0, 0, true), (255, 0, false), (0, 255, false)] {
            let simulation = Simulation::new(&scenario).unwrap();
            let fixed = Fixed {
                state,
                fault,
                late: 0,
            };
            let ticked = ClosedLoop::new(simulation, fixed).tick(&mut ());
            let refused = matches!(ticked, Err(LoopError::NotUnderstood { .. }));
            assert_eq!(refused, !understood, "{state}, {fault}: {ticked:?}");
        }
    }

    #[test]
    fn a_late_answer_leaves_its_tick_without_one() {
        let scenario = Scenario::load(built_in::DEFAULT, &[]).unwrap();
        for (late, stale_ticks) in [(0, 0), (1, 1)] {
            let simulation = Simulation::new(&scenario).unwrap();
            let host = Fixed {
                late,
                ..Fixed::default()
            };
            let mut closed_loop = ClosedLoop::new(simulation, host);
            closed_loop.tick(&mut ()).unwrap();
            let (result, _) = closed_loop.finish();
            assert_eq!(result.stale_ticks, stale_ticks);
            assert_eq!(result.final_reference_m, None);
            assert!(result.round_trips_ns.is_empty());
        }
    }

    #[test]
    fn a_tick_whose_answer_is_lost_on_its_way_is_one_without_an_answer() {
        let change = ["converters.link.frame_loss=0.2".to_owned()];
        let scenario = Scenario::load(built_in::DEFAULT, &change).unwrap();
        let mut link = LossyLink::new(&scenario.converters.link, scenario.run.seed);
        let simulation = Simulation::new(&scenario).unwrap();
        let mut closed_loop = ClosedLoop::new(simulation, Fixed::default());
        let mut lost = 0;
        for _ in 0..40 {
            let frames = link.draw();
            lost += u64::from(frames.sensor || frames.actuator);
            closed_loop.tick(&mut ()).unwrap();
        }
        assert_eq!(closed_loop.finish().0.stale_ticks, lost);
    }
}

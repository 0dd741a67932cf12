//! Slides of a real arm: its board runs the controller, its operator sets the tip down.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use painleve_board::arm::{ArmEvent, ConnectedArm};
use painleve_commission::elbow_side;
use painleve_commission::identification::{SLIDES, Slid, SlideRig};
use painleve_identify::Refusal;
use painleve_plant::scenario::Scenario;
use painleve_process::interrupt::Interrupt;
use painleve_process::terminal::warn;
use painleve_shared::Posture;
use painleve_shared::message::FrameSource;
use painleve_shared::status::{Fault, SupervisorState};

use crate::commission::BoardRigError;
use crate::drive::Operator;

/// Longest wait for the board before checking for the operator and signals.
const PATIENCE: Duration = Duration::from_millis(20);

/// Longest time from the operator's task to the end of a slide, beyond its duration.
const LIMIT: Duration = Duration::from_secs(120);

/// A real arm.
pub struct BoardSlides {
    port: PathBuf,
    operator: Operator,
    interrupt: Interrupt,
}

impl BoardSlides {
    /// Prepares for the slides of the arm behind a port.
    ///
    /// # Errors
    /// [`BoardRigError`] if the standard input cannot be read.
    pub fn new(port: &Path) -> Result<Self, BoardRigError> {
        Ok(Self {
            port: port.to_owned(),
            operator: Operator::listen()?,
            interrupt: Interrupt::catch()?,
        })
    }

    /// Returns what the board says next, if it says something soon and no signal has arrived.
    fn next_event(&self, arm: &mut ConnectedArm) -> Result<Option<ArmEvent>, BoardRigError> {
        if self.interrupt.is_requested() {
            return Err(BoardRigError::Interrupted);
        }
        Ok(arm.next_event(PATIENCE)?)
    }

    /// Collects the ticks of one slide.
    fn slid(&self, arm: &mut ConnectedArm, scenario: &Scenario) -> Result<Slid, BoardRigError> {
        let start = Instant::now();
        let limit = Duration::from_secs_f64(scenario.run.duration_s) + LIMIT;
        let mut slid = Slid::default();
        while start.elapsed() < limit {
            self.operator.attend()?;
            let Some(ArmEvent::Tick { sensor, answer }) = self.next_event(arm)? else {
                continue;
            };
            match answer.latched_fault() {
                None => {}
                Some(Fault::LiftOffTooLong | Fault::RecoveryFailed) => {
                    warn("the tip has left the belt");
                    return Ok(slid);
                }
                Some(fault) => return Err(BoardRigError::Faulted(fault)),
            }
            let Some(sensor) = sensor else {
                continue;
            };
            slid.push(sensor, &answer);
            if slid.is_complete || slid.surprise(scenario).is_some() {
                return Ok(slid);
            }
            if !slid.ticks.is_empty() && answer.supervisor_state() == Some(SupervisorState::Idle) {
                return Err(BoardRigError::Off);
            }
        }
        Err(if slid.ticks.is_empty() {
            BoardRigError::NotEnabled(limit)
        } else {
            BoardRigError::NotEnded(limit)
        })
    }
}

impl SlideRig for BoardSlides {
    type Error = BoardRigError;

    fn slide(
        &mut self,
        index: usize,
        scenario: &Scenario,
        posture: Posture,
    ) -> Result<Slid, BoardRigError> {
        let configuration = scenario.controller_configuration();
        let mut arm = ConnectedArm::open(&self.port, &configuration, FrameSource::Sensors)?;
        // What was typed before confirms no task.
        self.operator.attend()?;
        let speed_m_s = scenario.belt.profile.speed_m_s(0.0);
        warn(format_args!(
            "slide {} of {SLIDES}; operator: let the belt run towards {}t, at about {:.2} m/s; hold the arm with its tip on the \
             belt right below joint 1, the elbow {}; then press Return",
            index + 1,
            if speed_m_s < 0.0 { '−' } else { '+' },
            speed_m_s.abs(),
            elbow_side(posture)
        ));
        while !self.operator.confirms()? {
            self.next_event(&mut arm)?;
        }
        arm.permit_arming_surely()?;
        warn(
            "operator: open the switch ENABLE, then close it, and let go when the drive takes the arm over; when the slide ends, \
             the torque goes off: be ready to hold the arm, and stop the belt",
        );
        let slid = self.slid(&mut arm, scenario);
        // Whatever ended the slide, the torque goes off; a board that cannot be reached takes it off by itself.
        let stopped = arm.stop();
        warn(match stopped {
            Ok(()) => "operator: the torque is off; hold the arm, and stop the belt",
            Err(_) => {
                "operator: the board does not answer: open the switch ENABLE, keep clear, and stop the belt"
            }
        });
        let slid = slid?;
        stopped?;
        Ok(slid)
    }

    fn repeats(&mut self, reason: &Refusal, force_n: f64) {
        warn(format_args!(
            "{reason}. Repeating, pressed with {force_n} N"
        ));
    }
}

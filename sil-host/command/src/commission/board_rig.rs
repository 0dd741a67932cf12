//! A real arm behind its board, with its operator at the keyboard.

use std::path::Path;
use std::time::{Duration, Instant};

use painleve_board::BoardError;
use painleve_board::arm::{ArmEvent, ConnectedArm};
use painleve_commission::{OperatorTask, RawReadings, Rig};
use painleve_plant::scenario::Scenario;
use painleve_process::interrupt::Interrupt;
use painleve_process::terminal::warn;
use painleve_shared::counts::TorqueCounts;
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame};
use painleve_shared::message::FrameSource;
use painleve_shared::mounting::{Mounting, SensorParts};
use painleve_shared::status::{Fault, SupervisorState};

use crate::CommandError;
use crate::drive::{Ended, Operator};

/// Longest wait for the board before checking for the operator and signals.
const PATIENCE: Duration = Duration::from_millis(20);

/// Longest time between the operator's task to close the switch and torque.
const ENABLE_LIMIT: Duration = Duration::from_secs(60);

/// Time after which a request for the board's counters is repeated: the line may lose it, or its answer.
const AGAIN: Duration = Duration::from_millis(200);

/// Failure of a real arm.
#[derive(Debug, thiserror::Error)]
pub enum BoardRigError {
    /// The board or its line failed.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// The operator cannot be heard.
    #[error(transparent)]
    System(#[from] std::io::Error),
    /// The operator or a signal has ended the procedure.
    #[error("interrupted")]
    Interrupted,
    /// The board does not arm.
    #[error(
        "the board refuses to arm: a sensor's line, magnet or amplifier is at its limit, or a torque stage is not ready"
    )]
    Refused,
    /// The stages were not enabled.
    #[error("the torque stages were not enabled within {} s", .0.as_secs())]
    NotEnabled(Duration),
    /// A slide has begun, but not ended.
    #[error("the slide has begun, but has not ended within {} s", .0.as_secs())]
    NotEnded(Duration),
    /// Nobody can confirm a task.
    #[error("standard input has ended: nobody can confirm that a task is done")]
    NoInput,
    /// The stages went off.
    #[error("the torque stages went off: the switch was opened, or a sensor or a stage failed")]
    Off,
    /// The board has latched a fault.
    #[error("the board has latched fault {}: {}", *.0 as u8, .0.description())]
    Faulted(Fault),
}

impl From<Ended> for BoardRigError {
    fn from(ended: Ended) -> Self {
        match ended {
            Ended::ByOperator => Self::Interrupted,
            Ended::NoInput => Self::NoInput,
        }
    }
}

impl From<BoardRigError> for CommandError {
    fn from(error: BoardRigError) -> Self {
        match error {
            BoardRigError::Board(error) => Self::Board(error),
            BoardRigError::System(error) => error.into(),
            BoardRigError::Interrupted => Self::Interrupted,
            BoardRigError::Faulted(fault) => Self::Faulted(fault),
            other => Self::Rig(other),
        }
    }
}

/// A real arm.
pub struct BoardRig {
    arm: ConnectedArm,
    operator: Operator,
    interrupt: Interrupt,
    /// Whether the stages have been enabled.
    is_enabled: bool,
}

impl BoardRig {
    /// Connects to a board and configures it for raw readings and torques of at most `torque_limit_nm`.
    ///
    /// # Errors
    /// [`CommandError`] if the board cannot be connected or refuses, or the standard input cannot be read.
    pub fn open(
        port: &Path,
        scenario: &Scenario,
        torque_limit_nm: f64,
    ) -> Result<Self, CommandError> {
        let interrupt = Interrupt::catch()?;
        let operator = Operator::listen()?;
        let mut configuration = scenario.controller_configuration();
        let mounting = &mut configuration.converters.mounting;
        *mounting = Mounting {
            force_lowest_code: mounting.force_lowest_code,
            force_highest_code: mounting.force_highest_code,
            // One sensor of each channel at a time.
            sensors: match mounting.sensors {
                SensorParts::First | SensorParts::Both => SensorParts::First,
                SensorParts::Second => SensorParts::Second,
            },
            ..Mounting::default()
        };
        configuration.settings.torque_limit_nm = torque_limit_nm as f32;
        let arm = ConnectedArm::open(port, &configuration, FrameSource::Commissioning)?;
        Ok(Self {
            arm,
            operator,
            interrupt,
            is_enabled: false,
        })
    }

    /// Takes the torque off.
    ///
    /// # Errors
    /// [`BoardError`] if the board does not answer.
    pub fn stop(&mut self) -> Result<(), BoardError> {
        self.arm.stop()
    }

    /// Returns what the board says next, if it says something soon.
    fn next_event(&mut self) -> Result<Option<ArmEvent>, BoardRigError> {
        if self.interrupt.is_requested() {
            return Err(BoardRigError::Interrupted);
        }
        let event = self.arm.next_event(PATIENCE)?;
        if let Some(ArmEvent::Tick { answer, .. }) = &event
            && let Some(fault) = answer.latched_fault()
        {
            return Err(BoardRigError::Faulted(fault));
        }
        Ok(event)
    }

    /// Returns the next tick with readings, if one arrives soon and the operator does not stop the arm.
    fn next_tick(&mut self) -> Result<Option<(SensorFrame, ActuatorFrame)>, BoardRigError> {
        self.operator.attend()?;
        Ok(match self.next_event()? {
            Some(ArmEvent::Tick { sensor, answer }) => sensor.map(|sensor| (sensor, answer)),
            _ => None,
        })
    }

    /// Waits until the operator has done a task.
    fn wait_for_operator(&mut self) -> Result<(), BoardRigError> {
        while !self.operator.confirms()? {
            self.next_event()?;
        }
        // On a busy machine, ticks from before the task was done may still wait on the line: all ticks behind the
        // board's answer are later.
        loop {
            self.arm.ask_for_health()?;
            let asked = Instant::now();
            while asked.elapsed() < AGAIN {
                self.operator.attend()?;
                if let Some(ArmEvent::Health(_)) = self.next_event()? {
                    return Ok(());
                }
            }
        }
    }

    /// Waits until the board has armed.
    fn wait_for_enable(&mut self) -> Result<(), BoardRigError> {
        let start = Instant::now();
        while start.elapsed() < ENABLE_LIMIT {
            let Some((sensor, answer)) = self.next_tick()? else {
                continue;
            };
            if answer.supervisor_state() == Some(SupervisorState::Armed) {
                return Ok(());
            }
            if sensor.inputs.contains(DigitalInputs::ARMING_REFUSED) {
                return Err(BoardRigError::Refused);
            }
        }
        Err(BoardRigError::NotEnabled(ENABLE_LIMIT))
    }
}

impl Rig for BoardRig {
    type Error = BoardRigError;

    fn instruct(&mut self, instruction: OperatorTask) -> Result<(), BoardRigError> {
        // What was typed before confirms no task.
        self.operator.attend()?;
        if instruction == OperatorTask::Enable {
            // A switch that is closed before the permission does not arm.
            self.arm.permit_arming_surely()?;
            warn(format_args!("operator: {instruction}"));
            self.wait_for_enable()?;
            self.is_enabled = true;
            return Ok(());
        }
        warn(format_args!("operator: {instruction}; then press Return"));
        self.wait_for_operator()
    }

    fn exchange(&mut self, torques: [TorqueCounts; 2]) -> Result<RawReadings, BoardRigError> {
        if self.is_enabled {
            self.arm.command(torques)?;
        }
        loop {
            let Some((sensor, answer)) = self.next_tick()? else {
                continue;
            };
            if self.is_enabled && answer.supervisor_state() != Some(SupervisorState::Armed) {
                return Err(BoardRigError::Off);
            }
            return Ok(RawReadings {
                joints: sensor.joints,
                forces: [sensor.tangential_force, sensor.normal_force],
            });
        }
    }
}

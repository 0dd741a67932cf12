//! The board's black box in words.

use std::fmt::Display;

use painleve_shared::black_box::{BlackBox, Crash, ResetCause};
use painleve_shared::counts::{EncoderCounts, ForceCounts};

/// Describes the last reset, crash and fault, one line each; a board that was just switched on has none.
pub fn lines(content: &BlackBox) -> Vec<String> {
    let mut lines = Vec::new();
    let cause = match content.reset {
        ResetCause::Unknown | ResetCause::Power => None,
        ResetCause::Watchdog => Some("a watchdog: the program hung or a tick took too long"),
        ResetCause::Software => Some("the program, after a crash"),
        ResetCause::Pin => Some("its reset pin"),
    };
    if let Some(cause) = cause {
        let starts = content.starts;
        lines.push(format!(
            "board: last reset by {cause}; {starts} starts since power came up"
        ));
    }
    if let Some(crash) = &content.crash {
        lines.push(format!("board: last crash: {}", crash_text(crash)));
    }
    if let Some(fault) = content.fault
        && let Some(latched) = fault.answer.latched_fault()
    {
        let [joint_1, joint_2] = fault.sensor.joints;
        let (normal, tangential) = (fault.sensor.normal_force, fault.sensor.tangential_force);
        lines.push(format!(
            "board: last fault {} at tick {}: {}; torque {:?}, encoders {}, {}, f_n {}, f_t {} counts",
            latched as u8,
            fault.answer.tick,
            latched.description(),
            fault.answer.torques.map(|it| it.0),
            reading(joint_1 != EncoderCounts::MISSING, joint_1.0),
            reading(joint_2 != EncoderCounts::MISSING, joint_2.0),
            reading(normal != ForceCounts::MISSING, normal.0),
            reading(tangential != ForceCounts::MISSING, tangential.0),
        ));
    }
    lines
}

fn reading(is_there: bool, counts: impl Display) -> String {
    if is_there {
        counts.to_string()
    } else {
        "missing".into()
    }
}

fn crash_text(crash: &Crash) -> String {
    match crash {
        Crash::HardFault {
            program_counter,
            link_register,
            status,
        } => format!(
            "hard fault at {program_counter:#010x}, called from {link_register:#010x}, status {status:#010x}"
        ),
        Crash::Clock => "the crystal failed".into(),
        Crash::Interrupt { number } => {
            format!("interrupt {number}: 1 is low supply, any other is not in use")
        }
        Crash::Panic { line, file } => {
            let file = String::from_utf8_lossy(file);
            format!("panic at {}:{line}", file.trim_end_matches('\0'))
        }
        Crash::StackOverflow => "the stack overflowed".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::black_box::{FILE_LENGTH, FaultRecord};
    use painleve_shared::frame::{ActuatorFrame, SensorFrame};
    use painleve_shared::status::Fault;

    #[test]
    fn only_what_has_happened_is_described() {
        let fresh = BlackBox {
            reset: ResetCause::Power,
            starts: 1,
            ..BlackBox::default()
        };
        assert!(lines(&fresh).is_empty());
        let answer = ActuatorFrame {
            tick: 77,
            fault: Fault::EncoderJump as u8,
            ..ActuatorFrame::default()
        };
        let mut file = [0; FILE_LENGTH];
        file[..10].copy_from_slice(b"law/mod.rs");
        let content = BlackBox {
            reset: ResetCause::Watchdog,
            starts: 3,
            crash: Some(Crash::Panic { line: 12, file }),
            fault: Some(FaultRecord {
                sensor: SensorFrame::default(),
                answer,
            }),
        };
        let text = lines(&content).join("\n");
        for part in [
            "watchdog",
            "3 starts",
            "law/mod.rs:12",
            "fault 2 at tick 77",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
}

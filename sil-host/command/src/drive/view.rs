//! The live table of a drive: a terminal shows it in place; elsewhere each change of state, fault
//! or permission is one line.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use painleve_board::LineHealth;
use painleve_plant::sample::Sample;
use painleve_process::terminal::warn;
use painleve_shared::frame::{ActuatorFrame, DigitalInputs};
use painleve_shared::lapse::Lapse;
use painleve_shared::message::Health;
use painleve_shared::status::SupervisorState;

/// Time between two redraws.
const REDRAW: Duration = Duration::from_millis(100);

/// The table.
pub struct View {
    /// `None` if standard error is not a terminal.
    table: Option<ProgressBar>,
    drawn: Option<Instant>,
    permitted: bool,
    was_active: bool,
    counters: String,
    /// State and fault that were last reported.
    reported: Option<(u8, u8)>,
}

impl View {
    /// Creates an empty table.
    pub fn new() -> Self {
        let table = std::io::stderr().is_terminal().then(|| {
            let table = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
            if let Ok(style) = ProgressStyle::with_template("{msg}") {
                table.set_style(style);
            }
            table
        });
        Self {
            table,
            drawn: None,
            permitted: false,
            was_active: false,
            counters: String::new(),
            reported: None,
        }
    }

    /// Shows whether the drive may arm.
    pub fn show_permission(&mut self, permitted: bool) {
        self.permitted = permitted;
        let in_fault = |(state, _)| state == SupervisorState::Fault as u8;
        self.log(match (permitted, self.reported.is_some_and(in_fault)) {
            (true, false) => "arming is permitted: open the switch ENABLE, then close it",
            (true, true) => {
                "arming is permitted: open the switch ENABLE, press RESET, then close the switch"
            }
            (false, _) => "arming is not permitted",
        });
    }

    /// Shows the counters of the board, and of this end of the line.
    pub fn show_health(&mut self, health: &Health, line: LineHealth) {
        let lapses: Vec<String> = Lapse::ALL
            .iter()
            .filter(|lapse| health.lapses.of(**lapse) > 0)
            .map(|lapse| format!("{} {}", lapse.key(), health.lapses.of(*lapse)))
            .collect();
        self.counters = format!(
            "lapses    {}\nline      {} answers dropped, {} runs of garbage, {} wrong checksums",
            if lapses.is_empty() {
                "none".into()
            } else {
                lapses.join(", ")
            },
            health.dropped_responses,
            line.garbage,
            line.failed_checksums,
        );
    }

    /// Shows an answer without readings.
    pub fn show_answer(&mut self, answer: &ActuatorFrame) {
        let now = (answer.state, answer.fault);
        if self.reported.replace(now) != Some(now) {
            self.log(&status(answer));
        }
        // The board withdraws the permission when the drive stops.
        let is_active = answer.supervisor_state().unwrap_or_default().drives();
        self.permitted &= is_active || !self.was_active;
        self.was_active = is_active;
    }

    /// Shows a tick.
    pub fn show(&mut self, sample: &Sample) {
        self.show_answer(&sample.actuator);
        let is_due = self.drawn.is_none_or(|drawn| drawn.elapsed() >= REDRAW);
        if let Some(table) = self.table.as_ref().filter(|_| is_due) {
            self.drawn = Some(Instant::now());
            table.set_message(text(sample, self.permitted, &self.counters));
            table.tick();
        }
    }

    /// Keeps the last table on the terminal.
    pub fn finish(&mut self) {
        if let Some(table) = self.table.take() {
            table.abandon();
        }
    }

    fn log(&self, line: &str) {
        match &self.table {
            Some(table) => table.println(line),
            None => warn(line),
        }
    }
}

/// Returns state and fault in words.
fn status(answer: &ActuatorFrame) -> String {
    let state = answer
        .supervisor_state()
        .map_or("unknown", SupervisorState::name);
    match answer.latched_fault() {
        None => format!("state: {state}"),
        Some(fault) => format!(
            "state: {state}, fault {}: {}",
            fault as u8,
            fault.description()
        ),
    }
}

fn text(sample: &Sample, permitted: bool, counters: &str) -> String {
    let plant = &sample.plant;
    let [theta_1, theta_2] = plant.theta_rad.to_array().map(f64::to_degrees);
    let [torque_1, torque_2] = plant.torque_nm.to_array();
    let switch = sample.sensor.inputs.contains(DigitalInputs::ENABLE);
    let flags: Vec<String> = sample
        .actuator
        .flags
        .iter_names()
        .map(|(name, _)| name.to_lowercase().replace('_', "-"))
        .collect();
    format!(
        "tick      {:>10}   {}\n\
         enable    {}, arming {}\n\
         angles    {theta_1:>9.3}° {theta_2:>9.3}°   gap {:>8.3} mm\n\
         tip       {:>9.3} mm  reference {:>9.3} mm\n\
         force     f_n {:>7.3} N   f_t {:>7.3} N\n\
         torque    u1 {:>7.3} N·m  u2 {:>7.3} N·m\n\
         flags     {}\n\
         {counters}",
        sample.sensor.tick,
        status(&sample.actuator),
        if switch { "closed" } else { "open" },
        if permitted {
            "permitted"
        } else {
            "not permitted"
        },
        plant.gap_m * 1e3,
        plant.tip_t_m * 1e3,
        sample.reference_tip_t_m * 1e3,
        plant.normal_force_n,
        plant.tangential_force_n,
        torque_1,
        torque_2,
        if flags.is_empty() {
            "none".into()
        } else {
            flags.join(", ")
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::frame::StatusFlags;
    use painleve_shared::status::Fault;

    #[test]
    fn the_table_shows_state_force_flags_and_fault() {
        let mut sample = Sample::default();
        sample.plant.normal_force_n = 10.25;
        sample.plant.tangential_force_n = -3.0;
        sample.sensor.tick = 1234;
        sample.sensor.inputs = DigitalInputs::ENABLE;
        sample.actuator.state = SupervisorState::Fault as u8;
        sample.actuator.fault = Fault::LiftOffTooLong as u8;
        sample.actuator.flags = StatusFlags::CONTACT | StatusFlags::AT_EDGE;
        let text = text(&sample, true, "lapses    none");
        for part in [
            "1234",
            "state: fault, fault 8: contact lost for longer than allowed",
            "closed, arming permitted",
            "f_n  10.250 N   f_t  -3.000 N",
            "contact, at-edge",
            "lapses    none",
        ] {
            assert!(text.contains(part), "{part:?} is not in:\n{text}");
        }
    }
}

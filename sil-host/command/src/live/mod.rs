//! `painleve run --live`: plant and controller in this process, watched and steered from a page or from
//! Foxglove.

mod page_settings;
mod viewers;

use std::sync::Arc;
use std::time::{Duration, Instant};

use painleve_plant::Controller;
use painleve_plant::closed_loop::ClosedLoop;
use painleve_plant::scenario::{Scenario, ScenarioError};
use painleve_plant::simulation::Simulation;
use painleve_process::interrupt::Interrupt;
use painleve_process::terminal::warn;
use painleve_view::access::Token;
use painleve_view::hub::Hub;
use painleve_view::page::{description, html};
use painleve_view::parameters::parameters;
use painleve_view::request::{Order, ViewerRequest};
use painleve_view::server::Server;
use serde_json::json;

use super::CommandError;
use super::output_error::InputError;
use viewers::{Host, Viewers};

/// Time between two looks at orders and clock.
const SLICE: Duration = Duration::from_millis(4);
/// Most rows for the viewers in a second.
const ROWS_PER_S: f64 = 2000.0;
/// Time between two messages about the speed.
const STATUS_INTERVAL: Duration = Duration::from_millis(250);

/// Serves a run that goes on until it is interrupted, to its page and to Foxglove, for those who know the token;
/// pages of `origins` may connect as Foxglove does. `command` is the command that runs the scenario.
///
/// # Errors
/// [`CommandError`] if the page cannot be served or the scenario cannot start.
pub fn run(
    scenario: &Scenario,
    command: String,
    port: u16,
    token: Option<Token>,
    origins: &[String],
    interrupt: &Interrupt,
) -> Result<(), CommandError> {
    let page = html(&description(scenario));
    let server = Server::start(port, page, token, origins)
        .map_err(|source| InputError::Port { port, source })?;
    let mut live = Live::new(scenario.clone(), command, server.hub.clone())?;
    warn(format_args!(
        "open {} in a browser or {} in Foxglove; the run starts with the first viewer and ends with Ctrl-C",
        server.page_address(),
        server.foxglove_address()
    ));
    // One order between two slices: no number of them delays the run or its end.
    while !interrupt.is_requested() {
        let patience = if live.is_idle { SLICE } else { Duration::ZERO };
        if let Some(order) = server.orders.next(patience) {
            live.execute(order);
        }
        live.slice();
        live.report();
    }
    Ok(())
}

/// A run that can be steered.
struct Live {
    /// The command that runs the scenario as it was given.
    command: String,
    /// The scenario as it was given.
    given: Scenario,
    /// The scenario with what was set.
    scenario: Scenario,
    /// The part of it that runs: without what waits for the next reset.
    running: Scenario,
    closed_loop: ClosedLoop<Host>,
    viewers: Viewers,
    hub: Arc<Hub>,
    paused: bool,
    started: bool,
    /// Ticks to run before the next pause.
    steps: u32,
    /// Simulated seconds per second; 0 for as fast as possible.
    factor: f64,
    /// Ticks from one row to the next.
    stride: u64,
    ticks: u64,
    clock: Clock,
    status: Instant,
    ticks_at_status: u64,
    /// Whether there was nothing to simulate.
    is_idle: bool,
}

/// When which tick is due.
struct Clock {
    start: Instant,
    first_tick: u64,
}

impl Live {
    fn new(scenario: Scenario, command: String, hub: Arc<Hub>) -> Result<Self, CommandError> {
        let viewers = Viewers::new(&scenario, hub.clone());
        let now = Instant::now();
        let live = Self {
            closed_loop: start(&scenario, &viewers)?,
            running: scenario.clone(),
            command,
            given: scenario.clone(),
            scenario,
            viewers,
            hub,
            paused: false,
            started: false,
            steps: 0,
            factor: 1.0,
            stride: 1,
            ticks: 0,
            clock: Clock {
                start: now,
                first_tick: 0,
            },
            status: now,
            ticks_at_status: 0,
            is_idle: true,
        };
        live.publish_parameters();
        live.describe();
        Ok(live)
    }

    fn tick_hz(&self) -> f64 {
        f64::from(self.running.run.tick_hz)
    }

    fn restart_clock(&mut self) {
        self.clock = Clock {
            start: Instant::now(),
            first_tick: self.ticks,
        };
    }

    fn pause(&mut self) {
        self.paused = true;
        self.steps = 0;
    }

    /// Executes a viewer's request and reports the outcome to the viewers.
    fn execute(&mut self, order: Order) {
        let outcome = self.obey(&order.request);
        match &outcome {
            Ok(note) => self.hub.note(note),
            Err(reason) => self.hub.refuse(reason),
        }
        self.publish_parameters();
        self.send_status();
        order.reply(outcome.map(drop));
    }

    /// Executes a request and returns what is to be said about it, if anything.
    ///
    /// # Errors
    /// One sentence for the viewer if it is impossible.
    fn obey(&mut self, request: &ViewerRequest) -> Result<String, String> {
        match *request {
            ViewerRequest::Pause => self.pause(),
            ViewerRequest::Resume => {
                self.paused = false;
                self.steps = 0;
                self.restart_clock();
            }
            ViewerRequest::Step { ticks } => {
                self.paused = true;
                self.steps = ticks.min(100_000);
            }
            ViewerRequest::Speed { factor } => {
                if !(0.0..=1000.0).contains(&factor) {
                    return Err("the speed is 0 to 1000".into());
                }
                self.factor = factor;
                self.restart_clock();
            }
            ViewerRequest::Reset => self.reset()?,
            ViewerRequest::Set { ref key, ref value } => return self.set(key, value),
            ViewerRequest::Push {
                force_n,
                duration_s,
            } => {
                let is_sane = force_n.iter().all(|force| force.abs() <= 1000.0)
                    && (0.0..=10.0).contains(&duration_s);
                if !is_sane {
                    return Err("a push has at most 1000 N and lasts at most 10 s".into());
                }
                let ticks = (duration_s * self.tick_hz()).ceil() as u32;
                self.closed_loop.simulation_mut().push(force_n, ticks);
            }
        }
        Ok(String::new())
    }

    fn publish_parameters(&self) {
        self.hub
            .set_parameters(parameters(&self.scenario, self.paused, self.factor));
    }

    /// Tells the pages what runs, and what they save: the scenario with everything that was set, and the changes.
    fn describe(&self) {
        let mut run = description(&self.running);
        run["settings"] = self.scenario.to_brief_toml().into();
        run["changes"] = page_settings::changes(&self.command, &self.given, &self.scenario).into();
        self.hub.describe(&run);
    }

    /// Starts again, with everything that was set. A scenario that cannot start leaves the run as it is.
    fn reset(&mut self) -> Result<(), String> {
        let viewers = Viewers::new(&self.scenario, self.hub.clone());
        self.closed_loop = start(&self.scenario, &viewers).map_err(|error| error.to_string())?;
        self.viewers = viewers;
        self.running = self.scenario.clone();
        self.ticks = 0;
        self.ticks_at_status = 0;
        self.steps = 0;
        // Ticks may be slower from now on.
        self.stride = 1;
        self.restart_clock();
        self.hub.restart();
        self.describe();
        Ok(())
    }

    /// Sets a key. The belt changes at once; a changed controller starts anew where the arm is; any
    /// other part waits for the next reset.
    fn set(&mut self, key: &str, value: &str) -> Result<String, String> {
        let changed = self.scenario.with_remote_override(key, value);
        let changed = changed.map_err(|error| error.to_string())?;
        let at_once = |scenario: &Scenario| Scenario {
            belt: changed.belt.clone(),
            controller: changed.controller.clone(),
            ..scenario.clone()
        };
        let running = at_once(&self.running);
        if running.controller != self.running.controller {
            let controller = Controller::new(&running.controller_configuration());
            let range = |source| ScenarioError::range(&running.name, source).to_string();
            self.closed_loop.host_mut().controller = controller.map_err(range)?;
        }
        if running.belt != self.running.belt {
            self.closed_loop.simulation_mut().set_belt(&running.belt);
        }
        let waits = at_once(&self.scenario) != changed;
        self.running = running;
        self.scenario = changed;
        self.describe();
        let when = if waits {
            "set; takes effect at the next reset"
        } else {
            "set"
        };
        Ok(format!("{key}: {when}"))
    }

    /// Runs the ticks that are due, for at most a slice of time.
    fn slice(&mut self) {
        let start = Instant::now();
        let watched = self.hub.viewers() > 0;
        if watched && !self.started {
            self.started = true;
            self.restart_clock();
        }
        let due = match () {
            () if !self.started => 0,
            () if self.paused => u64::from(self.steps),
            () if self.factor == 0.0 => u64::MAX,
            () => {
                let elapsed_s = (start - self.clock.start).as_secs_f64();
                let last =
                    self.clock.first_tick + (elapsed_s * self.factor * self.tick_hz()) as u64;
                last.saturating_sub(self.ticks)
            }
        };
        let mut done = 0;
        while done < due {
            let is_row = watched && (self.paused || self.ticks.is_multiple_of(self.stride));
            self.viewers.watch(is_row);
            if let Err(error) = self.closed_loop.tick(&mut self.viewers) {
                // A plant that cannot go on may be reset.
                self.hub.refuse(&error.to_string());
                self.pause();
                break;
            }
            self.ticks += 1;
            done += 1;
            // The clock costs as much as part of a tick, so it is read at the rate of the rows.
            if self.ticks.is_multiple_of(self.stride) && start.elapsed() >= SLICE {
                break;
            }
        }
        if self.paused {
            self.steps -= (done as u32).min(self.steps);
        } else if done < due && self.factor > 0.0 {
            // Slower than wanted: do not try to catch up.
            self.restart_clock();
        }
        self.is_idle = done == due;
        let ticks_per_s = done as f64 / start.elapsed().max(SLICE).as_secs_f64();
        self.stride = ((ticks_per_s / ROWS_PER_S).ceil() as u64).max(1);
        self.viewers.publish();
    }

    /// Tells the viewers now and then how fast the run is.
    fn report(&mut self) {
        if self.status.elapsed() >= STATUS_INTERVAL {
            self.send_status();
        }
    }

    fn send_status(&mut self) {
        let elapsed_s = self.status.elapsed().as_secs_f64().max(1e-3);
        let rate = (self.ticks - self.ticks_at_status.min(self.ticks)) as f64 / elapsed_s;
        self.status = Instant::now();
        self.ticks_at_status = self.ticks;
        let status = json!({ "status": {
            "paused": self.paused,
            "factor": self.factor,
            "ticks_per_s": rate,
            "real_time_factor": rate / self.tick_hz(),
            "settings": page_settings::settings(&self.scenario),
            "totals": self.viewers.totals,
        }});
        self.hub.tell(&status);
    }
}

/// Starts plant and controller of a scenario.
fn start(scenario: &Scenario, viewers: &Viewers) -> Result<ClosedLoop<Host>, CommandError> {
    let (name, initial) = (&scenario.name, &scenario.initial);
    let controller = Controller::new(&scenario.controller_configuration())
        .map_err(|source| ScenarioError::range(name, source))?;
    Ok(ClosedLoop::new(
        Simulation::new(scenario).map_err(|source| ScenarioError::start(name, initial, source))?,
        viewers.host(controller),
    ))
}

#[cfg(test)]
mod tests {
    use painleve_plant::scenario::built_in;

    use super::*;

    fn started(overrides: &[&str]) -> Live {
        let overrides: Vec<_> = overrides.iter().map(ToString::to_string).collect();
        let scenario = Scenario::load(built_in::DEFAULT, &overrides).unwrap();
        let mut live = Live::new(scenario, String::new(), Arc::default()).unwrap();
        live.started = true;
        live
    }

    #[test]
    fn an_order_ends_the_steps_that_remain() {
        use ViewerRequest::{Pause, Reset, Resume, Step};
        let mut live = started(&[]);
        for orders in [&[Pause][..], &[Resume, Pause], &[Reset]] {
            live.obey(&Step { ticks: 100_000 }).unwrap();
            for order in orders {
                live.obey(order).unwrap();
            }
            let before = live.ticks;
            live.slice();
            assert_eq!((live.ticks, live.is_idle), (before, true), "{orders:?}");
        }
    }

    #[test]
    fn a_plant_that_fails_ends_the_steps_that_remain() {
        let mut live = started(&[
            "arm.link_mass_kg=[0.001, 0.001]",
            "arm.damping_nms_rad=[1000.0, 1000.0]",
        ]);
        live.obey(&ViewerRequest::Step { ticks: 100_000 }).unwrap();
        let ends = (0..10_000).any(|_| {
            live.slice();
            live.steps == 0
        });
        assert!(ends && live.ticks < 6000, "{} ticks", live.ticks);
        live.slice();
        assert!(live.is_idle);
    }
}

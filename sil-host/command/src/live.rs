//! `painleve run --live`: plant and controller in this process, watched and steered from a page.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::time::{Duration, Instant};

use painleve_firmware::telemetry::Telemetry;
use painleve_plant::closed_loop::{ClosedLoop, LoopError, Monitor};
use painleve_plant::controller_host::{Answer, ControllerHost, HostError};
use painleve_plant::sample::Sample;
use painleve_plant::scenario::{Scenario, ScenarioError};
use painleve_plant::simulation::Simulation;
use painleve_plant::{Controller, Event};
use painleve_record::RecordedTick;
use painleve_record::events::{ControllerEvents, EventKind, RunEvent};
use painleve_shared::frame::SensorFrame;
use painleve_system::interrupt::Interrupt;
use painleve_system::terminal::warn;
use painleve_view::page::{BeltTravel, description, event_entry, html};
use painleve_view::row::Row;
use painleve_view::server::{Hub, Server, ViewerRequest};
use serde_json::{Value, json};

use super::CommandError;
use super::output_error::InputError;

/// Time between two looks at orders and clock.
const SLICE: Duration = Duration::from_millis(4);
/// Most rows for the viewers in a second.
const ROWS_PER_S: f64 = 2000.0;
/// Ticks between two looks at the clock when running as fast as possible.
const TICKS_PER_LOOK: u32 = 64;
/// Time between two messages about the speed.
const STATUS_INTERVAL: Duration = Duration::from_millis(250);
/// Most events that wait for the viewers; more are left out.
const MOST_EVENTS: usize = 50;

/// Serves the page of a run that goes on until it is interrupted.
pub fn run(scenario: &Scenario, port: u16, interrupt: &Interrupt) -> Result<(), CommandError> {
    let mut page = description(scenario);
    page["parameters"] = parameters(scenario);
    let server =
        Server::start(port, html(&page)).map_err(|source| InputError::Port { port, source })?;
    let mut live = Live::new(scenario.clone(), server.hub.clone())?;
    warn(format_args!(
        "open http://localhost:{}/ in a browser; the run starts with the first viewer and ends with Ctrl-C",
        server.address.port()
    ));
    while !interrupt.is_requested() {
        while let Ok(order) = server.orders.try_recv() {
            live.obey(order)?;
        }
        live.slice()?;
        live.report();
        if live.is_waiting()
            && let Ok(order) = server.orders.recv_timeout(SLICE)
        {
            live.obey(order)?;
        }
    }
    Err(CommandError::Interrupted)
}

/// The settings that the page offers; every other key can be set by name.
fn parameters(scenario: &Scenario) -> Value {
    let mut parameters = vec![
        json!({ "key": "belt.friction", "label": "belt friction μ", "value": scenario.belt.friction, "minimum": 0, "maximum": 2, "step": 0.01 }),
        json!({ "key": "belt.profile", "label": "belt speed, m/s", "value": scenario.belt.profile.speed_m_s(0.0), "minimum": -2, "maximum": 2, "step": 0.05, "template": "{ kind = \"constant\", speed_m_s = % }" }),
        json!({ "key": "controller.reference", "label": "target of the tip, m", "value": 0, "minimum": -1, "maximum": 1, "step": 0.005, "template": "[{ minimum-jerk = { target_m = %, duration_s = 1.0 } }]" }),
    ];
    if scenario.controller.law.name() == "hybrid" {
        for (key, label, value, maximum) in [
            ("normal_force_n", "normal force f_n*, N", 10.0, 100.0),
            ("position_gain_per_s2", "position gain, 1/s²", 3000.0, 1e6),
            ("velocity_gain_per_s", "velocity gain, 1/s", 100.0, 1e4),
        ] {
            parameters.push(json!({ "key": format!("controller.law.hybrid.{key}"), "label": label, "value": value, "minimum": 0, "maximum": maximum, "step": "any" }));
        }
    }
    parameters.into()
}

/// The controller in this process, with its telemetry within reach of the monitor.
struct Host {
    controller: Controller,
    telemetry: Rc<Cell<Telemetry>>,
    is_watched: Rc<Cell<bool>>,
}

impl ControllerHost for Host {
    fn exchange(&mut self, frame: &SensorFrame) -> Result<Answer, HostError> {
        let frame = if self.is_watched.get() {
            let mut telemetry = self.telemetry.get();
            let answer = self.controller.tick_with_telemetry(frame, &mut telemetry);
            self.telemetry.set(telemetry);
            answer
        } else {
            self.controller.tick(frame)
        };
        Ok(Answer {
            frame: Some(frame),
            round_trip: Duration::ZERO,
        })
    }
}

/// Collects rows and events for the viewers.
struct Viewers {
    telemetry: Rc<Cell<Telemetry>>,
    /// Whether this tick becomes a row.
    is_watched: Rc<Cell<bool>>,
    travel: BeltTravel,
    events: ControllerEvents,
    rows: Vec<u8>,
    messages: RefCell<Vec<Value>>,
}

impl Viewers {
    fn tell(&self, event: &RunEvent) {
        let mut messages = self.messages.borrow_mut();
        if messages.len() < MOST_EVENTS {
            messages.push(json!({ "event": event_entry(event) }));
        }
    }
}

impl Monitor for Viewers {
    fn wants_samples(&self) -> bool {
        self.is_watched.get()
    }

    fn sample(&mut self, sample: &Sample) -> Result<(), LoopError> {
        let telemetry = self.telemetry.get();
        let tick = RecordedTick {
            sample,
            estimates: Some(&telemetry),
        };
        let travel_m = self.travel.advance(&tick);
        Row::new(&tick, travel_m).write(&mut self.rows);
        let time_s = sample.plant.time_s;
        for kind in self.events.take_in(sample).into_iter().flatten() {
            self.tell(&RunEvent { time_s, kind });
        }
        Ok(())
    }

    fn event(&mut self, time_s: f64, event: Event) {
        let kind = EventKind::Plant(event);
        self.tell(&RunEvent { time_s, kind });
    }
}

/// A run that can be steered.
struct Live {
    /// The scenario with what was set.
    scenario: Scenario,
    closed_loop: ClosedLoop<Host>,
    viewers: Viewers,
    hub: std::sync::Arc<Hub>,
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
    is_idle: bool,
}

/// When which tick is due.
struct Clock {
    start: Instant,
    first_tick: u64,
}

impl Live {
    fn new(scenario: Scenario, hub: std::sync::Arc<Hub>) -> Result<Self, CommandError> {
        let telemetry = Rc::<Cell<Telemetry>>::default();
        let is_watched = Rc::<Cell<bool>>::default();
        let viewers = Viewers {
            telemetry,
            is_watched,
            travel: BeltTravel::default(),
            events: ControllerEvents::default(),
            rows: Vec::new(),
            messages: RefCell::default(),
        };
        let now = Instant::now();
        Ok(Self {
            closed_loop: start(&scenario, &viewers)?,
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
        })
    }

    fn tick_hz(&self) -> f64 {
        f64::from(self.scenario.run.tick_hz)
    }

    /// Whether there was nothing to simulate.
    fn is_waiting(&self) -> bool {
        self.is_idle
    }

    fn restart_clock(&mut self) {
        self.clock = Clock {
            start: Instant::now(),
            first_tick: self.ticks,
        };
    }

    /// Executes a viewer's request; reports to the viewers if it is impossible.
    fn obey(&mut self, order: ViewerRequest) -> Result<(), CommandError> {
        match order {
            ViewerRequest::Pause => self.paused = true,
            ViewerRequest::Resume => {
                self.paused = false;
                self.restart_clock();
            }
            ViewerRequest::Step { ticks } => {
                self.paused = true;
                self.steps = ticks.min(100_000);
            }
            ViewerRequest::Speed { factor } if (0.0..=1000.0).contains(&factor) => {
                self.factor = factor;
                self.restart_clock();
            }
            ViewerRequest::Speed { .. } => self.say("the speed is 0 to 1000"),
            ViewerRequest::Reset => self.reset()?,
            ViewerRequest::Set { key, value } => self.set(&key, &value)?,
            ViewerRequest::Push {
                force_n,
                duration_s,
            } => {
                let is_sane = force_n.iter().all(|force| force.abs() <= 1000.0)
                    && (0.0..=10.0).contains(&duration_s);
                if is_sane {
                    let ticks = (duration_s * self.tick_hz()).ceil() as u32;
                    self.closed_loop.simulation_mut().push(force_n, ticks);
                } else {
                    self.say("a push has at most 1000 N and lasts at most 10 s");
                }
            }
        }
        self.send_status();
        Ok(())
    }

    fn say(&self, text: &str) {
        self.hub.publish(&[], &[json!({ "error": text })]);
    }

    fn reset(&mut self) -> Result<(), CommandError> {
        self.closed_loop = start(&self.scenario, &self.viewers)?;
        self.viewers.travel = BeltTravel::default();
        self.viewers.events = ControllerEvents::default();
        self.viewers.rows.clear();
        self.ticks = 0;
        self.ticks_at_status = 0;
        self.restart_clock();
        self.hub.publish(&[], &[json!({ "reset": true })]);
        Ok(())
    }

    /// Sets a key. The belt changes at once; a changed controller starts anew where the arm is; any
    /// other part waits for the next reset.
    fn set(&mut self, key: &str, value: &str) -> Result<(), CommandError> {
        let changed = self
            .scenario
            .clone()
            .with_overrides("live run", &[format!("{key}={value}")]);
        let changed = match changed {
            Ok(changed) => changed,
            Err(error) => {
                self.say(&error.to_string());
                return Ok(());
            }
        };
        let before = std::mem::replace(&mut self.scenario, changed);
        let scenario = &self.scenario;
        if scenario.belt != before.belt {
            self.closed_loop.simulation_mut().set_belt(&scenario.belt);
        }
        if scenario.controller != before.controller {
            let controller = Controller::new(&scenario.controller_configuration());
            self.closed_loop.host_mut().controller =
                controller.map_err(|source| in_run(scenario, source))?;
        }
        let at_once = Scenario {
            belt: before.belt,
            controller: before.controller.clone(),
            ..scenario.clone()
        } == before;
        let note = if at_once {
            "set"
        } else {
            "set; takes effect at the next reset"
        };
        self.hub
            .publish(&[], &[json!({ "note": format!("{key}: {note}") })]);
        Ok(())
    }

    /// Runs the ticks that are due, for at most a slice of time.
    fn slice(&mut self) -> Result<(), CommandError> {
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
            self.viewers.is_watched.set(is_row);
            if let Err(error) = self.closed_loop.tick(&mut self.viewers) {
                // A plant that cannot go on may be reset.
                self.say(&error.to_string());
                self.paused = true;
                break;
            }
            self.ticks += 1;
            done += 1;
            if done % u64::from(TICKS_PER_LOOK) == 0 && start.elapsed() >= SLICE {
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
        if watched && (!self.viewers.rows.is_empty() || !self.viewers.messages.borrow().is_empty())
        {
            let messages = self.viewers.messages.take();
            self.hub.publish(&self.viewers.rows, &messages);
        }
        self.viewers.rows.clear();
        Ok(())
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
        }});
        self.hub.publish(&[], &[status]);
    }
}

fn in_run(scenario: &Scenario, source: painleve_shared::OutOfRange) -> CommandError {
    CommandError::Scenario(ScenarioError::Range {
        origin: scenario.name.clone(),
        source,
    })
}

/// Starts plant and controller of a scenario.
fn start(scenario: &Scenario, viewers: &Viewers) -> Result<ClosedLoop<Host>, CommandError> {
    let range = |source| in_run(scenario, source);
    let host = Host {
        controller: Controller::new(&scenario.controller_configuration()).map_err(range)?,
        telemetry: viewers.telemetry.clone(),
        is_watched: viewers.is_watched.clone(),
    };
    Ok(ClosedLoop::new(
        Simulation::new(scenario).map_err(range)?,
        host,
    ))
}

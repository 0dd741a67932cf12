//! The monitor of a live run: what the viewers see of its ticks and events.

use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;

use painleve_plant::closed_loop::{LoopError, Monitor};
use painleve_plant::controller_host::{Answer, ControllerHost, HostError};
use painleve_plant::sample::Sample;
use painleve_plant::scenario::Scenario;
use painleve_plant::telemetry::Telemetry;
use painleve_plant::{Controller, Event};
use painleve_record::RecordedTick;
use painleve_record::events::{ControllerEvents, EventKind, RunEvent};
use painleve_shared::ActuatorFrame;
use painleve_shared::frame::SensorFrame;
use painleve_view::events::{Totals, entry};
use painleve_view::foxglove::feed::Feed;
use painleve_view::hub::Hub;
use painleve_view::row::{Follower, Row};
use serde_json::{Value, json};

/// Most events that wait for the viewers; more are counted only.
const MOST_EVENTS: usize = 50;

/// The controller in this process, with its telemetry within reach of the monitor.
pub(super) struct Host {
    pub(super) controller: Controller,
    telemetry: Rc<Cell<Telemetry>>,
    is_watched: Rc<Cell<bool>>,
}

impl ControllerHost for Host {
    fn exchange(&mut self, frame: &SensorFrame) -> Result<Answer, HostError> {
        let frame = if self.is_watched.get() {
            let mut telemetry = self.telemetry.get();
            let answer = telemetry.tick(&mut self.controller, frame);
            self.telemetry.set(telemetry);
            answer
        } else {
            self.controller.tick(frame)
        };
        Ok(Answer {
            frame: Some(frame),
            round_trip: None,
        })
    }
}

/// Collects rows and events for the viewers.
pub(super) struct Viewers {
    hub: Arc<Hub>,
    telemetry: Rc<Cell<Telemetry>>,
    /// Whether this tick is shown.
    is_watched: Rc<Cell<bool>>,
    follower: Follower,
    events: ControllerEvents,
    /// The events since the start.
    pub(super) totals: Totals,
    rows: Vec<u8>,
    listed: Vec<Value>,
    feed: Feed,
}

impl Viewers {
    /// Creates the viewers of a scenario's run.
    pub(super) fn new(scenario: &Scenario, hub: Arc<Hub>) -> Self {
        Self {
            telemetry: Rc::default(),
            is_watched: Rc::default(),
            follower: Follower::new(scenario),
            events: ControllerEvents::default(),
            totals: Totals::default(),
            rows: Vec::new(),
            listed: Vec::new(),
            feed: Feed::new(hub.clone(), scenario),
            hub,
        }
    }

    /// Creates the host of a controller that these viewers watch.
    pub(super) fn host(&self, controller: Controller) -> Host {
        Host {
            controller,
            telemetry: self.telemetry.clone(),
            is_watched: self.is_watched.clone(),
        }
    }

    /// Sets whether the next tick is shown.
    pub(super) fn watch(&self, is_watched: bool) {
        self.is_watched.set(is_watched);
    }

    /// Passes everything on to the viewers.
    pub(super) fn publish(&mut self) {
        if !self.rows.is_empty() || !self.listed.is_empty() {
            self.hub.publish(&self.rows, &self.listed);
        }
        self.rows.clear();
        self.listed.clear();
        self.feed.send();
    }

    fn show(&mut self, event: &RunEvent) {
        self.totals.count(event);
        if self.listed.len() < MOST_EVENTS {
            self.listed.push(json!({ "event": entry(event) }));
            self.feed.event(event);
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
        let followed = self.follower.tick(&tick);
        if self.hub.has_pages() {
            Row::new(&tick, followed).write(&mut self.rows);
        }
        if self.hub.has_subscribers() {
            self.feed.tick(&tick);
        }
        Ok(())
    }

    fn answer(&mut self, time_s: f64, answer: &ActuatorFrame) {
        for kind in self.events.take_in(answer).into_iter().flatten() {
            self.show(&RunEvent { time_s, kind });
        }
    }

    fn event(&mut self, time_s: f64, event: Event) {
        let kind = EventKind::Plant(event);
        self.show(&RunEvent { time_s, kind });
    }
}

#[cfg(test)]
mod tests {
    use painleve_plant::ContactMode;
    use painleve_plant::closed_loop::ClosedLoop;
    use painleve_plant::simulation::Simulation;

    use super::*;

    #[test]
    fn events_on_ticks_that_are_not_shown_have_the_same_times() {
        let scenario = Scenario::load("pid-elbow-up", &[]).unwrap();
        let configuration = scenario.controller_configuration();
        // Every tick is shown, or none.
        let [shown, hidden] = [true, false].map(|is_watched| {
            let mut viewers = Viewers::new(&scenario, Arc::default());
            viewers.watch(is_watched);
            let host = viewers.host(Controller::new(&configuration).unwrap());
            let mut closed_loop = ClosedLoop::new(Simulation::new(&scenario).unwrap(), host);
            (0..scenario.run.ticks()).for_each(|_| closed_loop.tick(&mut viewers).unwrap());
            json!(viewers.totals)
        });
        assert!(shown["state"].is_array() && shown["fault"].is_array());
        assert_eq!(hidden, shown);
    }

    #[test]
    fn lift_offs_that_are_not_listed_are_counted() {
        let mut viewers = Viewers::new(&Scenario::default(), Arc::default());
        let lift_off = Event::ModeChange {
            from: ContactMode::Stick,
            to: ContactMode::Flight,
        };
        for number in 1..=600 {
            viewers.event(0.5 * f64::from(number), lift_off);
        }
        assert_eq!(viewers.listed.len(), MOST_EVENTS);
        let first = json!([0.5, "lift-off", "lift-off from stick"]);
        assert_eq!(json!(viewers.totals), json!({ "lift-off": [600, first] }));
    }
}

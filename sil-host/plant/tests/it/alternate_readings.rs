//! Every other reading of a channel fails, on the way to a target beyond the edge: the drive stops, and until then the
//! tip stays on the belt.

// Helpers of tests may panic as tests do.
#![allow(clippy::unwrap_used)]

use painleve_plant::closed_loop::{ClosedLoop, LoopError, Monitor};
use painleve_plant::controller_host::{Answer, ControllerHost, HostError};
use painleve_plant::sample::Sample;
use painleve_plant::scenario::Scenario;
use painleve_plant::simulation::Simulation;
use painleve_plant::{Configuration, Controller};
use painleve_shared::counts::{EncoderCounts, ForceCounts};
use painleve_shared::frame::SensorFrame;

/// A channel that can fail.
#[derive(Clone, Copy, Debug)]
enum Channel {
    Encoder1,
    Encoder2,
    NormalForce,
    TangentialForce,
    /// The whole frame is lost.
    Frame,
    /// The previous frame is repeated.
    Repeated,
}

const CHANNELS: [Channel; 6] = [
    Channel::Encoder1,
    Channel::Encoder2,
    Channel::NormalForce,
    Channel::TangentialForce,
    Channel::Frame,
    Channel::Repeated,
];

/// A controller that receives a channel at every other tick only.
struct Alternate {
    controller: Controller,
    channel: Channel,
    parity: u32,
    last: SensorFrame,
}

impl ControllerHost for Alternate {
    fn exchange(&mut self, frame: &SensorFrame) -> Result<Answer, HostError> {
        let mut received = *frame;
        if frame.tick % 2 == self.parity {
            let out_of_range = ForceCounts(i32::MAX);
            match self.channel {
                Channel::Encoder1 => received.joints[0] = EncoderCounts(u32::MAX),
                Channel::Encoder2 => received.joints[1] = EncoderCounts(u32::MAX),
                Channel::NormalForce => received.normal_force = out_of_range,
                Channel::TangentialForce => received.tangential_force = out_of_range,
                Channel::Frame => {
                    return Ok(Answer {
                        frame: Some(*self.controller.last_answer()),
                        round_trip: None,
                    });
                }
                Channel::Repeated => received = self.last,
            }
        }
        self.last = *frame;
        Ok(Answer {
            frame: Some(self.controller.tick(&received)),
            round_trip: None,
        })
    }
}

/// Time and place at which the tip first leaves the belt although no fault is latched.
#[derive(Default)]
struct Thrown(Option<(f64, f64)>);

impl Monitor for Thrown {
    fn sample(&mut self, sample: &Sample) -> Result<(), LoopError> {
        if !sample.plant.mode.is_contact() && sample.actuator.fault == 0 && self.0.is_none() {
            self.0 = Some((sample.plant.time_s, sample.plant.tip_t_m));
        }
        Ok(())
    }
}

fn run(configuration: &Configuration, scenario: &Scenario, channel: Channel, parity: u32) {
    let host = Alternate {
        controller: Controller::new(configuration).unwrap(),
        channel,
        parity,
        last: SensorFrame::default(),
    };
    let mut closed_loop = ClosedLoop::new(Simulation::new(scenario).unwrap(), host);
    let mut thrown = Thrown::default();
    for _ in 0..scenario.run.ticks() {
        closed_loop.tick(&mut thrown).unwrap();
    }
    let fault = closed_loop.finish().0.fault;
    assert_eq!(thrown.0, None, "{channel:?} {parity}: {fault:?}");
    assert_ne!(fault, None, "{channel:?} {parity}");
}

#[test]
fn without_every_other_reading_the_drive_stops_before_the_tip_is_thrown() {
    let scenario = Scenario::load("edge", &[]).unwrap();
    let mut configuration = scenario.controller_configuration();
    for channel in CHANNELS {
        for parity in [0, 1] {
            run(&configuration, &scenario, channel, parity);
        }
    }
    // As many lapses as can be allowed.
    let lapses = &mut configuration.settings.lapses;
    lapses.force_out_of_range = 100;
    lapses.encoder_out_of_range = 100;
    lapses.lost_frames = 100;
    lapses.stale_frames = 100;
    for channel in CHANNELS {
        for parity in [0, 1] {
            run(&configuration, &scenario, channel, parity);
        }
    }
}

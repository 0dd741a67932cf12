//! Frames that are lost between plant and controller, at random and repeatably.
//!
//! Without the sensor frame the controller does not tick, and sees a gap in the sequence
//! numbers at the next one; without the actuator frame it does, in vain. Either way the
//! torque stages repeat their last command.

use painleve_shared::settings;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Seed of the losses beside those of the noise channels.
const STREAM: u64 = 0x4c6f_7373_6573_0001;

settings! {
    /// Settings of the link.
    #[derive(Copy)]
    pub struct LinkSettings {
        /// Probability that a frame is lost, for each frame in either direction.
        frame_loss: f64 = 0.0, 0.0..=1.0;
    }
}

/// What is lost at a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lost {
    /// The sensor frame.
    pub sensor: bool,
    /// The actuator frame.
    pub actuator: bool,
}

/// A link that loses frames.
#[derive(Clone, Debug)]
pub struct LossyLink {
    frame_loss: f64,
    generator: Pcg64,
}

impl LossyLink {
    /// Equal seeds lose equal frames on every host.
    pub fn new(settings: &LinkSettings, seed: u64) -> Self {
        Self {
            frame_loss: settings.frame_loss,
            generator: Pcg64::seed_from_u64(seed ^ STREAM),
        }
    }

    /// What is lost at the next tick; called once per tick.
    pub fn draw(&mut self) -> Lost {
        if self.frame_loss == 0.0 {
            return Lost::default();
        }
        let [sensor, actuator] = [(); 2].map(|()| self.generator.random::<f64>() < self.frame_loss);
        Lost { sensor, actuator }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_are_lost_as_asked_for_and_the_same_ones_again() {
        let lost = |frame_loss, seed| {
            let mut link = LossyLink::new(&LinkSettings { frame_loss }, seed);
            (0..20_000).map(|_| link.draw()).collect::<Vec<_>>()
        };
        let one_percent = lost(0.01, 1);
        let count = |side: fn(&Lost) -> bool| one_percent.iter().filter(|lost| side(lost)).count();
        assert!((150..250).contains(&count(|lost| lost.sensor)));
        assert!((150..250).contains(&count(|lost| lost.actuator)));
        assert_eq!(one_percent, lost(0.01, 1));
        assert_ne!(one_percent, lost(0.01, 2));
        assert!(lost(0.0, 1).iter().all(|lost| *lost == Lost::default()));
        assert!(lost(1.0, 1).iter().all(|lost| lost.sensor && lost.actuator));
    }
}

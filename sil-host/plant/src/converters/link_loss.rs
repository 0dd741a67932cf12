//! Random, repeatable loss of frames between plant and controller.
//!
//! If the sensor frame is lost, the controller does not tick, and sees a gap in the sequence
//! numbers of the next frame. If the actuator frame is lost, the controller ticks but its answer
//! does not arrive. In both cases the torque stages repeat their last command.

use painleve_shared::settings;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Random stream of the losses, separate from those of the noise channels.
const STREAM: u64 = 0x4c6f_7373_6573_0001;

settings! {
    /// Settings of the link.
    #[derive(Copy)]
    pub struct LinkSettings {
        /// Probability that a frame is lost, for each frame in either direction.
        frame_loss: f64 = 0.0, 0.0..=1.0;
    }
}

/// Frames lost at one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lost {
    /// Whether the sensor frame is lost.
    pub sensor: bool,
    /// Whether the actuator frame is lost.
    pub actuator: bool,
}

/// A link that loses frames.
#[derive(Clone, Debug)]
pub struct LossyLink {
    frame_loss: f64,
    generator: Pcg64,
}

impl LossyLink {
    /// Creates the link. Equal seeds lose the same frames on every host.
    pub fn new(settings: &LinkSettings, seed: u64) -> Self {
        Self {
            frame_loss: settings.frame_loss,
            generator: Pcg64::seed_from_u64(seed ^ STREAM),
        }
    }

    /// Draws the losses of the next tick; called once per tick.
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
    fn losses_have_the_set_probability_and_are_repeatable() {
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

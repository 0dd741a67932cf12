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
/// Random stream of the gaps.
const GAP_STREAM: u64 = 0x4761_7073_0000_0001;

settings! {
    /// Settings of the link.
    #[derive(Copy)]
    pub struct LinkSettings {
        /// Probability that a frame is lost, for each frame in either direction.
        frame_loss: f64 = 0.0, 0.0..=1.0;
        /// Probability that a gap begins at a tick: while it lasts, no frame arrives in either direction.
        gap_probability: f64 = 0.0, 0.0..=1.0;
        /// Duration of a gap.
        gap_ticks: u32 = 5, 1..=1_000_000, "ticks";
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
    settings: LinkSettings,
    generator: Pcg64,
    gap_generator: Pcg64,
    /// Ticks until the present gap ends.
    gap_left: u32,
}

impl LossyLink {
    /// Creates the link. Equal seeds lose the same frames on every host.
    pub fn new(settings: &LinkSettings, seed: u64) -> Self {
        Self {
            settings: *settings,
            generator: Pcg64::seed_from_u64(seed ^ STREAM),
            gap_generator: Pcg64::seed_from_u64(seed ^ GAP_STREAM),
            gap_left: 0,
        }
    }

    /// Draws the losses of the next tick; called once per tick.
    #[inline]
    pub fn draw(&mut self) -> Lost {
        let LinkSettings {
            frame_loss,
            gap_probability,
            gap_ticks,
        } = self.settings;
        self.gap_left = self.gap_left.saturating_sub(1);
        if gap_probability > 0.0 && self.gap_left == 0 {
            let begins = self.gap_generator.random::<f64>() < gap_probability;
            self.gap_left = if begins { gap_ticks } else { 0 };
        }
        let is_gap = self.gap_left > 0;
        if frame_loss == 0.0 {
            return Lost {
                sensor: is_gap,
                actuator: is_gap,
            };
        }
        let [sensor, actuator] =
            [(); 2].map(|()| self.generator.random::<f64>() < frame_loss || is_gap);
        Lost { sensor, actuator }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_have_the_set_probability_and_are_repeatable() {
        let lost = |frame_loss, seed| {
            let mut link = LossyLink::new(
                &LinkSettings {
                    frame_loss,
                    ..Default::default()
                },
                seed,
            );
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

    #[test]
    fn a_gap_lasts_for_its_ticks_in_both_directions() {
        let settings = LinkSettings {
            gap_probability: 0.01,
            gap_ticks: 4,
            ..Default::default()
        };
        let mut link = LossyLink::new(&settings, 1);
        let lost: Vec<Lost> = (0..100_000).map(|_| link.draw()).collect();
        assert!(lost.iter().all(|lost| lost.sensor == lost.actuator));
        let lengths: Vec<usize> = lost
            .chunk_by(|one, other| one == other)
            .filter(|chunk| chunk[0].sensor)
            .map(<[Lost]>::len)
            .collect();
        // A gap may follow another one at once.
        assert!(lengths.iter().all(|length| length % 4 == 0), "{lengths:?}");
        // Of 104 ticks, 100 are without a gap on average.
        assert!((870..1060).contains(&lengths.len()), "{}", lengths.len());
    }
}

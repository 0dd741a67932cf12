//! The switch of the safety chain and the reset button, debounced.

use painleve_shared::frame::DigitalInputs;

/// Ticks for which a contact must be closed before it counts as closed.
pub const DEBOUNCE_TICKS: u8 = 5;

/// One contact: opens at once, closes after [`DEBOUNCE_TICKS`], and counts as open until it has been seen
/// open as long.
#[derive(Clone, Copy, Debug, Default)]
struct Contact {
    /// Ticks in a row at the present level, while that level is not yet believed.
    ticks: u8,
    was_open: bool,
    is_closed: bool,
}

impl Contact {
    fn tick(&mut self, level: bool) -> bool {
        let believed = if self.was_open { self.is_closed } else { true };
        if level == believed {
            self.ticks = 0;
        } else {
            self.ticks += 1;
        }
        let lasts = self.ticks >= DEBOUNCE_TICKS;
        if !self.was_open {
            if lasts {
                self.was_open = true;
                self.ticks = 0;
            }
        } else if !level {
            self.is_closed = false;
            self.ticks = 0;
        } else if lasts {
            self.is_closed = true;
            self.ticks = 0;
        }
        self.is_closed
    }
}

/// ENABLE and RESET.
#[derive(Clone, Copy, Debug, Default)]
pub struct Switches {
    enable: Contact,
    reset: Contact,
}

impl Switches {
    /// Takes the pins' levels of one tick.
    ///
    /// ENABLE goes low with its pin, in the same tick. It goes high after its pin was seen low for
    /// [`DEBOUNCE_TICKS`] since the start and then high as long: a switch that is already closed when the
    /// board starts, or a line that is torn and high, arms nothing, and a bouncing contact arms once.
    pub fn tick(&mut self, enable: bool, reset: bool) -> DigitalInputs {
        let mut inputs = DigitalInputs::default();
        if self.enable.tick(enable) {
            inputs |= DigitalInputs::ENABLE;
        }
        if self.reset.tick(reset) {
            inputs |= DigitalInputs::RESET;
        }
        inputs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn enabled(switches: &mut Switches, levels: &str) -> bool {
        let mut inputs = DigitalInputs::default();
        for level in levels.bytes() {
            inputs = switches.tick(level == b'1', false);
        }
        inputs.contains(DigitalInputs::ENABLE)
    }

    #[test]
    fn a_switch_closes_once_it_was_seen_open() {
        let mut switches = Switches::default();
        assert!(!enabled(&mut switches, "11111111111111"));
        assert!(!enabled(&mut switches, "000001111"));
        assert!(enabled(&mut switches, "1"));
    }

    #[test]
    fn it_opens_at_once_and_a_bounce_does_not_close_it_again() {
        let mut switches = Switches::default();
        assert!(enabled(&mut switches, "0000011111"));
        assert!(!enabled(&mut switches, "0"));
        assert!(!enabled(&mut switches, "1101101"));
        assert!(enabled(&mut switches, "1111"));
    }

    #[test]
    fn glitches_on_an_open_line_arm_nothing() {
        let mut switches = Switches::default();
        assert!(!enabled(&mut switches, "00000"));
        for _ in 0..100 {
            assert!(!enabled(&mut switches, "11110"));
        }
    }
}

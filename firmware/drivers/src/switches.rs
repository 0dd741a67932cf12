//! Debounces the switch of the safety chain and the reset button.

use painleve_shared::frame::DigitalInputs;

/// Time for which a contact must be open, and then closed, before it counts as closed, s.
const DEBOUNCE_S: f32 = 5e-3;

/// Least number of ticks for that.
const LEAST_TICKS: u8 = 5;

/// Debounced state of one contact.
#[derive(Clone, Copy, Debug)]
enum Contact {
    /// Must be open first; open for this many ticks.
    Opening(u8),
    /// Open; closed for this many ticks.
    Open(u8),
    Closed,
}

impl Contact {
    /// Returns whether the contact counts as closed.
    fn tick(&mut self, level: bool, debounce_ticks: u8) -> bool {
        *self = match (*self, level) {
            (Self::Opening(ticks), false) if ticks + 1 >= debounce_ticks => Self::Open(0),
            (Self::Opening(ticks), false) => Self::Opening(ticks + 1),
            (Self::Opening(_), true) => Self::Opening(0),
            (Self::Open(ticks), true) if ticks + 1 >= debounce_ticks => Self::Closed,
            (Self::Open(ticks), true) => Self::Open(ticks + 1),
            (Self::Open(_), false) => Self::Open(0),
            (Self::Closed, true) => Self::Closed,
            (Self::Closed, false) => Self::Opening(1),
        };
        matches!(self, Self::Closed)
    }
}

impl Default for Contact {
    fn default() -> Self {
        Self::Opening(0)
    }
}

/// ENABLE and RESET.
#[derive(Clone, Copy, Debug)]
pub struct Switches {
    enable: Contact,
    reset: Contact,
    debounce_ticks: u8,
}

impl Switches {
    /// Makes switches that are looked at `tick_hz` times a second, and must be open first.
    pub fn new(tick_hz: f32) -> Self {
        Self {
            enable: Contact::default(),
            reset: Contact::default(),
            debounce_ticks: ((DEBOUNCE_S * tick_hz) as u8).max(LEAST_TICKS),
        }
    }

    /// Takes ENABLE for open until it has been opened and closed again.
    pub fn must_open(&mut self) {
        self.enable = Contact::default();
    }

    /// Updates the state with the pins' levels of one tick.
    ///
    /// ENABLE goes low with its pin, in the same tick. It goes high again after its pin has been low for
    /// 5 ms, and five ticks, without interruption and then high for as long. A switch that is already closed
    /// when the board starts, a contact that bounces and a disturbed line therefore never arm the drive.
    pub fn tick(&mut self, enable: bool, reset: bool) -> DigitalInputs {
        let mut inputs = DigitalInputs::default();
        if self.enable.tick(enable, self.debounce_ticks) {
            inputs |= DigitalInputs::ENABLE;
        }
        if self.reset.tick(reset, self.debounce_ticks) {
            inputs |= DigitalInputs::RESET;
        }
        inputs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;

    fn enabled(switches: &mut Switches, levels: &str) -> bool {
        let mut inputs = DigitalInputs::default();
        for level in levels.bytes() {
            inputs = switches.tick(level == b'1', false);
        }
        inputs.contains(DigitalInputs::ENABLE)
    }

    #[test]
    fn a_switch_closes_only_after_it_was_open() {
        let mut switches = Switches::new(1000.0);
        assert!(!enabled(&mut switches, "11111111111111"));
        assert!(!enabled(&mut switches, "000001111"));
        assert!(enabled(&mut switches, "1"));
    }

    #[test]
    fn a_switch_opens_at_once_and_a_short_break_does_not_close_it_again() {
        let mut switches = Switches::new(1000.0);
        assert!(enabled(&mut switches, "0000011111"));
        assert!(!enabled(&mut switches, "0"));
        assert!(!enabled(&mut switches, "1101101111111111"));
        assert!(enabled(&mut switches, "0000011111"));
    }

    #[test]
    fn a_fast_board_debounces_for_as_long() {
        let mut switches = Switches::new(10_000.0);
        let [open, closed] = ["0", "1"].map(|level| level.repeat(49));
        assert!(!enabled(&mut switches, &format!("{open}{closed}1")));
        assert!(!enabled(&mut switches, &format!("{open}0{closed}")));
        assert!(enabled(&mut switches, "1"));
    }

    #[test]
    fn glitches_on_an_open_line_arm_nothing() {
        let mut switches = Switches::new(1000.0);
        assert!(!enabled(&mut switches, "00000"));
        for _ in 0..100 {
            assert!(!enabled(&mut switches, "11110"));
        }
    }
}

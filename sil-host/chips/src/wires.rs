//! Parts behind `embedded-hal`: a bus, select pins and a delay that share one virtual clock.

use std::cell::{Cell, RefCell};
use std::convert::Infallible;
use std::rc::Rc;

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{self, OutputPin};
use embedded_hal::spi::{self, SpiBus};

use crate::{Picoseconds, SECOND, SpiPart, Transfer};

/// A virtual clock; all copies show the same time.
#[derive(Clone, Debug, Default)]
pub struct Clock(Rc<Cell<Picoseconds>>);

impl Clock {
    /// Returns the present time.
    pub fn now(&self) -> Picoseconds {
        self.0.get()
    }

    /// Advances the clock.
    pub fn pass(&self, time: Picoseconds) {
        self.0.set(self.0.get() + time);
    }
}

impl DelayNs for Clock {
    fn delay_ns(&mut self, nanoseconds: u32) {
        self.pass(u64::from(nanoseconds) * 1000);
    }
}

/// A part shared by its owner and its wires.
pub type SharedPart<P> = Rc<RefCell<P>>;

/// A part, and whether it is selected.
struct Slot<P> {
    part: SharedPart<P>,
    selected: Rc<Cell<bool>>,
}

/// An SPI bus with parts on it.
pub struct ModelledBus<P> {
    clock: Clock,
    hz: u64,
    second_edge: bool,
    places: Vec<Slot<P>>,
}

impl<P: SpiPart> ModelledBus<P> {
    /// Creates a bus whose clock idles low, at this rate; `second_edge` for mode 1.
    pub fn new(clock: &Clock, hz: u64, second_edge: bool) -> Self {
        Self {
            clock: clock.clone(),
            hz,
            second_edge,
            places: Vec::new(),
        }
    }

    /// Connects a part to the bus and returns its select pin, which is high.
    pub fn attach(&mut self, part: &SharedPart<P>) -> SelectPin<P> {
        let selected = Rc::new(Cell::new(false));
        self.places.push(Slot {
            part: Rc::clone(part),
            selected: Rc::clone(&selected),
        });
        SelectPin {
            clock: self.clock.clone(),
            part: Rc::clone(part),
            selected,
        }
    }

    fn exchange(&mut self, value: u8) -> u8 {
        let transfer = Transfer {
            value: value.into(),
            bits: 8,
            hz: self.hz,
            idles_high: false,
            second_edge: self.second_edge,
            start: self.clock.now(),
        };
        self.clock.pass(8 * SECOND / self.hz);
        let now = self.clock.now();
        // No part drives the line: it is pulled up.
        let selected = self.places.iter().filter(|it| it.selected.get());
        selected.fold(u8::MAX, |line, place| {
            line & place.part.borrow_mut().transfer(&transfer, now) as u8
        })
    }
}

impl<P> spi::ErrorType for ModelledBus<P> {
    type Error = Infallible;
}

impl<P: SpiPart> SpiBus for ModelledBus<P> {
    fn read(&mut self, words: &mut [u8]) -> Result<(), Infallible> {
        for word in words {
            *word = self.exchange(0);
        }
        Ok(())
    }

    fn write(&mut self, words: &[u8]) -> Result<(), Infallible> {
        for word in words {
            self.exchange(*word);
        }
        Ok(())
    }

    fn transfer(&mut self, read: &mut [u8], write: &[u8]) -> Result<(), Infallible> {
        for at in 0..read.len().max(write.len()) {
            let received = self.exchange(write.get(at).copied().unwrap_or(0));
            if let Some(place) = read.get_mut(at) {
                *place = received;
            }
        }
        Ok(())
    }

    fn transfer_in_place(&mut self, words: &mut [u8]) -> Result<(), Infallible> {
        for word in words {
            *word = self.exchange(*word);
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// A part's select pin, low for selected.
pub struct SelectPin<P> {
    clock: Clock,
    part: SharedPart<P>,
    selected: Rc<Cell<bool>>,
}

impl<P> digital::ErrorType for SelectPin<P> {
    type Error = Infallible;
}

impl<P: SpiPart> OutputPin for SelectPin<P> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        if !self.selected.replace(true) {
            self.part.borrow_mut().select(self.clock.now());
        }
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        if self.selected.replace(false) {
            self.part.borrow_mut().deselect(self.clock.now());
        }
        Ok(())
    }
}

//! The line to an emulated bare board, with the host's delays and, if wanted, disturbances.

use std::time::Duration;

use painleve_board::{BoardError, Port};
use painleve_chips::{MICROSECOND, Picoseconds};
use painleve_flash_image::board::{BoardChip, EmulatedBoard};

/// Steps in which the board runs until something arrives.
const STEP: Picoseconds = 100 * MICROSECOND;

/// Disturbances of one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Disturbances {
    /// One of so many bytes has a flipped bit; 0 for none.
    pub flips: u64,
    /// One of so many bytes is lost; 0 for none.
    pub losses: u64,
}

/// An emulated board at the end of a serial line.
pub struct EmulatedPort<C: BoardChip> {
    pub board: EmulatedBoard<C>,
    pub to_board: Disturbances,
    pub to_host: Disturbances,
    /// Longest delay of a message by the host and its adapter.
    pub delay: Picoseconds,
    pub random: u64,
    waiting: Vec<u8>,
}

impl<C: BoardChip> EmulatedPort<C> {
    pub fn new(board: EmulatedBoard<C>, random: u64) -> Self {
        Self {
            board,
            to_board: Disturbances::default(),
            to_host: Disturbances::default(),
            delay: 0,
            random,
            waiting: Vec::new(),
        }
    }

    fn below(&mut self, limit: u64) -> u64 {
        self.random = self
            .random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.random >> 33) % limit.max(1)
    }

    fn disturbed(&mut self, bytes: &[u8], by: Disturbances) -> Vec<u8> {
        let mut sent = Vec::new();
        for byte in bytes {
            if by.losses > 0 && self.below(by.losses) == 0 {
                continue;
            }
            let flips = by.flips > 0 && self.below(by.flips) == 0;
            sent.push(byte ^ if flips { 1 << self.below(8) } else { 0 });
        }
        sent
    }

    fn pause(&mut self) {
        let delay = self.below(self.delay);
        if delay > 0 {
            self.board.machine.run_for(delay);
        }
    }
}

impl<C: BoardChip> Port for EmulatedPort<C> {
    fn read(&mut self, bytes: &mut [u8], limit: Duration) -> Result<usize, BoardError> {
        let end = self.now() + limit;
        loop {
            let sent = self.board.take_sent();
            let heard = self.disturbed(&sent, self.to_host);
            self.waiting.extend(heard);
            if !self.waiting.is_empty() {
                let length = bytes.len().min(self.waiting.len());
                bytes[..length].copy_from_slice(&self.waiting[..length]);
                self.waiting.drain(..length);
                self.pause();
                return Ok(length);
            }
            let left = end.saturating_sub(self.now());
            if left.is_zero() {
                return Ok(0);
            }
            let left = 1000 * left.as_nanos() as Picoseconds;
            self.board.machine.run_for(left.clamp(1000, STEP));
        }
    }

    fn write(&mut self, bytes: &[u8], _: Duration) -> Result<(), BoardError> {
        self.pause();
        let sent = self.disturbed(bytes, self.to_board);
        self.board.send_bytes(&sent);
        Ok(())
    }

    fn now(&self) -> Duration {
        Duration::from_nanos(self.board.machine.now() / 1000)
    }
}

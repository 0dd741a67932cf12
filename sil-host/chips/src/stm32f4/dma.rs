//! A DMA controller with eight streams (RM0090, section 10): single bytes between a peripheral and memory.

use crate::unicorn::Processor;

const ENABLED: u32 = 1;
const MEMORY_INCREMENT: u32 = 1 << 10;

/// Control by the peripheral, memory to memory, increments, widths, two buffers, bursts.
const MODE: u32 = 1 << 5 | 1 << 7 | 0x7f << 9 | 1 << 18 | 15 << 21;

const HALF: u32 = 1 << 4;
const COMPLETE: u32 = 1 << 5;

/// A peripheral's request (RM0090, tables 42 and 43).
#[derive(Clone, Copy, Debug)]
pub struct Request {
    /// Streams to which it is wired.
    pub streams: &'static [usize],
    /// Its channel at these streams.
    pub channel: u32,
    /// Address of the data register.
    pub data: u32,
    /// Whether the peripheral is read.
    pub to_memory: bool,
}

/// One stream.
#[derive(Clone, Debug, Default)]
struct Stream {
    control: u32,
    left: u32,
    length: u32,
    peripheral: u32,
    memory: u32,
    fifo: u32,
}

/// Registers of a controller.
#[derive(Clone, Debug, Default)]
pub struct Dma {
    flags: [u32; 8],
    streams: [Stream; 8],
}

/// Returns the position of a stream's flags in its status register.
fn shift(stream: usize) -> u32 {
    [0, 6, 16, 22][stream % 4]
}

impl Dma {
    /// Handles a load.
    pub fn read(&self, offset: u32) -> u32 {
        match offset {
            0x00 | 0x04 => {
                let first = offset as usize;
                (first..first + 4).fold(0, |bits, it| bits | self.flags[it] << shift(it))
            }
            0x10..0xd0 => {
                let stream = &self.streams[((offset - 0x10) / 0x18) as usize];
                match (offset - 0x10) % 0x18 {
                    0x00 => stream.control,
                    0x04 => stream.left,
                    0x08 => stream.peripheral,
                    0x0c => stream.memory,
                    0x14 => stream.fifo | 0x21,
                    _ => 0,
                }
            }
            _ => 0,
        }
    }

    /// Handles a store.
    pub fn write(&mut self, offset: u32, value: u32) {
        match offset {
            0x08 | 0x0c => {
                let first = offset as usize - 8;
                for it in first..first + 4 {
                    self.flags[it] &= !(value >> shift(it) & 0x3d);
                }
            }
            0x10..0xd0 => {
                let number = ((offset - 0x10) / 0x18) as usize;
                let stream = &mut self.streams[number];
                let register = (offset - 0x10) % 0x18;
                let is_enabled = stream.control & ENABLED != 0;
                assert!(!is_enabled || register == 0, "stream {number} is enabled");
                match register {
                    0x00 => {
                        if value & ENABLED != 0 && !is_enabled {
                            assert_eq!(self.flags[number], 0, "flags of stream {number}");
                            let mode = value & MODE;
                            assert_eq!(mode, MEMORY_INCREMENT, "mode of stream {number}");
                            stream.length = stream.left;
                        }
                        stream.control = value;
                    }
                    0x04 => stream.left = value & 0xffff,
                    0x08 => stream.peripheral = value,
                    0x0c => stream.memory = value,
                    0x14 => stream.fifo = value,
                    _ => {}
                }
            }
            _ => {}
        }
    }

    fn serving(&self, request: Request) -> Option<usize> {
        let direction = if request.to_memory { 0 } else { 1 };
        request.streams.iter().copied().find(|number| {
            let it = &self.streams[*number];
            it.control & ENABLED != 0
                && it.control >> 25 & 7 == request.channel
                && it.control >> 6 & 3 == direction
                && it.peripheral == request.data
                && it.left > 0
        })
    }

    /// Returns whether a request is served.
    pub fn serves(&self, request: Request) -> bool {
        self.serving(request).is_some()
    }

    /// Moves one byte from a peripheral to memory.
    pub fn store_byte(&mut self, request: Request, byte: u8, memory: &Processor) {
        if let Some(place) = self.next(request) {
            memory.write_memory(place, &[byte]);
        }
    }

    /// Moves one byte from memory to a peripheral.
    pub fn load_byte(&mut self, request: Request, memory: &Processor) -> Option<u8> {
        let place = self.next(request)?;
        let mut byte = [0];
        memory.read_memory(place, &mut byte);
        Some(byte[0])
    }

    fn next(&mut self, request: Request) -> Option<u32> {
        let number = self.serving(request)?;
        let stream = &mut self.streams[number];
        let place = stream.memory + (stream.length - stream.left);
        stream.left -= 1;
        if stream.left == stream.length / 2 {
            self.flags[number] |= HALF;
        }
        if stream.left == 0 {
            self.flags[number] |= COMPLETE;
            if stream.control & 1 << 8 != 0 {
                stream.left = stream.length;
            } else {
                stream.control &= !ENABLED;
            }
        }
        Some(place)
    }

    /// Returns whether a stream's interrupt line is high.
    pub fn interrupts(&self, stream: usize) -> bool {
        let control = self.streams[stream].control;
        let flags = self.flags[stream];
        (flags & COMPLETE != 0 && control & 1 << 4 != 0)
            || (flags & HALF != 0 && control & 1 << 3 != 0)
    }
}

//! A DMA controller with eight channels (RM0440, chapter DMA), and the multiplexer of its requests (chapter DMAMUX):
//! single bytes between a peripheral and memory.

use crate::unicorn::Processor;

const ENABLED: u32 = 1;
const CIRCULAR: u32 = 1 << 5;
const MEMORY_INCREMENT: u32 = 1 << 7;

/// Increments, widths, memory to memory.
const MODE: u32 = 0x3f << 6 | 1 << 14;

/// One channel, with its part of the multiplexer.
#[derive(Clone, Copy, Debug, Default)]
struct Channel {
    control: u32,
    left: u32,
    length: u32,
    peripheral: u32,
    memory: u32,
    /// The request that the multiplexer connects.
    request: u32,
}

/// A peripheral's request: its number at the multiplexer and the data register to be served.
#[derive(Clone, Copy, Debug)]
pub struct Request {
    /// Number of the multiplexer's input.
    pub number: u32,
    /// Address of the data register.
    pub data: u32,
    /// Whether the peripheral is read.
    pub to_memory: bool,
}

/// Registers of a controller.
#[derive(Clone, Debug, Default)]
pub struct Dma {
    channels: [Channel; 8],
}

impl Dma {
    fn channel(offset: u32) -> Option<(usize, u32)> {
        let offset = offset.checked_sub(0x08)?;
        (offset < 8 * 0x14).then_some(((offset / 0x14) as usize, offset % 0x14))
    }

    /// Handles a load.
    pub fn read(&self, offset: u32) -> u32 {
        let Some((number, register)) = Self::channel(offset) else {
            return 0;
        };
        let channel = self.channels[number];
        match register {
            0x00 => channel.control,
            0x04 => channel.left,
            0x08 => channel.peripheral,
            0x0c => channel.memory,
            _ => 0,
        }
    }

    /// Handles a store. Registers of an enabled channel are write-protected.
    pub fn write(&mut self, offset: u32, value: u32) {
        let Some((number, register)) = Self::channel(offset) else {
            return;
        };
        let channel = &mut self.channels[number];
        let is_enabled = channel.control & ENABLED != 0;
        match register {
            0x00 => {
                if value & ENABLED != 0 && !is_enabled {
                    let mode = value & MODE;
                    assert_eq!(mode, MEMORY_INCREMENT, "mode of channel {number}");
                    channel.length = channel.left;
                }
                channel.control = value;
            }
            0x04 if !is_enabled => channel.left = value & 0xffff,
            0x08 if !is_enabled => channel.peripheral = value,
            0x0c if !is_enabled => channel.memory = value,
            _ => {}
        }
    }

    /// Handles a load of the multiplexer.
    pub fn read_multiplexer(&self, offset: u32) -> u32 {
        let channel = self.channels.get((offset / 4) as usize);
        channel.map_or(0, |it| it.request)
    }

    /// Handles a store to the multiplexer.
    pub fn write_multiplexer(&mut self, offset: u32, value: u32) {
        if let Some(channel) = self.channels.get_mut((offset / 4) as usize) {
            channel.request = value & 0x7f;
        }
    }

    fn serving(&self, request: Request) -> Option<usize> {
        let direction = if request.to_memory { 0 } else { 1 };
        self.channels.iter().position(|it| {
            it.request == request.number
                && it.control & ENABLED != 0
                && it.control >> 4 & 1 == direction
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
        let channel = &mut self.channels[self.serving(request)?];
        let place = channel.memory + (channel.length - channel.left);
        channel.left -= 1;
        // A channel that has finished stays enabled.
        if channel.left == 0 && channel.control & CIRCULAR != 0 {
            channel.left = channel.length;
        }
        Some(place)
    }
}

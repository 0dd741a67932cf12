//! The port of a board to the host.

/// The link task's part of a board: bytes to and from the host.
pub trait Port {
    /// Returns whether the host sends nothing until its last frame is answered, and [`receive`](Self::receive) waits for
    /// it. The port of a chip does neither.
    fn is_half_duplex(&self) -> bool {
        false
    }

    /// Moves received bytes into `buffer`; returns their number, 0 if there are none.
    fn receive(&mut self, buffer: &mut [u8]) -> usize;

    /// Sends all bytes or, if the host does not accept them, none. A port that keeps bytes until the line is free also refuses
    /// them if it could not keep `spare` others after them.
    fn send(&mut self, bytes: &[u8], spare: usize) -> bool;
}

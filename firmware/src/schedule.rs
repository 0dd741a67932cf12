//! The turns that slow work takes, so that no update is long.

/// The slow work of one update. Each update with readings takes the next turn, however its tick is numbered and
/// whichever readings are lost between.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Turn {
    /// The torques that the model does not explain, and the links' length.
    #[default]
    Balance,
    /// The response of the contact, if a block of its readings is complete; otherwise the edges.
    Edges,
}

impl Turn {
    /// Updates from one turn to the next of the same work.
    pub const COUNT: f32 = 2.0;

    /// Takes this turn; the other one is next.
    #[inline]
    pub fn take(&mut self) -> Self {
        let other = match self {
            Self::Balance => Self::Edges,
            Self::Edges => Self::Balance,
        };
        core::mem::replace(self, other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_returns_after_their_number() {
        let mut turn = Turn::default();
        let first = turn.take();
        let updates = 1 + (0..10).take_while(|_| turn.take() != first).count();
        assert_eq!(updates as f32, Turn::COUNT);
    }
}

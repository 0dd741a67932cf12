//! The turns that slow work takes, so that no update is long.

/// The slow work of one update. Each update with readings takes the next turn, however its tick is numbered and
/// whichever readings are lost between.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Turn {
    /// The torques that the model does not explain, and the links' length.
    #[default]
    Balance,
    /// The edges of the admissible stretch.
    Edges,
    /// The averages of the contact's response.
    Average,
    /// The bounds of the contact's response.
    Bound,
}

impl Turn {
    /// Updates from one turn to the next of the same work.
    pub const COUNT: f32 = 4.0;

    /// Takes this turn; another one is next.
    #[inline]
    pub fn take(&mut self) -> Self {
        let next = match self {
            Self::Balance => Self::Edges,
            Self::Edges => Self::Average,
            Self::Average => Self::Bound,
            Self::Bound => Self::Balance,
        };
        core::mem::replace(self, next)
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

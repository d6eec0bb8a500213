//! Plane or spatial.

/// Number of space directions in which a body moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Dimension {
    /// Plane strain: x and y, per metre of thickness.
    Plane,
    /// x, y and z.
    Space,
}

impl Dimension {
    /// 2 or 3.
    pub fn count(self) -> usize {
        match self {
            Self::Plane => 2,
            Self::Space => 3,
        }
    }
}

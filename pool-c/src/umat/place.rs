//! Where a call of the host is: element, integration point, and place in a composite section.

use std::ffi::{c_char, c_int};
use std::fmt;
use std::ops::RangeInclusive;

/// First character of the names of materials that CalculiX takes from libraries. No name of Abaqus begins with it, unless in quotes.
const OF_CALCULIX: c_char = b'@' as c_char;

/// A point with grains of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Place {
    /// NOEL.
    pub(super) element: c_int,
    /// NPT.
    pub(super) point: c_int,
    /// LAYER; 0 where the host does not fill it.
    pub(super) layer: c_int,
    /// KSPT; 0 where the host does not fill it.
    pub(super) section_point: c_int,
}

impl Place {
    /// The place in a call whose CMNAME begins with this character; None where there is no name.
    ///
    /// CalculiX passes variables for LAYER and KSPT that it never sets, and counts NPT through all layers of an element.
    pub(super) fn new(name: Option<c_char>, [element, point, layer, section_point]: [c_int; 4]) -> Self {
        match name {
            Some(OF_CALCULIX) => Self { element, point, layer: 0, section_point: 0 },
            _ => Self { element, point, layer, section_point },
        }
    }

    /// All places of the same integration point.
    pub(super) fn all_of_point(self) -> RangeInclusive<Self> {
        let bound = |value| Self { layer: value, section_point: value, ..self };
        bound(c_int::MIN)..=bound(c_int::MAX)
    }
}

impl fmt::Display for Place {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { element, point, layer, section_point } = *self;
        write!(formatter, "element {element} point {point}")?;
        // Hosts say 0 or 1 where there is no section.
        match (layer, section_point) {
            (0 | 1, 0 | 1) => Ok(()),
            _ => write!(formatter, " layer {layer} section point {section_point}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_calculix_leaves_in_layer_and_section_point_is_no_place() {
        let calculix = [[7, 1, 0, 0], [7, 1, -9, 32_767]].map(|numbers| Place::new(Some(OF_CALCULIX), numbers));
        assert_eq!(calculix[0], calculix[1]);
        for name in [None, Some(b'G' as c_char)] {
            let abaqus = [[7, 1, 1, 1], [7, 1, 2, 1], [7, 1, 1, 2]].map(|numbers| Place::new(name, numbers));
            assert!(abaqus[0] != abaqus[1] && abaqus[0] != abaqus[2] && abaqus[1] != abaqus[2]);
        }
    }

    #[test]
    fn messages_name_layers_where_there_are_some() {
        let text = |numbers| Place::new(None, numbers).to_string();
        assert_eq!(text([7, 1, 1, 1]), "element 7 point 1");
        assert_eq!(text([7, 1, 2, 1]), "element 7 point 1 layer 2 section point 1");
    }
}

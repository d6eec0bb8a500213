//! Directions in space on the lower hemisphere in equal-area (Schmidt) projection: the rose diagram of spheres.

use crate::map::{colour, colour_scale};
use crate::number::short;
use crate::svg::Svg;
use std::f64::consts::{PI, TAU};

/// Radius of the net, px.
const RADIUS: f64 = 210.0;

/// Width of the picture, and height of the strip of words and colours below the net, px.
const WIDTH: f64 = 520.0;
const FOOT: f64 = 84.0;

/// Rings of the net. Ring `k` from 0 has `4 (2 k + 1)` cells, so that all cells cover the same solid angle.
const RINGS: usize = 8;

/// Straight pieces of each arc of a cell.
const PIECES: usize = 6;

/// Directions without sign, such as contact normals, on a net about the vertical axis y.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stereonet {
    /// Above the net.
    pub title: String,
    /// What the colours are, with their unit.
    pub quantity: String,
    /// Value of each cell, see [`Stereonet::cell`]; white where it is not finite.
    pub values: Vec<f64>,
}

impl Stereonet {
    /// Number of cells of equal solid angle, that of the hemisphere over this.
    pub const CELLS: usize = 4 * RINGS * RINGS;

    /// Cell of a direction: a vector and its opposite have the same. `None` for a vector without length.
    pub fn cell(direction: [f64; 3]) -> Option<usize> {
        let length = direction.iter().map(|part| part * part).sum::<f64>().sqrt();
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        // Downwards; horizontal directions by the sign of x, and of z where that is 0.
        let [x, y, z] = direction;
        let is_up = y > 0.0 || (y == 0.0 && (x < 0.0 || (x == 0.0 && z < 0.0)));
        // Without negative zeros, whose angle would be another one.
        let [x, y, z] = direction.map(|part| if is_up { -part } else { part } / length + 0.0);
        // The area inside a radius of the projection is that of the cap, 1 - cos of the angle to the pole.
        let share = (1.0 + y).clamp(0.0, 1.0).sqrt();
        let ring = ((share * RINGS as f64) as usize).min(RINGS - 1);
        let sectors = 4 * (2 * ring + 1);
        let turn = (0.0 - z).atan2(x).rem_euclid(TAU) / TAU;
        Some(4 * ring * ring + ((turn * sectors as f64) as usize).min(sectors - 1))
    }

    /// The picture: seen from above, x to the right, -z upwards; the middle is the vertical.
    pub fn to_svg(&self) -> String {
        let finite = || self.values.iter().copied().filter(|value| value.is_finite());
        let (least, most) =
            finite().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        let middle = [0.5 * WIDTH, FOOT + RADIUS + 14.0];
        let mut svg = Svg::new(WIDTH, FOOT + 2.0 * RADIUS + 64.0);
        for (number, value) in self.values.iter().enumerate().take(Self::CELLS) {
            let fill = if value.is_finite() { colour((value - least) / (most - least)) } else { "#fff".to_owned() };
            let style = format!("fill=\"{fill}\" stroke=\"{fill}\" stroke-width=\"0.5\"");
            svg.polygon(&corners(number, middle), &style);
        }
        svg.circle(middle, RADIUS, "fill=\"none\" stroke=\"black\" stroke-width=\"1\"");
        let [x, y] = middle;
        svg.words([x + RADIUS + 6.0, y - 4.0], 13, "start", "x");
        svg.words([x, y + RADIUS + 5.0], 13, "middle", "-z");
        svg.words([x + 4.0, y + 4.0], 13, "start", "y");
        svg.circle(middle, 1.5, "fill=\"black\"");
        svg.words([x, FOOT + 2.0 * RADIUS + 42.0], 17, "middle", &self.title);
        colour_scale(&mut svg, 36.0, WIDTH - 36.0, 34.0, 14.0);
        if least <= most {
            svg.words([36.0, 12.0], 13, "start", &short(least));
            svg.words([WIDTH - 36.0, 12.0], 13, "end", &short(most));
        }
        svg.words([x, 12.0], 13, "middle", &self.quantity);
        svg.finish()
    }
}

/// Corners of a cell in pixels.
fn corners(number: usize, [x, y]: [f64; 2]) -> Vec<[f64; 2]> {
    let ring = (0..RINGS).rev().find(|ring| 4 * ring * ring <= number).unwrap_or(0);
    let sectors = (4 * (2 * ring + 1)) as f64;
    let begin = (number - 4 * ring * ring) as f64;
    let at = |ring: usize, sector: f64| {
        let (radius, angle) = (RADIUS * ring as f64 / RINGS as f64, 2.0 * PI * sector / sectors);
        [x + radius * angle.cos(), y + radius * angle.sin()]
    };
    let piece = |piece: usize| begin + piece as f64 / PIECES as f64;
    let outer = (0..=PIECES).map(|number| at(ring + 1, piece(number)));
    let inner = (0..=PIECES).rev().map(|number| at(ring, piece(number)));
    if ring == 0 { outer.chain([[x, y]]).collect() } else { outer.chain(inner).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Directions spread evenly over the sphere (Fibonacci) fill the cells evenly: the cells have equal solid angles.
    #[test]
    fn cells_cover_equal_solid_angles() {
        let count = 256_000;
        let golden = PI * (3.0 - 5.0_f64.sqrt());
        let mut cells = vec![0.0; Stereonet::CELLS];
        for number in 0..count {
            let y = 1.0 - 2.0 * (f64::from(number) + 0.5) / f64::from(count);
            let (sin, cos) = (golden * f64::from(number)).sin_cos();
            let level = (1.0 - y * y).sqrt();
            cells[Stereonet::cell([level * cos, y, level * sin]).unwrap()] += 1.0;
        }
        for cell in cells {
            assert!((cell / 1000.0 - 1.0_f64).abs() < 0.05, "{cell}");
        }
    }

    #[test]
    fn a_direction_and_its_opposite_have_one_cell_and_the_vertical_is_the_middle() {
        for direction in
            [[0.3, 0.4, -0.5], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0], [-1.0, 0.0, 1e-9], [0.0, 5.0, 0.0], [0.0, -5.0, 0.0]]
        {
            let opposite = direction.map(|part: f64| -part);
            assert_eq!(Stereonet::cell(direction), Stereonet::cell(opposite), "{direction:?}");
        }
        assert!(Stereonet::cell([0.0, -1.0, 0.0]).unwrap() < 4);
        assert!(Stereonet::cell([1.0, 0.0, 0.0]).unwrap() >= 4 * (RINGS - 1) * (RINGS - 1));
        assert_eq!(Stereonet::cell([0.0; 3]), None);
        assert_eq!(Stereonet::cell([f64::NAN, 0.0, 0.0]), None);
    }

    #[test]
    fn cells_are_coloured_by_their_value() {
        let mut values = vec![1.0; Stereonet::CELLS];
        values[0] = 3.0;
        values[1] = f64::NAN;
        let text = Stereonet { title: "normals".into(), quantity: "density".into(), values }.to_svg();
        assert_eq!(text.matches("<polygon").count(), Stereonet::CELLS + crate::map::STEPS);
        assert!(text.contains("rgb(253,231,37)") && text.contains("#fff") && !text.contains("NaN"), "{text}");
        assert!(!Stereonet::default().to_svg().contains("NaN") && !Stereonet::default().to_svg().contains("inf"));
    }
}

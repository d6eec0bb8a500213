//! Layers of a specimen that is sheared: their mean displacements, and the shear strain between them. What grains move at random drops out of
//! the means, so that a shear band shows.

use super::axes::axis_of;
use super::results::SpecimenPicture;
use crate::error::DefinitionError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// The table `[profile]`: the shear of layers, which `--profiles DIR` writes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProfileTable {
    /// Axis along which the layers follow each other: "x", "y" or "z".
    pub axis: String,
    /// Axis along which they shear.
    pub along: String,
    /// Number of layers. A layer holds the grains whose centres lie in it when the counting begins, and moves with them; layers without
    /// grains are left out.
    #[serde(default = "some_layers")]
    #[schemars(range(min = 3, max = 1000))]
    pub layers: usize,
    /// Name of the stage at whose start the counting begins.
    #[serde(default)]
    #[schemars(extend("x-default" = "the first stage"))]
    pub from: Option<String>,
    /// Rows of the table over which the growth of the shear strain is taken: that of the last row alone has the noise of single snaps.
    #[serde(default = "some_rows")]
    #[schemars(range(min = 1, max = 10_000))]
    pub window: usize,
}

fn some_layers() -> usize {
    24
}

fn some_rows() -> usize {
    5
}

impl ProfileTable {
    /// Checks the keys; `stages` are the names of the stages in order.
    pub(super) fn validate(&self, dimension: usize, stages: &[&str]) -> Result<(), DefinitionError> {
        for (key, name) in [("axis", &self.axis), ("along", &self.along)] {
            if axis_of(name).is_none_or(|axis| axis >= dimension) {
                return Err(DefinitionError(format!("profile.{key} = \"{name}\" is no axis of this specimen")));
            }
        }
        if self.axis == self.along {
            return Err(DefinitionError(
                "profile: layers shear along another axis than they follow each other".into(),
            ));
        }
        if !(3..=1000).contains(&self.layers) || !(1..=10_000).contains(&self.window) {
            return Err(DefinitionError(format!(
                "profile: layers = {} must lie between 3 and 1000, and window = {} between 1 and 10000",
                self.layers, self.window
            )));
        }
        match &self.from {
            Some(from) if !stages.contains(&from.as_str()) => Err(DefinitionError(format!(
                "profile.from: there is no stage '{from}'; use one of: {}",
                stages.join(", ")
            ))),
            _ => Ok(()),
        }
    }

    /// Whether counting begins with the stage of this number and name.
    pub fn begins_with(&self, number: usize, name: &str) -> bool {
        self.from.as_ref().map_or(number == 0, |from| from == name)
    }
}

/// Two neighbouring layers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interface {
    /// Present coordinate of the middle between them, m.
    pub coordinate: f64,
    /// Distance of their centres when the counting began, m.
    pub thickness: f64,
    /// Mean displacement of both along the direction of shear since then, m.
    pub displacement: f64,
    /// Shear strain since then: difference of their displacements over their distance.
    pub shear_strain: f64,
    /// Growth of the shear strain over the window; from the beginning while there are fewer rows.
    pub growth: f64,
}

/// Layers, from the state in which the counting began.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Layers {
    axis: usize,
    along: usize,
    window: usize,
    /// Layer and weight of each grain.
    members: Vec<(usize, f64)>,
    /// Weight of each layer.
    weights: Vec<f64>,
    /// Mean coordinates of the layers along both axes when the counting began, m.
    start: Vec<[f64; 2]>,
    /// Mean coordinates at the beginning and in the last rows, as far back as the window reaches.
    past: VecDeque<Vec<[f64; 2]>>,
}

impl Layers {
    /// Layers of equal thickness between the outermost centres. Grains weigh as much as their volume. `table` is one
    /// that has been checked.
    pub fn new(table: &ProfileTable, dimension: usize, picture: &SpecimenPicture) -> Self {
        let [axis, along] =
            [&table.axis, &table.along].map(|name| axis_of(name).expect("a checked table names axes"));
        let places = || picture.centres.iter().map(|centre| centre[axis]);
        let (low, high) = (places().fold(f64::INFINITY, f64::min), places().fold(f64::NEG_INFINITY, f64::max));
        let layer = |place: f64| {
            let share = if high > low { (place - low) / (high - low) } else { 0.0 };
            ((share * table.layers as f64) as usize).min(table.layers - 1)
        };
        // Layers without grains have no number.
        let mut numbers: Vec<usize> = places().map(layer).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let number = |place: f64| numbers.partition_point(|other| *other < layer(place));
        let weight = |radius: &f64| radius.powi(dimension as i32);
        let members: Vec<(usize, f64)> = places().map(number).zip(picture.radii.iter().map(weight)).collect();
        let mut weights = vec![0.0; numbers.len()];
        members.iter().for_each(|(layer, weight)| weights[*layer] += weight);
        let mut layers = Self { axis, along, window: table.window, members, weights, ..Self::default() };
        layers.start = layers.means(picture);
        layers.past.push_back(layers.start.clone());
        layers
    }

    /// Mean coordinates of the layers along the axis and the direction of shear.
    fn means(&self, picture: &SpecimenPicture) -> Vec<[f64; 2]> {
        let mut sums = vec![[0.0; 2]; self.weights.len()];
        for (&(layer, weight), centre) in self.members.iter().zip(&picture.centres) {
            sums[layer][0] += weight * centre[self.axis];
            sums[layer][1] += weight * centre[self.along];
        }
        sums.iter().zip(&self.weights).map(|(sum, weight)| sum.map(|part| part / weight)).collect()
    }

    /// The interfaces in the state of a row, which is remembered.
    pub fn advance(&mut self, picture: &SpecimenPicture) -> Vec<Interface> {
        let now = self.means(picture);
        let before = self.past.front().unwrap_or(&self.start);
        let interface = |lower: usize| {
            let upper = lower + 1;
            let thickness = self.start[upper][0] - self.start[lower][0];
            let shear =
                |from: &[[f64; 2]]| ((now[upper][1] - from[upper][1]) - (now[lower][1] - from[lower][1])) / thickness;
            let way = |layer: usize| now[layer][1] - self.start[layer][1];
            Interface {
                coordinate: 0.5 * (now[upper][0] + now[lower][0]),
                thickness,
                displacement: 0.5 * (way(upper) + way(lower)),
                shear_strain: shear(&self.start),
                growth: shear(before),
            }
        };
        let interfaces = (0..now.len().saturating_sub(1)).map(interface).collect();
        self.past.push_back(now);
        while self.past.len() > self.window {
            self.past.pop_front();
        }
        interfaces
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(window: usize) -> ProfileTable {
        ProfileTable { axis: "y".into(), along: "x".into(), layers: 10, from: None, window }
    }

    /// Grains on a grid of 20 x 40 with radii of two sizes, displaced by `way` along x.
    fn picture(way: impl Fn(f64) -> f64) -> SpecimenPicture {
        let place = |number: i32| [f64::from(number % 20), f64::from(number / 20) + 0.5];
        let centres = (0..800).map(place).map(|[x, y]| [x + way(y), y, 0.0]).collect();
        let radii = (0..800).map(|number| if number % 3 == 0 { 0.5 } else { 0.25 }).collect();
        SpecimenPicture { centres, radii, ..SpecimenPicture::default() }
    }

    #[test]
    fn a_linear_field_shears_all_layers_alike() {
        let mut layers = Layers::new(&table(1), 2, &picture(|_| 0.0));
        let interfaces = layers.advance(&picture(|y| 0.3 * y + 7.0));
        assert_eq!(interfaces.len(), 9);
        for interface in &interfaces {
            assert!((interface.shear_strain - 0.3).abs() < 1e-12 && (interface.growth - 0.3).abs() < 1e-12);
            assert!((interface.displacement - 7.0 - 0.3 * interface.coordinate).abs() < 1e-12, "{interface:?}");
        }
    }

    /// The growth is that over the window: rows of shear 0.1, 0.2, 0.4 and 0.8.
    #[test]
    fn growth_is_taken_over_the_window() {
        for (window, expected) in [(1, [0.1, 0.1, 0.2, 0.4]), (2, [0.1, 0.2, 0.3, 0.6]), (9, [0.1, 0.2, 0.4, 0.8])] {
            let mut layers = Layers::new(&table(window), 2, &picture(|_| 0.0));
            for (shear, growth) in [0.1, 0.2, 0.4, 0.8].into_iter().zip(expected) {
                // State and back, as between two processes of a run.
                let text = serde_json::to_string(&layers).unwrap();
                layers = serde_json::from_str(&text).unwrap();
                let interfaces = layers.advance(&picture(|y| shear * y));
                assert!(interfaces.iter().all(|interface| (interface.growth - growth).abs() < 1e-12), "{window}");
            }
        }
    }

    #[test]
    fn empty_layers_are_left_out_and_defects_named() {
        let mut gap = picture(|_| 0.0);
        gap.centres.retain(|centre| !(10.0..20.0).contains(&centre[1]));
        gap.radii.truncate(gap.centres.len());
        assert!(Layers::new(&table(1), 2, &gap).advance(&gap).len() < 9);
        let defect = |change: fn(&mut ProfileTable)| {
            let mut table = table(1);
            change(&mut table);
            table.validate(2, &["press", "shear"]).map_err(|error| error.0)
        };
        assert_eq!(defect(|_| ()), Ok(()));
        assert!(defect(|table| table.axis = "z".into()).unwrap_err().contains("no axis"));
        assert!(defect(|table| table.along = "y".into()).unwrap_err().contains("another axis"));
        assert!(defect(|table| table.layers = 2).unwrap_err().contains("between 3 and 1000"));
        assert!(defect(|table| table.from = Some("pull".into())).unwrap_err().contains("press, shear"));
    }
}

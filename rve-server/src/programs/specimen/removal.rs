//! Grains taken out of a part of a specimen, as [Liu2015] section 3.4 weakens a row of its layer.

use super::SpecimenSpace;
use super::assembly::{Assembled, History};
use crate::cell::ContactRecord;
use crate::error::DefinitionError;
use crate::preparation::chosen;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A box of the specimen from which grains are removed before the first stage. What is left is not moved: the first stage has to
/// bring it back to its stress.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Lower corner, as shares of the specimen's sides or, with `unit = "m"`, in metres from its lower corner. The region holds the
    /// grains whose centres lie in the box, the upper faces left out.
    #[schemars(extend("x-unit" = "-, m"))]
    pub from: Vec<f64>,
    /// Upper corner.
    #[schemars(extend("x-unit" = "-, m"))]
    pub to: Vec<f64>,
    /// Unit of the corners.
    #[serde(default)]
    pub unit: RegionUnit,
    /// Number of grains removed at random. Give this or `share`.
    #[schemars(range(min = 1))]
    pub number: Option<usize>,
    /// Share of the region's grains removed at random, rounded to whole grains.
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0))]
    pub share: Option<f64>,
    /// Seed of the choice. Equal seeds give equal bits.
    #[serde(default)]
    pub seed: u64,
}

/// Unit of the corners of a region.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RegionUnit {
    /// Shares of the specimen's sides.
    #[default]
    Side,
    /// Metres from the lower corner of the specimen.
    M,
}

impl Region {
    /// Checks every key.
    ///
    /// # Errors
    /// The key and the remedy.
    pub(super) fn validate(&self, dimension: usize) -> Result<(), DefinitionError> {
        let corners = self.from.iter().zip(&self.to);
        let are_sound = self.from.len() == dimension
            && self.to.len() == dimension
            && corners.clone().all(|(from, to)| from.is_finite() && to.is_finite() && from < to);
        if !are_sound {
            return Err(DefinitionError(format!(
                "from = {:?} and to = {:?} need {dimension} numbers each, from below to",
                self.from, self.to
            )));
        }
        match (self.number, self.share) {
            (Some(number), None) if number > 0 => Ok(()),
            (None, Some(share)) if share > 0.0 && share <= 1.0 => Ok(()),
            (Some(_), None) => Err(DefinitionError("number must be at least 1".into())),
            (None, Some(share)) => Err(DefinitionError(format!("share = {share} must be above 0 and at most 1"))),
            _ => Err(DefinitionError("give either number or share of the grains to be removed".into())),
        }
    }
}

/// The specimen without the grains that these regions lose, one region after the other, and without their contacts; the number of
/// grains removed is returned.
///
/// # Errors
/// A region that holds too few grains.
pub(super) fn weakened<S: SpecimenSpace>(
    mut assembled: Assembled<S>,
    regions: &[Region],
) -> Result<(Assembled<S>, usize), DefinitionError> {
    let before = assembled.grains.len();
    for (number, region) in regions.iter().enumerate() {
        let refuse = |reason: String| DefinitionError(format!("region {}: {reason}", number + 1));
        let inside: Vec<usize> =
            (0..assembled.grains.len()).filter(|grain| holds(region, &assembled, *grain)).collect();
        let count = match (region.number, region.share) {
            (Some(number), _) => number,
            (None, share) => (share.unwrap_or(0.0) * inside.len() as f64).round() as usize,
        };
        if count == 0 {
            return Err(refuse(format!(
                "its share of the {} grains in the box is less than half a grain; give a larger share or box, or number",
                inside.len()
            )));
        }
        if count > inside.len() || count >= assembled.grains.len() {
            return Err(refuse(format!(
                "{count} grains are to be removed, but the box holds {} of the specimen's {}, which must keep one",
                inside.len(),
                assembled.grains.len()
            )));
        }
        let removed: Vec<usize> = chosen(inside.len(), count, region.seed).into_iter().map(|k| inside[k]).collect();
        assembled = without(assembled, &removed);
    }
    let removed = before - assembled.grains.len();
    Ok((assembled, removed))
}

fn holds<S: SpecimenSpace>(region: &Region, assembled: &Assembled<S>, grain: usize) -> bool {
    let position = assembled.grains[grain].position;
    let box_of_axis = assembled.corner.iter().zip(&assembled.sides);
    let place = position.as_ref().iter().zip(box_of_axis).map(|(place, (corner, side))| match region.unit {
        RegionUnit::Side => (place - corner) / side,
        RegionUnit::M => place - corner,
    });
    place.zip(region.from.iter().zip(&region.to)).all(|(place, (from, to))| place >= *from && place < *to)
}

/// The others are numbered again, in order. `removed` is ascending.
fn without<S: SpecimenSpace>(assembled: Assembled<S>, removed: &[usize]) -> Assembled<S> {
    let mut numbers = vec![None; assembled.grains.len()];
    let mut grains = Vec::with_capacity(assembled.grains.len() - removed.len());
    for (grain, number) in numbers.iter_mut().enumerate() {
        if removed.binary_search(&grain).is_err() {
            *number = Some(grains.len() as u32);
            grains.push(assembled.grains[grain]);
        }
    }
    let renamed = |history: &History<S>| {
        let contact = &history.contact;
        let (origin, end) = (numbers[contact.origin as usize]?, numbers[contact.end as usize]?);
        Some(History { contact: ContactRecord { origin, end, ..*contact }, ..*history })
    };
    let histories = assembled.histories.iter().filter_map(renamed).collect();
    Assembled { grains, histories, ..assembled }
}

#[cfg(test)]
mod tests {
    use super::super::assembly::{joined_frames, tiled};
    use super::*;
    use crate::definition::PackingFile;
    use crate::space::Discs;
    use std::path::Path;

    fn region(from: [f64; 2], to: [f64; 2]) -> Region {
        let (from, to) = (from.to_vec(), to.to_vec());
        Region { from, to, unit: RegionUnit::Side, number: None, share: Some(0.2), seed: 5 }
    }

    fn specimen() -> Assembled<Discs> {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-100.json");
        tiled(&PackingFile::<Discs>::read(&file).unwrap(), &[2, 2], [true, true, false]).unwrap()
    }

    #[test]
    fn a_share_of_the_grains_in_the_box_goes_and_the_rest_keeps_its_order_and_contacts() {
        let whole = specimen();
        let band = region([0.0, 0.5], [1.0, 0.75]);
        let is_inside = |place: &[f64; 2]| (0.5..0.75).contains(&(place[1] / whole.sides[1]));
        let inside = whole.grains.iter().filter(|grain| is_inside(&grain.position)).count();
        let (weak, removed) = weakened(whole.clone(), std::slice::from_ref(&band)).unwrap();
        assert_eq!(removed, (0.2 * inside as f64).round() as usize);
        assert_eq!(weak.grains.len(), whole.grains.len() - removed);
        let mut left = whole.grains.iter();
        assert!(weak.grains.iter().all(|grain| left.any(|other| other == grain)), "the order stays");
        let gone = whole.grains.iter().filter(|grain| !weak.grains.contains(grain));
        assert!(gone.clone().count() == removed && gone.clone().all(|grain| is_inside(&grain.position)));
        let ends = |assembled: &Assembled<Discs>, history: &History<Discs>| {
            [history.contact.origin, history.contact.end].map(|grain| assembled.grains[grain as usize])
        };
        let kept =
            whole.histories.iter().filter(|history| !gone.clone().any(|grain| ends(&whole, history).contains(grain)));
        assert_eq!(
            kept.map(|history| (ends(&whole, history), history.moment)).collect::<Vec<_>>(),
            weak.histories.iter().map(|history| (ends(&weak, history), history.moment)).collect::<Vec<_>>()
        );
        assert_eq!(weakened(whole.clone(), std::slice::from_ref(&band)).unwrap().0, weak, "the same again");
        let other = Region { seed: 6, ..band };
        assert_ne!(weakened(whole, &[other]).unwrap().0, weak);
    }

    #[test]
    fn metres_are_metres_and_what_cannot_be_removed_is_refused() {
        let whole = specimen();
        let [width, height, _] = whole.sides;
        let shares = region([0.25, 0.25], [0.5, 0.5]);
        let corner = |share: f64| vec![share * width, share * height];
        let metres = Region { from: corner(0.25), to: corner(0.5), unit: RegionUnit::M, ..shares.clone() };
        assert_eq!(
            weakened(whole.clone(), &[metres]).unwrap(),
            weakened(whole.clone(), std::slice::from_ref(&shares)).unwrap()
        );
        let reason = |region: Region| weakened(specimen(), &[region]).unwrap_err().to_string();
        assert!(reason(Region { share: Some(1e-4), ..shares.clone() }).contains("less than half a grain"));
        assert!(reason(Region { share: None, number: Some(1000), ..shares.clone() }).contains("but the box holds"));
        assert!(reason(Region { share: Some(1.0), ..region([0.0, 0.0], [1.0, 1.0]) }).contains("must keep one"));
        let check = |region: &Region| region.validate(2).map_err(|error| error.to_string());
        assert!(check(&shares).is_ok());
        assert!(check(&Region { number: Some(3), ..shares.clone() }).unwrap_err().contains("either number or share"));
        assert!(check(&Region { share: Some(1.5), ..shares.clone() }).unwrap_err().contains("at most 1"));
        assert!(check(&Region { to: vec![0.5], ..shares }).unwrap_err().contains("need 2 numbers each"));
    }

    /// The corner grain of a frame lies at the origin of its regions, wherever the frame was cut.
    #[test]
    fn regions_of_frames_begin_at_their_corner() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-100.json");
        let whole = joined_frames(&PackingFile::<Discs>::read(&file).unwrap(), &[1, 1]).unwrap();
        let [x, y, _] = whole.corner;
        assert!(x.abs().max(y.abs()) > 0.01 * whole.sides[0], "the corner grain is not at the origin");
        let at_corner = region([-0.01, -0.01], [0.01, 0.01]);
        let metres = |share: f64| whole.sides[..2].iter().map(|side| share * side).collect();
        let in_metres = Region { from: metres(-0.01), to: metres(0.01), unit: RegionUnit::M, ..at_corner.clone() };
        for region in [at_corner, in_metres] {
            let region = Region { share: None, number: Some(1), ..region };
            let (weak, _) = weakened(whole.clone(), &[region]).unwrap();
            assert!(weak.grains.iter().all(|grain| grain.position != [x, y]));
        }
    }
}

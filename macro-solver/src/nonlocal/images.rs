//! Translations under which images of a periodic body may lie within the radius of an average.

use nalgebra::Vector3;

/// Difference, over the longest period, below which two translations are one and a period depends on others: as far as the nodes of
/// periodic faces may be away from the images of each other.
const RESOLUTION: f64 = 1e-6;

/// Length of a period, over the radius, below which it is none: ties between faces that lie on each other.
const SHORTEST: f64 = 1e-9;

/// A translation with the direction across the faces that it joins.
struct Period {
    shift: Vector3<f64>,
    normal: Vector3<f64>,
    /// Largest distance along the normal that an image may have from the body to be within the radius of it, m.
    reach: f64,
}

/// Zero and all combinations of the periods and their multiples that may lie within `radius` (m) of the points at `positions`, each once.
/// A period that is a combination of others, as that of two opposite corners, adds nothing. `None` if there may be more than `most`.
pub(super) fn images(
    periods: &[[f64; 3]],
    positions: &[[f64; 3]],
    radius: f64,
    most: usize,
) -> Option<Vec<[f64; 3]>> {
    let shifts: Vec<Vector3<f64>> =
        periods.iter().map(|&period| period.into()).filter(|shift| lasts(shift, radius)).collect();
    let longest = shifts.iter().map(Vector3::norm).fold(0.0, f64::max);
    let (independent, dependent) = split(&shifts, longest);
    let faces: Vec<Period> = (0..independent.len())
        .map(|own| period(independent[own], face_normal(&independent, own), positions, radius))
        .collect();
    let others: Vec<Period> =
        dependent.into_iter().map(|shift| period(shift, shift.normalize(), positions, radius)).collect();
    let times = |period: &Period| (period.reach / period.shift.dot(&period.normal)).floor();
    let count: f64 = faces.iter().chain(&others).map(|period| 2.0 * times(period) + 1.0).product();
    if count > most as f64 {
        return None;
    }
    let mut images = vec![Vector3::zeros()];
    for (number, period) in faces.iter().chain(&others).enumerate() {
        let may_repeat = number >= faces.len();
        for image in multiples(&images, period, times(period) as i64) {
            let is_near = faces.iter().all(|face| image.dot(&face.normal).abs() <= face.reach);
            let is_known =
                |image: &Vector3<f64>| images.iter().any(|known| (known - image).norm() <= RESOLUTION * longest);
            if is_near && !(may_repeat && is_known(&image)) {
                images.push(image);
            }
        }
    }
    Some(images.into_iter().map(Into::into).collect())
}

fn lasts(shift: &Vector3<f64>, radius: f64) -> bool {
    shift.norm() > SHORTEST * radius
}

/// The images moved by all multiples of a period up to `most`, forwards and backwards.
fn multiples(images: &[Vector3<f64>], period: &Period, most: i64) -> Vec<Vector3<f64>> {
    let times = (1..=most).flat_map(|times| [-times, times]);
    times.flat_map(|times| images.iter().map(move |image| image + times as f64 * period.shift)).collect()
}

/// The first periods that are independent of each other, and those that depend on them.
fn split(shifts: &[Vector3<f64>], longest: f64) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let (mut independent, mut dependent) = (Vec::new(), Vec::new());
    for &shift in shifts {
        let is_independent = beside(shift, &independent).norm() > RESOLUTION * longest;
        if is_independent { independent.push(shift) } else { dependent.push(shift) }
    }
    (independent, dependent)
}

/// Unit vector across the faces that one of independent periods joins: normal to all others. Faces of a skewed body are closer to each
/// other than their period is long.
fn face_normal(independent: &[Vector3<f64>], own: usize) -> Vector3<f64> {
    let others: Vec<Vector3<f64>> =
        independent.iter().enumerate().filter(|(other, _)| *other != own).map(|(_, shift)| *shift).collect();
    beside(independent[own], &others).normalize()
}

/// The part of a vector that is normal to all of these, which are independent of each other.
fn beside(vector: Vector3<f64>, others: &[Vector3<f64>]) -> Vector3<f64> {
    let mut directions: Vec<Vector3<f64>> = Vec::new();
    let mut rest = vector;
    for other in others {
        let direction = directions.iter().fold(*other, |rest, known| rest - known * known.dot(&rest)).normalize();
        rest -= direction * direction.dot(&rest);
        directions.push(direction);
    }
    rest
}

/// An image is within the radius of some point only if it has moved by less than the radius and the width of the body together.
fn period(shift: Vector3<f64>, normal: Vector3<f64>, positions: &[[f64; 3]], radius: f64) -> Period {
    let along = positions.iter().map(|&position| normal.dot(&Vector3::from(position)));
    let (least, most) =
        along.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), place| (least.min(place), most.max(place)));
    // Rounding must not lose an image.
    Period { shift, normal, reach: (1.0 + RESOLUTION) * (radius + (most - least).max(0.0)) }
}

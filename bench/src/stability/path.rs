//! Kinds of paths, and the segments that a case of a kind follows.

use super::random_stream::RandomStream;
use rve_server::programs::rve_test::{Components, Segment};

/// A kind of path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    /// Compression along one axis at constant volume.
    Isochoric,
    /// Compression along one axis, the others held.
    Oedometric,
    /// Simple shear at constant volume.
    Shear,
    /// Compression along one axis under constant lateral stress.
    Drained,
    /// Compression and back along the same path.
    Unloading,
    /// A few cycles of shear or compression.
    Cyclic,
    /// Expansion until no contact is left, and compression again.
    Recompression,
    /// Shear while the whole cell turns.
    Rotation,
    /// Shear so large that the cell is skewed and its lattice is reduced.
    Skewed,
    /// Increments over six decades of size in arbitrary directions.
    Decades,
    /// Expansion to the verge of jamming.
    Jamming,
    /// Many small cycles.
    LongCycles,
}

impl Kind {
    /// All kinds.
    pub(super) const ALL: [Self; 12] = [
        Self::Isochoric,
        Self::Oedometric,
        Self::Shear,
        Self::Drained,
        Self::Unloading,
        Self::Cyclic,
        Self::Recompression,
        Self::Rotation,
        Self::Skewed,
        Self::Decades,
        Self::Jamming,
        Self::LongCycles,
    ];

    /// Those of everyday use.
    pub(super) const EVERYDAY: [Self; 6] =
        [Self::Isochoric, Self::Oedometric, Self::Shear, Self::Drained, Self::Unloading, Self::Cyclic];

    /// Name on the command line and in tables.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Isochoric => "isochoric",
            Self::Oedometric => "oedometric",
            Self::Shear => "shear",
            Self::Drained => "drained",
            Self::Unloading => "unloading",
            Self::Cyclic => "cyclic",
            Self::Recompression => "recompression",
            Self::Rotation => "rotation",
            Self::Skewed => "skewed",
            Self::Decades => "decades",
            Self::Jamming => "jamming",
            Self::LongCycles => "long_cycles",
        }
    }
}

/// What a path is laid out for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Course {
    /// 2 or 3.
    pub(super) dimension: usize,
    /// Strain of one increment.
    pub(super) increment: f64,
    /// Number of increments.
    pub(super) count: u32,
    /// Pressure of the packing, Pa.
    pub(super) pressure: f64,
    /// Strain by which the packing is compressed elastically, roughly: pressure over stiffness.
    pub(super) slack: f64,
    /// Number of cycles of the kind that has many.
    pub(super) cycles: u32,
}

/// The segments of a path.
pub(super) fn segments(kind: Kind, course: &Course, stream: &mut RandomStream) -> Vec<Segment> {
    let Course { dimension, increment, count, .. } = *course;
    let axis = stream.below(dimension);
    let half = count.div_ceil(2);
    match kind {
        Kind::Isochoric => vec![repeated(isochoric(dimension, axis, -increment), count)],
        Kind::Oedometric => vec![repeated(stretched(axis, -increment), count)],
        Kind::Shear => vec![repeated(sheared(axis, (axis + 1) % dimension, stream.sign() * increment), count)],
        Kind::Drained => vec![drained(course, axis)],
        Kind::Unloading => {
            let there = if stream.chance(0.5) {
                |dimension, axis, strain| isochoric(dimension, axis, strain)
            } else {
                |_, axis, strain| stretched(axis, strain)
            };
            vec![
                repeated(there(dimension, axis, -increment), half),
                repeated(there(dimension, axis, increment), count - half),
            ]
        }
        Kind::Cyclic => cycles(course, axis, count.div_ceil(8), 2, stream),
        Kind::Recompression => {
            // Well past the last contact, and back to where the cell was.
            let part = (stream.between(1.2, 3.0) * course.slack).min(0.1) / f64::from(half);
            vec![
                repeated(isotropic(dimension, part), half),
                repeated(isotropic(dimension, -part / (1.0 + part)), half),
            ]
        }
        Kind::Rotation => vec![repeated(turning(dimension, axis, increment, stream), count)],
        Kind::Skewed => vec![repeated(sheared(axis, (axis + 1) % dimension, stream.sign() * increment), count)],
        Kind::Decades => {
            (0..count).map(|_| repeated(arbitrary(dimension, stream.decades(1e-8, 1e-2), stream), 1)).collect()
        }
        Kind::Jamming => {
            // The pressure falls with the slack left: some cases end just before, some beyond.
            let part = stream.between(0.5, 1.3) * course.slack / f64::from(half);
            let mut path = vec![repeated(isotropic(dimension, part), half)];
            path.push(repeated(sheared(axis, (axis + 1) % dimension, 0.1 * increment), count - half));
            path
        }
        Kind::LongCycles => cycles(course, axis, course.cycles, 1, stream),
    }
}

/// `cycles` of `steps` increments in one direction, twice as many back, and `steps` to where they began.
fn cycles(course: &Course, axis: usize, cycles: u32, steps: u32, stream: &mut RandomStream) -> Vec<Segment> {
    let Course { dimension, increment, .. } = *course;
    let is_shear = stream.chance(0.5);
    let strain = |amount: f64| {
        if is_shear { sheared(axis, (axis + 1) % dimension, amount) } else { isochoric(dimension, axis, amount) }
    };
    // Sheared forth and back in single increments, so that a reversal is exact in the gradient of every one of them.
    let mut path = Vec::new();
    for _ in 0..cycles {
        for (sign, count) in [(-1.0, steps), (1.0, 2 * steps), (-1.0, steps)] {
            path.push(repeated(strain(sign * increment), count));
        }
    }
    path
}

fn repeated(strain: Components, times: u32) -> Segment {
    Segment { increments: 1, repeat: times.max(1), strain, stress: Components::default() }
}

/// Compression along an axis in one segment, lateral stresses as they were.
fn drained(course: &Course, axis: usize) -> Segment {
    let mut stress = [[None; 3]; 3];
    for lateral in (0..course.dimension).filter(|lateral| *lateral != axis) {
        stress[lateral][lateral] = Some(-course.pressure);
    }
    Segment {
        increments: course.count,
        repeat: 1,
        strain: stretched(axis, -course.increment * f64::from(course.count)),
        stress: components(&stress),
    }
}

/// Elongation along one axis.
fn stretched(axis: usize, strain: f64) -> Components {
    let mut gradient = [[None; 3]; 3];
    gradient[axis][axis] = Some(strain);
    components(&gradient)
}

/// Elongation along one axis at constant volume: exactly, increment by increment.
fn isochoric(dimension: usize, axis: usize, strain: f64) -> Components {
    let lateral = (1.0 + strain).powf(-1.0 / (dimension as f64 - 1.0)) - 1.0;
    let mut gradient = [[None; 3]; 3];
    for place in 0..dimension {
        gradient[place][place] = Some(if place == axis { strain } else { lateral });
    }
    components(&gradient)
}

fn isotropic(dimension: usize, strain: f64) -> Components {
    let mut gradient = [[None; 3]; 3];
    for place in 0..dimension {
        gradient[place][place] = Some(strain);
    }
    components(&gradient)
}

fn sheared(along: usize, normal: usize, strain: f64) -> Components {
    let mut gradient = [[None; 3]; 3];
    gradient[along][normal] = Some(strain);
    components(&gradient)
}

/// `R (I + shear) - I` with a rotation of some degrees in the plane of the shear.
fn turning(dimension: usize, axis: usize, strain: f64, stream: &mut RandomStream) -> Components {
    let (first, second) = (axis, (axis + 1) % dimension);
    let angle = stream.sign() * stream.between(0.02, 0.3);
    let (sine, cosine) = angle.sin_cos();
    let mut gradient = [[None; 3]; 3];
    for place in 0..dimension {
        gradient[place][place] = Some(0.0);
    }
    // R = [[c, -s], [s, c]], and (I + shear) = [[1, strain], [0, 1]].
    gradient[first][first] = Some(cosine - 1.0);
    gradient[first][second] = Some(cosine * strain - sine);
    gradient[second][first] = Some(sine);
    gradient[second][second] = Some(cosine + sine * strain - 1.0);
    components(&gradient)
}

/// A gradient of a size in an arbitrary direction, mostly without change of volume.
fn arbitrary(dimension: usize, size: f64, stream: &mut RandomStream) -> Components {
    let mut gradient = [[None; 3]; 3];
    let mut trace = 0.0;
    for row in 0..dimension {
        for column in 0..dimension {
            let value = size * stream.between(-1.0, 1.0);
            gradient[row][column] = Some(value);
            trace += if row == column { value } else { 0.0 };
        }
    }
    for place in 0..dimension {
        gradient[place][place] = gradient[place][place].map(|value| value - 0.9 * trace / dimension as f64);
    }
    components(&gradient)
}

fn components(tensor: &[[Option<f64>; 3]; 3]) -> Components {
    let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = *tensor;
    Components { xx, xy, xz, yx, yy, yz, zx, zy, zz }
}

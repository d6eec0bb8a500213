//! The keys of `[pool]` that say who solves the Gauss points.

use super::document::Document;
use super::input_error::InputError;
use super::tables::{PoolRunKeys, PoolTable};
use keys::Given;
use macro_solver::material::difference::DifferencePlan;
use macro_solver::problem::Problem;
use std::collections::BTreeMap;

/// The table, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct EnginePlan {
    /// Engine of all points that `points` does not give to another.
    pub engine: String,
    /// Points of other engines: results then depend on this table, and on nothing else.
    pub points: BTreeMap<String, Vec<usize>>,
    /// How tangents are found for engines that have none.
    pub difference: DifferencePlan,
}

impl EnginePlan {
    pub(super) fn read(
        document: &Document,
        given: &Given<PoolTable>,
        keys: &PoolRunKeys,
        problem: &Problem,
    ) -> Result<Self, InputError> {
        let mut owner: BTreeMap<usize, &str> = BTreeMap::new();
        for (engine, points) in &keys.points {
            for (place, &number) in points.iter().enumerate() {
                let path = ["pool", "points", engine, &place.to_string()];
                if number >= problem.point_count() {
                    return Err(document
                        .error_at_key(&path, format!("there is no Gauss point {number}"))
                        .hint(format!("the mesh has the points 0 to {}", problem.point_count() - 1)));
                }
                if let Some(other) = owner.insert(number, engine) {
                    return Err(document
                        .error_at_key(&path, format!("Gauss point {number} is given to '{other}' and '{engine}'"))
                        .hint("leave it with one engine"));
                }
            }
        }
        let points = keys.points.iter().filter(|(_, points)| !points.is_empty());
        Ok(Self {
            engine: keys.engine.clone(),
            points: points.map(|(engine, points)| (engine.clone(), points.clone())).collect(),
            difference: given
                .over(&DifferencePlan::new(problem.mesh.dimension.count()))
                .map_err(|fault| document.fault(&fault))?,
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::Scene;
    use std::path::Path;

    /// Tangents by differences had no rows along z, whatever the mesh.
    #[test]
    fn differences_are_taken_along_all_axes_of_the_mesh() {
        for (scene, dimension) in [("biaxial-small", 2), ("single-hexahedron-shear", 3)] {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../scenes/{scene}.toml"));
            let scene = Scene::load(&path, &["pool.difference_reuses=2".to_owned()]).unwrap();
            assert_eq!((scene.engines.difference.dimension, scene.engines.difference.reuses), (dimension, 2));
        }
    }
}

//! The keys of `[pool]` that say who solves the Gauss points.

use super::document::Document;
use super::input_error::InputError;
use super::schema::PoolTable;
use crate::BUILT_IN_ENGINE;
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
    pub(super) fn read(document: &Document, table: &PoolTable, problem: &Problem) -> Result<Self, InputError> {
        let mut owner: BTreeMap<usize, &str> = BTreeMap::new();
        for (engine, points) in &table.points {
            for point in points {
                let number = *point.get_ref();
                if number >= problem.point_count() {
                    return Err(document
                        .error_at(point.span(), format!("there is no Gauss point {number}"))
                        .hint(format!("the mesh has the points 0 to {}", problem.point_count() - 1)));
                }
                if let Some(other) = owner.insert(number, engine) {
                    return Err(document
                        .error_at(point.span(), format!("Gauss point {number} is given to '{other}' and '{engine}'"))
                        .hint("leave it with one engine"));
                }
            }
        }
        let mut difference = DifferencePlan::new(2);
        if let Some(strain) = &table.difference_strain {
            difference.strain = *strain.get_ref();
            if !(difference.strain > 0.0 && difference.strain <= 0.01) {
                return Err(document
                    .error_at(strain.span(), format!("a probe of strain {} finds no tangent", difference.strain))
                    .hint("give a strain between 0 and 0.01, well above the noise of a relaxed cell: 1e-4"));
            }
        }
        if let Some(reuses) = &table.difference_reuses {
            difference.reuses = (*reuses.get_ref()).max(1);
        }
        Ok(Self {
            engine: table.engine.clone().unwrap_or_else(|| BUILT_IN_ENGINE.to_owned()),
            points: table
                .points
                .iter()
                .filter(|(_, points)| !points.is_empty())
                .map(|(engine, points)| (engine.clone(), points.iter().map(|point| *point.get_ref()).collect()))
                .collect(),
            difference,
        })
    }
}

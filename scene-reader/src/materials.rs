//! The packing of each Gauss point: the packing of the scene, or that of the last `[[region]]` that holds its element.

use super::document::Document;
use super::input_copy::InputCopy;
use super::input_error::InputError;
use super::packing::{packing_at, read_packing};
use super::sets::Sets;
use super::tables::{RegionTable, SceneFile, Vary};
use keys::Located;
use macro_solver::element::point_geometry;
use macro_solver::mesh::Mesh;
use protocol::ContentId;
use rve_server::definition::{AnyDefinition, Packing};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The definitions behind the points of a scene.
#[derive(Clone, Debug)]
pub struct Materials {
    /// What points can be made of; the first is the packing of the scene itself.
    pub definitions: Vec<AnyDefinition>,
    /// For each Gauss point the place of its definition.
    pub made_of: Vec<usize>,
    /// For each Gauss point the number of its `[[region]]`, if any.
    pub region_of: Vec<Option<usize>>,
    /// Packing files behind them.
    pub(super) files: Vec<InputCopy>,
    /// Kinds of cells of each region.
    kinds: Vec<usize>,
    /// One line per region, for people.
    pub remarks: Vec<String>,
}

impl Materials {
    /// Identity of everything that the points are made of.
    pub fn identity(&self) -> String {
        let ids: Vec<String> =
            self.definitions.iter().map(|definition| definition.to_protocol().id().to_string()).collect();
        match &ids[..] {
            [only] => only.clone(),
            _ => {
                let made_of: Vec<String> = self.made_of.iter().map(usize::to_string).collect();
                ContentId::of(format!("{} {}", ids.join(" "), made_of.join(" ")).as_bytes()).to_string()
            }
        }
    }

    /// Dimension of the cells: 2 for discs, 3 for spheres.
    pub fn cell_dimension(&self) -> usize {
        match self.definitions[0] {
            AnyDefinition::Discs(_) => 2,
            AnyDefinition::Spheres(_) => 3,
        }
    }

    /// Mass densities of the body, voids included.
    pub fn densities(&self, mesh: &Mesh) -> Densities {
        let packing = self.definitions[0].bulk_density();
        // A turned packing weighs the same but for rounding.
        let rounded = |density: f64| if (density / packing - 1.0).abs() < 1e-9 { packing } else { density };
        let of_kind: Vec<f64> =
            self.definitions.iter().map(|definition| rounded(definition.bulk_density())).collect();
        let starts = mesh.first_points();
        let of_element = |element: usize| {
            let kinds = &self.made_of[starts[element]..starts[element + 1]];
            match kinds {
                // The same bits for elements of one kind.
                [first, rest @ ..] if rest.iter().all(|kind| kind == first) => of_kind[*first],
                kinds => mean(&point_volumes(mesh, element), kinds.iter().map(|&kind| of_kind[kind])),
            }
        };
        let by_element: Vec<f64> = (0..mesh.elements.len()).map(of_element).collect();
        let differ = by_element.iter().any(|density| *density != packing);
        Densities { packing, by_element: if differ { by_element } else { Vec::new() } }
    }

    /// One line per region, with the elements that later ones have left to it.
    fn describe(&mut self, file: &SceneFile, mesh: &Mesh) {
        let starts = &mesh.first_points()[..mesh.elements.len()];
        for (number, region) in file.region.iter().enumerate() {
            let elements = starts.iter().filter(|&&point| self.region_of[point] == Some(number)).count();
            let kinds = match self.kinds[number] {
                1 => "one kind of cell".to_owned(),
                count => format!("{count} kinds of cells"),
            };
            self.remarks.push(format!("{}: {elements} elements, {kinds}", region.get_ref().name));
        }
    }

    /// The elements that have cells of each region, by its name; regions whose elements later ones take are left out.
    pub(super) fn elements_of_regions(&self, file: &SceneFile, mesh: &Mesh) -> BTreeMap<String, Vec<usize>> {
        let mut elements: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (element, &point) in mesh.first_points()[..mesh.elements.len()].iter().enumerate() {
            if let Some(number) = self.region_of[point] {
                elements.entry(file.region[number].get_ref().name.clone()).or_default().push(element);
            }
        }
        elements
    }
}

/// Mass per volume of the body, voids included, kg/m3.
#[derive(Clone, Debug, PartialEq)]
pub struct Densities {
    /// Of the packing of the scene itself.
    pub packing: f64,
    /// Of every element, the mean over its Gauss points by their volumes; empty where all have that of the packing.
    pub by_element: Vec<f64>,
}

/// Volumes of the Gauss points of an element, m3, in the plane m2.
fn point_volumes(mesh: &Mesh, element: usize) -> Vec<f64> {
    let (kind, positions) = (mesh.kinds[element], mesh.element_positions(element));
    (0..kind.point_count()).map(|local| point_geometry(kind, &positions, local).volume).collect()
}

/// Mean of values with these weights.
fn mean(weights: &[f64], values: impl Iterator<Item = f64>) -> f64 {
    let sum: f64 = weights.iter().zip(values).map(|(weight, value)| weight * value).sum();
    sum / weights.iter().sum::<f64>()
}

/// Reads all packings and gives every point its own.
///
/// # Errors
/// A packing or region that cannot be used, with its place.
pub(super) fn materials(
    document: &Document,
    file: &SceneFile,
    sets: &Sets<'_>,
    base: AnyDefinition,
) -> Result<Materials, InputError> {
    let copy = InputCopy { key: "packing".into(), name: "packing.json".into(), text: base.packing_json() };
    let mut materials = Materials {
        made_of: vec![0; sets.mesh.point_count()],
        region_of: vec![None; sets.mesh.point_count()],
        definitions: vec![base],
        files: vec![copy],
        kinds: Vec::new(),
        remarks: Vec::new(),
    };
    for (number, region) in file.region.iter().enumerate() {
        let region = Region { document, file, sets, table: region, number };
        region.add_to(&mut materials)?;
    }
    materials.describe(file, sets.mesh);
    Ok(materials)
}

/// One `[[region]]`.
struct Region<'a> {
    document: &'a Document,
    file: &'a SceneFile,
    sets: &'a Sets<'a>,
    table: &'a Located<RegionTable>,
    number: usize,
}

impl Region<'_> {
    fn add_to(&self, materials: &mut Materials) -> Result<(), InputError> {
        let table = self.table.get_ref();
        let before = || self.file.region[..self.number].iter().map(|other| other.get_ref());
        if table.name.is_empty() || before().any(|other| other.name == table.name) {
            return Err(self.error("every region needs a name of its own").hint("give it another `name`"));
        }
        let elements = self.elements()?;
        let variants = self.variants(materials)?;
        let (first, count) = (materials.definitions.len(), variants.len());
        materials.definitions.extend(variants);
        let seed = match table.seed {
            Some(seed) => seed,
            None if count == 1 => 0,
            None => {
                return Err(self
                    .error("several packings or rotations need a seed")
                    .hint("add for example seed = 1; equal seeds give equal materials"));
            }
        };
        let starts = self.sets.mesh.first_points();
        for &element in &elements {
            for point in starts[element]..starts[element + 1] {
                let sampled = if table.vary == Vary::Element { element } else { point };
                materials.made_of[point] = first + drawn(seed, sampled as u64, count);
                materials.region_of[point] = Some(self.number);
            }
        }
        materials.kinds.push(count);
        Ok(())
    }

    fn error(&self, problem: impl ToString) -> InputError {
        self.document
            .error_at(self.table.span(), format!("region '{}': {}", self.table.get_ref().name, problem.to_string()))
    }

    fn elements(&self) -> Result<Vec<usize>, InputError> {
        let table = self.table.get_ref();
        let mesh = self.sets.mesh;
        let elements: Vec<usize> = match (&table.elements, &table.from, &table.to) {
            (Some(set), None, None) => mesh.element_sets[&self.sets.element_set(self.document, set)?].clone(),
            (None, Some(from), Some(to)) => {
                let axes = mesh.dimension.count();
                if from.len() != axes || to.len() != axes {
                    return Err(self.error(format!("a box needs {axes} coordinates in `from` and in `to`")));
                }
                let within = |place: [f64; 3]| (0..axes).all(|axis| (from[axis]..=to[axis]).contains(&place[axis]));
                (0..mesh.elements.len()).filter(|&element| within(centre(mesh, element))).collect()
            }
            (Some(_), ..) => {
                return Err(self
                    .error("its elements are given twice, by a set and by a box")
                    .hint("remove `elements`, or `from` and `to`"));
            }
            _ => {
                return Err(self
                    .error("its elements are not given")
                    .hint("name an element set with `elements`, or the corners `from` and `to` of a box"));
            }
        };
        if elements.is_empty() {
            return Err(self
                .error("no element lies in it")
                .hint("an element belongs to the box that holds its centre"));
        }
        Ok(elements)
    }

    /// Every packing of the region in every rotation.
    fn variants(&self, materials: &mut Materials) -> Result<Vec<AnyDefinition>, InputError> {
        let table = self.table.get_ref();
        let contact = table.contact.as_ref().unwrap_or(&self.file.contact);
        let mut variants = Vec::new();
        for packing in self.packings(materials)? {
            let packing = match &table.removal {
                Some(removal) => {
                    let made = packing.weakened(contact, removal).map_err(|error| self.error(error))?;
                    if made.came_to_rest_first {
                        materials.remarks.push(format!(
                            "region '{}': a packing is far from rest under its law; its stress is the one to which it came to rest",
                            table.name
                        ));
                    }
                    made.packing
                }
                None => packing,
            };
            for angle in &table.rotations {
                let packing = packing.rotated(angle.to_radians()).map_err(|error| self.error(error))?;
                let definition = AnyDefinition::new(packing, contact.clone(), self.file.rve.clone());
                variants.push(definition.validate().map_err(|error| self.error(error))?);
            }
        }
        match variants.is_empty() {
            true => Err(self.error("it has no rotation, and so no cell").hint("leave out `rotations`")),
            false => Ok(variants),
        }
    }

    fn packings(&self, materials: &mut Materials) -> Result<Vec<Packing>, InputError> {
        let table = self.table.get_ref();
        if table.packings.is_empty() {
            return Ok(vec![read_packing(self.document, &self.file.packing)?]);
        }
        let mut packings = Vec::new();
        for (place, written) in table.packings.iter().enumerate() {
            let packing = self.read(written)?;
            if packing.dimension() != materials.definitions[0].dimension() {
                return Err(self
                    .document
                    .error_at(written.span(), "discs and spheres cannot be mixed in one run")
                    .hint("take packings of the same dimension as the one at the top of the scene"));
            }
            let text = match &packing {
                Packing::Discs(packing) => packing.to_json(),
                Packing::Spheres(packing) => packing.to_json(),
            };
            let (number, name) = (self.number, format!("packings/{}-{place}.json", self.number));
            materials.files.push(InputCopy { key: format!("region.{number}.packings.{place}"), name, text });
            packings.push(packing);
        }
        Ok(packings)
    }

    fn read(&self, written: &Located<PathBuf>) -> Result<Packing, InputError> {
        let path: &Path = written.get_ref();
        let path = self.document.resolve(path);
        packing_at(&path).map_err(|error| {
            self.document
                .error_at(written.span(), error)
                .hint("correct the path, which is relative to the scene's folder, or the packing file")
        })
    }
}

/// Mean of the nodes of an element, m.
fn centre(mesh: &Mesh, element: usize) -> [f64; 3] {
    let places = mesh.element_positions(element);
    std::array::from_fn(|axis| places.iter().map(|place| place[axis]).sum::<f64>() / places.len() as f64)
}

/// A random number below `count` for a number, by SplitMix64: the choice for one number depends on no other.
pub fn drawn(seed: u64, number: u64, count: usize) -> usize {
    let mut bits = seed.wrapping_add(number.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^= bits >> 31;
    ((u128::from(bits) * count as u128) >> 64) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Scene, weak_element as scene};
    use macro_solver::mesh::ElementKind;
    use macro_solver::problem::Procedure;

    #[test]
    fn samples_are_even_and_follow_the_seed() {
        let draw = |seed| (0..3000).map(|number| drawn(seed, number, 3)).collect::<Vec<_>>();
        let counts = |lots: &[usize]| [0, 1, 2].map(|lot| lots.iter().filter(|&&one| one == lot).count());
        assert!(counts(&draw(1)).iter().all(|count| (900..1100).contains(count)), "{:?}", counts(&draw(1)));
        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1), draw(2));
        assert!((0..100).all(|number| drawn(9, number, 1) == 0));
    }

    #[test]
    fn regions_sample_rotated_and_weakened_cells() {
        let scene = scene(&[]).unwrap();
        let materials = &scene.materials;
        // The scene's packing, three rotations of it, and the weakened cell of one element, which the last region names.
        assert_eq!(materials.definitions.len(), 5);
        let weak: Vec<usize> = (0..32).filter(|&point| materials.made_of[point] == 4).collect();
        assert_eq!(weak, [8, 9, 10, 11], "the four points of one element");
        assert_eq!(materials.definitions[4].number(), 95);
        let kinds = [0, 1, 2, 3].map(|kind| materials.made_of.iter().filter(|&&one| one == kind).count());
        assert!(kinds[0] == 0 && kinds[1..].iter().all(|&count| count > 2), "{kinds:?}");
        assert_eq!(materials.remarks.len(), 2);
        assert_ne!(materials.identity(), scene_with_seed(2).materials.identity());
    }

    fn scene_with_seed(seed: u64) -> Scene {
        scene(&[&format!("region.0.seed={seed}")]).unwrap()
    }

    /// A region of lighter cells weighs less in motion; a density that the scene gives holds for all.
    #[test]
    fn elements_in_motion_weigh_what_their_cells_do() {
        let stages =
            "stage=[{ name = 'still' }, { name = 'swing', procedure = 'dynamic', loading = { duration = 1e-3 } }]";
        let densities = |more: &[&str]| {
            let scene = scene(&[&[stages], more].concat()).unwrap();
            let Procedure::Dynamic(settings) = &scene.problem.stages[1].procedure else { panic!("it is dynamic") };
            (settings.density, settings.element_densities.clone())
        };
        let (whole, by_element) = densities(&[]);
        assert_eq!(by_element.len(), 8);
        let weak: Vec<usize> = (0..8).filter(|&element| by_element[element] < 0.99 * whole).collect();
        assert_eq!(weak, [2], "five of a hundred grains are missing there: {by_element:?}");
        assert!(by_element[2] > 0.9 * whole && by_element[0] == whole);
        assert_eq!(densities(&["dynamics.density=1800.0"]), (1800.0, Vec::new()));
    }

    /// A trapezium of 3 m2 whose lower points, of larger volume, are heavier: the element weighs what its points do together.
    #[test]
    fn points_of_an_element_count_by_their_volume() {
        let nodes = vec![[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = Mesh::uniform(ElementKind::Q4, nodes, vec![vec![0, 1, 2, 3]]);
        let volumes = point_volumes(&mesh, 0);
        assert!((volumes.iter().sum::<f64>() - 3.0).abs() < 1e-14);
        let mut materials = scene(&[]).unwrap().materials;
        materials.made_of = volumes.iter().map(|&volume| if volume > 0.75 { 0 } else { 4 }).collect();
        let [heavy, light] = [0, 4].map(|kind: usize| materials.definitions[kind].bulk_density());
        // The points lie at the heights (1 -+ 1/sqrt(3)) / 2, where the trapezium is 4 - 2 y wide.
        let share = 0.5 + 1.0 / (6.0 * 3.0_f64.sqrt());
        let expected = share * heavy + (1.0 - share) * light;
        let found = materials.densities(&mesh).by_element[0];
        assert!((found / expected - 1.0).abs() < 1e-14, "{found} {expected}");
    }

    /// Elements of a region are a set for loads and friction, without those that a later region takes; a set of the mesh keeps its name.
    #[test]
    fn regions_are_element_sets() {
        let weights = "body_force=[{ set = 'varied', value = { y = -2e4 } }, { set = 'weak', value = { y = -1e4 } }]";
        let sets = scene(&["region.0.name=varied", weights]).unwrap().problem.mesh.element_sets;
        assert_eq!((&sets["varied"][..], &sets["weak"][..]), (&[0, 1, 3, 4, 5, 6, 7][..], &[2][..]));
        let sets = scene(&["region.0.name=all"]).unwrap().problem.mesh.element_sets;
        assert_eq!(sets["all"].len(), 8);
        let refused = scene(&["region.0.name=varied", "body_force=[{ set = 'none', value = { y = -2e4 } }]"]);
        assert!(refused.unwrap_err().contains("use one of: all, varied"));
    }

    #[test]
    fn defects_of_regions_have_their_place_and_remedy() {
        let reason = |more: &str| scene(&[more]).unwrap_err();
        assert!(reason("region.0.elements=core").contains("no element set 'core'"));
        assert!(reason("region.1.from=[9.0, 9.0]").contains("no element lies in it"));
        assert!(reason("region.1.from=[0.0]").contains("2 coordinates"));
        assert!(reason("region.0.rotations=[]").contains("leave out `rotations`"));
        assert!(reason("region.1.removal.number=50").contains("a quarter of the 100"));
        assert!(reason("region.0.packings=[\"none.json\"]").contains("none.json"));
    }
}

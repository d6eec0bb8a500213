//! `[mesh]` becomes a mesh: generated, or read from a file of Gmsh.

use super::document::Document;
use super::input_copy::InputCopy;
use super::input_error::InputError;
use super::tables::{Generator, MeshTable};
use keys::Located;
use macro_solver::mesh::block::Block;
use macro_solver::mesh::geotechnical::{HalfFooting, RetainingWall, Section, Slope};
use macro_solver::mesh::ring::{Ring, RingPart};
use macro_solver::mesh::{ElementKind, Mesh, gmsh};
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// Most elements that a generator makes: with grains behind their points they take hundreds of gigabytes.
const MOST_ELEMENTS: f64 = 1e6;

/// Bytes that the states of an element take: four points, two states of 400 discs each.
const STATE_OF_AN_ELEMENT: f64 = 4.0 * 2.0 * 6e4;

/// The mesh of a scene, and its file as it goes along with a run unless it is generated.
///
/// # Errors
/// A number that is missing, superfluous or impossible, a file that cannot be read or is not usable.
pub(super) fn mesh(document: &Document, table: &Located<MeshTable>) -> Result<(Mesh, Option<InputCopy>), InputError> {
    let keys = table.get_ref();
    match &keys.file {
        Some(file) => from_file(document, keys, file).map(|(mesh, copy)| (mesh, Some(copy))),
        None => generated(document, table).map(|mesh| (mesh, None)),
    }
}

fn generated(document: &Document, table: &Located<MeshTable>) -> Result<Mesh, InputError> {
    let keys = table.get_ref();
    let generator = keys.generator.as_ref().map_or(Generator::Block, |generator| *generator.get_ref());
    let numbers = Numbers { document, table, kind: keys.element.unwrap_or(ElementKind::Q8) };
    if let Some(run) = &keys.run
        && generator != Generator::Slope
    {
        return Err(document.error_at(run.span(), "`run` belongs to generator = \"slope\"").hint("remove `run`"));
    }
    if let Some(angle) = &keys.angle
        && generator != Generator::Ring
    {
        return Err(document
            .error_at(angle.span(), "`angle` belongs to generator = \"ring\"")
            .hint("remove `angle`"));
    }
    let mesh = match generator {
        Generator::Ring => numbers.ring()?.mesh(),
        Generator::Block => numbers.block()?.mesh(),
        Generator::Slope => numbers.slope()?.mesh(),
        Generator::Footing => numbers.footing()?.mesh(),
        Generator::Wall => numbers.wall()?.mesh(),
    };
    mesh.map_err(|error| document.error_at(table.span(), error).hint("docs/reference/scene.md describes [mesh]"))
}

fn from_file(
    document: &Document,
    keys: &MeshTable,
    file: &Located<PathBuf>,
) -> Result<(Mesh, InputCopy), InputError> {
    let spans = [
        ("generator", keys.generator.as_ref().map(Located::span)),
        ("size", keys.size.as_ref().map(Located::span)),
        ("elements", keys.elements.as_ref().map(Located::span)),
        ("grading", keys.grading.as_ref().map(Located::span)),
        ("run", keys.run.as_ref().map(Located::span)),
        ("angle", keys.angle.as_ref().map(Located::span)),
    ];
    if let Some((key, span)) = spans.into_iter().find_map(|(key, span)| Some((key, span?))) {
        let problem = format!("`{key}` belongs to a generated mesh, but `file` names one that is read");
        return Err(document.error_at(span, problem).hint(format!("remove `{key}` or `file`")));
    }
    let path = document.resolve(file.get_ref());
    let refuse = |problem: String, hint: &str| document.error_at(file.span(), problem).hint(hint);
    let bytes = std::fs::read(&path).map_err(|source| {
        refuse(format!("could not read {}: {source}", path.display()), "the path is relative to this file's folder")
    })?;
    // A binary file says so in its second line, which is text.
    let text = String::from_utf8_lossy(&bytes);
    let mesh = gmsh::read(&text, keys.element)
        .map_err(|error| refuse(place(&path, error.line, &error.problem), &error.remedy))?;
    if let Some(kind) = keys.element.filter(|kind| !mesh.kinds.contains(kind)) {
        let found: Vec<&str> = mesh.kinds_present().into_iter().map(ElementKind::keyword).collect();
        let problem =
            format!("the file has no element that could be a `{}`: it has {}", kind.keyword(), found.join(", "));
        return Err(refuse(problem, "remove `element`, or save a mesh of that order and shape"));
    }
    let copy = InputCopy { key: "mesh.file".into(), name: "mesh.msh".into(), text: text.into_owned() };
    Ok((mesh, copy))
}

fn place(path: &Path, line: usize, problem: &str) -> String {
    format!("{}:{line}: {problem}", path.display())
}

/// The numbers of a generator, checked against what it needs.
struct Numbers<'a> {
    document: &'a Document,
    table: &'a Located<MeshTable>,
    kind: ElementKind,
}

impl Numbers<'_> {
    fn is_solid(&self) -> bool {
        self.kind.dimension().count() == 3
    }

    fn block(&self) -> Result<Block, InputError> {
        let names = if self.is_solid() { &["x", "y", "z"][..] } else { &["x", "y"] };
        let (size, elements, grading) = self.sections(names)?;
        Ok(Block {
            size: padded(&size, 0.0),
            elements: padded(&elements, 0),
            grading: padded(&grading, 1.0),
            kind: self.kind,
        })
    }

    fn slope(&self) -> Result<Slope, InputError> {
        let [body, toe, base, rise, thickness] = self.named_sections(["body", "toe", "base", "rise"])?;
        let keys = self.table.get_ref();
        let Some(run) = &keys.run else {
            let problem = "generator = \"slope\" lacks `run`, the horizontal extent of the face";
            return Err(self.document.error_at(self.table.span(), problem).hint("add for example run = 5.0, in m"));
        };
        if !(*run.get_ref() >= 0.0 && *run.get_ref() < body.length) {
            let problem = format!("a face of {} m does not fit on a body of {} m", run.get_ref(), body.length);
            return Err(self.document.error_at(run.span(), problem).hint("give 0 or more, less than the first size"));
        }
        Ok(Slope { body, toe, base, rise, run: *run.get_ref(), thickness, kind: self.kind })
    }

    fn footing(&self) -> Result<HalfFooting, InputError> {
        let [footing, beside, depth, thickness] =
            self.named_sections(["half width of the footing", "surface next to it", "depth"])?;
        Ok(HalfFooting { footing, beside, depth, thickness, kind: self.kind })
    }

    fn wall(&self) -> Result<RetainingWall, InputError> {
        let [width, below, wall, thickness] = self.named_sections(["width", "below", "wall"])?;
        Ok(RetainingWall { width, below, wall, thickness, kind: self.kind })
    }

    fn ring(&self) -> Result<Ring, InputError> {
        let [inner, outer, thickness] = self.named_sections(["inner radius", "outer radius"])?;
        let keys = self.table.get_ref();
        if outer.length <= inner.length {
            let problem = format!("a ring from {} m to {} m has no thickness", inner.length, outer.length);
            return Err(self.at(&keys.size, problem).hint("give the inner radius, then the larger outer one"));
        }
        let part = match keys.angle.as_ref().map(|angle| *angle.get_ref()) {
            None | Some(90.0) => RingPart::Quarter,
            Some(180.0) => RingPart::Half,
            Some(360.0) => RingPart::Whole,
            Some(other) => {
                let problem = format!("a ring of {other} degrees is not made");
                return Err(self.at(&keys.angle, problem).hint("give 90, 180 or 360"));
            }
        };
        let graded_around = outer.grading != 1.0;
        if graded_around {
            let problem = "a ring is even around";
            return Err(self.at(&keys.grading, problem.into()).hint("give 1 as its second grading"));
        }
        Ok(Ring {
            inner: inner.length,
            across: Section { length: outer.length - inner.length, cells: inner.cells, grading: inner.grading },
            around: outer.cells,
            part,
            thickness,
            kind: self.kind,
        })
    }

    /// The sections of the plane and, last, the one along z, which solid elements need.
    fn named_sections<const N: usize, const M: usize>(&self, plane: [&str; N]) -> Result<[Section; M], InputError> {
        let mut names = plane.to_vec();
        if self.is_solid() {
            names.push("z");
        }
        let (size, elements, grading) = self.sections(&names)?;
        Ok(std::array::from_fn(|number| match size.get(number) {
            Some(&length) => Section { length, cells: elements[number], grading: grading[number] },
            None => Section::even(1.0, 1),
        }))
    }

    /// `size`, `elements` and `grading` with one entry for each name.
    fn sections(&self, names: &[&str]) -> Result<(Vec<f64>, Vec<usize>, Vec<f64>), InputError> {
        let keys = self.table.get_ref();
        let size = self.exactly(&keys.size, "size", names)?;
        let elements = self.exactly(&keys.elements, "elements", names)?;
        let grading = match &keys.grading {
            None => vec![1.0; names.len()],
            given => self.exactly(given, "grading", names)?,
        };
        if !size.iter().all(|length| *length > 0.0) {
            let problem = format!("a mesh of {} m turns its elements inside out", join(&size));
            return Err(self.at(&keys.size, problem).hint("give positive lengths in m"));
        }
        if elements.contains(&0) {
            let problem = format!("a mesh of {} elements is empty", join(&elements));
            return Err(self.at(&keys.elements, problem).hint("give at least one element each"));
        }
        self.refuse_absurd(&elements)?;
        if !grading.iter().all(|ratio| *ratio > 0.0) {
            let hint = "give the length of the last element over that of the first, above 0; 1 spaces evenly";
            return Err(self
                .at(&keys.grading, format!("a grading of {} is not possible", join(&grading)))
                .hint(hint));
        }
        Ok((size, elements, grading))
    }

    /// Refuses a mesh before it is built that no machine could hold the grains of.
    fn refuse_absurd(&self, elements: &[usize]) -> Result<(), InputError> {
        let product = |factors: &[f64]| factors.iter().product::<f64>();
        let counts: Vec<f64> = elements.iter().map(|count| *count as f64).collect();
        let is_block = matches!(
            self.table.get_ref().generator.as_ref().map(|one| *one.get_ref()),
            None | Some(Generator::Block | Generator::Ring)
        );
        let (plane, depth) = counts.split_at(counts.len() - usize::from(self.is_solid()));
        // Sections lie beside and above one another: as many as a square of half their sum holds, at most.
        let most =
            if is_block { product(&counts) } else { (plane.iter().sum::<f64>() / 2.0).powi(2) * product(depth) };
        if most <= MOST_ELEMENTS {
            return Ok(());
        }
        let states = most * STATE_OF_AN_ELEMENT / 1e12;
        let problem = format!("a mesh of {} elements is {most:.1e} elements", join(elements));
        Err(self.at(&self.table.get_ref().elements, problem).hint(format!(
            "their grains would take some {states:.0} TB of memory; at most {MOST_ELEMENTS:.0e} elements are made"
        )))
    }

    fn exactly<T: Clone>(
        &self,
        values: &Option<Located<Vec<T>>>,
        key: &str,
        names: &[&str],
    ) -> Result<Vec<T>, InputError> {
        let hint = format!("give one entry for each of {}", names.join(", "));
        let Some(values) = values else {
            let problem = format!("[mesh] lacks `{key}`");
            return Err(self.document.error_at(self.table.span(), problem).hint(hint));
        };
        let found = values.get_ref().len();
        if found != names.len() {
            let generator =
                self.table.get_ref().generator.as_ref().map_or(Generator::Block, |given| *given.get_ref());
            let problem = format!(
                "`{key}` has {found} entries, but generator = \"{}\" with \"{}\" elements needs {}",
                generator.keyword(),
                self.kind.keyword(),
                names.len()
            );
            return Err(self.document.error_at(values.span(), problem).hint(hint));
        }
        Ok(values.get_ref().clone())
    }

    fn at<T>(&self, value: &Option<Located<T>>, problem: String) -> InputError {
        let span = value.as_ref().map_or(self.table.span(), Located::span);
        self.document.error_at(span, problem)
    }
}

fn padded<T: Copy>(values: &[T], filler: T) -> [T; 3] {
    std::array::from_fn(|axis| values.get(axis).copied().unwrap_or(filler))
}

fn join(values: &[impl Display]) -> String {
    values.iter().map(ToString::to_string).collect::<Vec<_>>().join(" x ")
}

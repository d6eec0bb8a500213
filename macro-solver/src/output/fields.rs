//! Fields on the finite-element mesh as `.vtu`, and the `.pvd` that strings them into a film for ParaView.

use super::{OutputError, write_without_flush};
use crate::mesh::ElementKind;
use std::fs::OpenOptions;
use std::io::ErrorKind;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use vtkio::model::{
    Attribute, Attributes, ByteOrder, Cells, DataSet, UnstructuredGridPiece, Version, VertexNumbers, Vtk,
};

/// Named numbers, `components` per node or cell: 1 scalar, 3 vector, 9 tensor row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Name shown in ParaView.
    pub name: String,
    /// Numbers per entry.
    pub components: usize,
    /// All entries, one after the other.
    pub values: Vec<f64>,
}

impl Field {
    /// One number per entry.
    pub fn scalar(name: &str, values: Vec<f64>) -> Self {
        Self { name: name.to_owned(), components: 1, values }
    }

    /// Vectors.
    pub fn vector(name: &str, values: &[[f64; 3]]) -> Self {
        Self { name: name.to_owned(), components: 3, values: values.as_flattened().to_vec() }
    }

    /// Tensors, row by row.
    pub fn tensor(name: &str, values: &[protocol::Tensor2]) -> Self {
        let values = values.iter().flat_map(|tensor| tensor.0).collect();
        Self { name: name.to_owned(), components: 9, values }
    }
}

/// Nodes and elements of one `.vtu` file, which may be deformed.
#[derive(Clone, Copy, Debug)]
pub struct FieldGrid<'a> {
    /// Node positions, m.
    pub nodes: &'a [[f64; 3]],
    /// Node numbers of every element, in the order of its kind, which is that of VTK.
    pub elements: &'a [Vec<usize>],
    /// Kind of every element.
    pub kinds: &'a [ElementKind],
}

/// Writes one `.vtu` with fields on nodes and on elements.
///
/// # Errors
/// [`OutputError::Encode`] when a field does not fit the mesh or an element does not have the nodes of its kind;
/// [`OutputError::Write`].
pub fn write_grid(
    path: &Path,
    grid: FieldGrid<'_>,
    on_nodes: &[Field],
    on_elements: &[Field],
) -> Result<(), OutputError> {
    let mut connectivity = Vec::new();
    let mut offsets = Vec::new();
    let mut types = Vec::new();
    if grid.kinds.len() != grid.elements.len() {
        return Err(OutputError::encode(path, "elements and element kinds differ in number"));
    }
    for (element, &kind) in grid.elements.iter().zip(grid.kinds) {
        if element.len() != kind.node_count() {
            return Err(OutputError::encode(path, format!("a {kind:?} with {} nodes", element.len())));
        }
        types.push(kind.interpolation().vtk);
        connectivity.extend(element.iter().map(|&node| node as u64));
        offsets.push(connectivity.len() as u64);
    }
    let attributes = |fields: &[Field], entries: usize| {
        fields.iter().map(|field| as_attribute(path, field, entries)).collect::<Result<Vec<_>, _>>()
    };
    let piece = UnstructuredGridPiece {
        points: grid.nodes.as_flattened().to_vec().into(),
        cells: Cells { cell_verts: VertexNumbers::XML { connectivity, offsets }, types },
        data: Attributes {
            point: attributes(on_nodes, grid.nodes.len())?,
            cell: attributes(on_elements, grid.elements.len())?,
        },
    };
    write_without_flush(path, &encode_vtk(path, DataSet::inline(piece))?)
}

pub(super) fn as_attribute(path: &Path, field: &Field, entries: usize) -> Result<Attribute, OutputError> {
    if field.values.len() != entries * field.components {
        let (found, wanted) = (field.values.len(), entries * field.components);
        return Err(OutputError::encode(path, format!("field {} has {found} numbers, not {wanted}", field.name)));
    }
    let attribute = match field.components {
        3 => Attribute::vectors(field.name.as_str()),
        9 => Attribute::tensors(field.name.as_str()),
        components => Attribute::scalars(field.name.as_str(), components as u32),
    };
    Ok(attribute.with_data(field.values.clone()))
}

pub(super) fn encode_vtk(path: &Path, data: DataSet) -> Result<Vec<u8>, OutputError> {
    let file = Vtk {
        version: Version::XML { major: 1, minor: 0 },
        title: String::new(),
        byte_order: ByteOrder::LittleEndian,
        data,
        file_path: None,
    };
    let mut bytes = Vec::new();
    file.write_xml(&mut bytes).map_err(|reason| OutputError::encode(path, reason))?;
    Ok(bytes)
}

/// The frames written so far and the `.pvd` that lists them.
#[derive(Debug)]
pub struct FieldSeries {
    path: PathBuf,
    frames: Vec<(f64, String)>,
    /// Length of the file without its end, bytes, once this series has written it.
    listed_to: Option<u64>,
}

/// Beginning and end of a `.pvd`.
const BEGIN: &str = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\">\n<Collection>\n";
const END: &str = "</Collection>\n</VTKFile>\n";

impl FieldSeries {
    /// A series with no frames; nothing is written yet.
    pub fn new(path: &Path) -> Self {
        Self { path: path.to_owned(), frames: Vec::new(), listed_to: None }
    }

    /// Adds a frame (its file relative to the `.pvd`, its time in s) to the list.
    ///
    /// # Errors
    /// [`OutputError::Write`].
    pub fn add(&mut self, time: f64, file: String) -> Result<(), OutputError> {
        self.frames.push((time, file));
        let Some(listed_to) = self.listed_to else { return self.write() };
        // In place of the end, in one write: a list of thousands of frames is not written again for each.
        let added = self.frames.last().map(entry).unwrap_or_default();
        let file = match OpenOptions::new().write(true).open(&self.path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return self.write(),
            opened => opened,
        };
        file.and_then(|file| file.write_all_at((added.clone() + END).as_bytes(), listed_to))
            .map_err(|source| OutputError::write(&self.path, source))?;
        self.listed_to = Some(listed_to + added.len() as u64);
        Ok(())
    }

    /// The frames so far.
    pub fn frames(&self) -> &[(f64, String)] {
        &self.frames
    }

    /// The frames that the text of a `.pvd` file of this program lists, in order: time, s, and file relative to the `.pvd`. Lines that
    /// list none are passed over, as in a file that is not whole.
    pub fn listed(text: &str) -> Vec<(f64, String)> {
        let value = |line: &str, key: &str| {
            let (_, rest) = line.split_once(&format!(" {key}=\""))?;
            Some(rest.split_once('"')?.0.to_owned())
        };
        let frame = |line: &str| Some((value(line, "timestep")?.parse().ok()?, value(line, "file")?));
        text.lines().filter(|line| line.starts_with("<DataSet ")).filter_map(frame).collect()
    }

    /// Goes on behind the frames of an earlier process. The list is rewritten, or removed if there are none: it may name frames after the
    /// checkpoint.
    ///
    /// # Errors
    /// [`OutputError::Write`].
    pub fn restore(&mut self, frames: Vec<(f64, String)>) -> Result<(), OutputError> {
        (self.frames, self.listed_to) = (frames, None);
        if !self.frames.is_empty() {
            return self.write();
        }
        match std::fs::remove_file(&self.path) {
            Err(source) if source.kind() != ErrorKind::NotFound => Err(OutputError::write(&self.path, source)),
            _ => Ok(()),
        }
    }

    fn write(&mut self) -> Result<(), OutputError> {
        let text = BEGIN.to_owned() + &self.frames.iter().map(entry).collect::<String>();
        write_without_flush(&self.path, (text.clone() + END).as_bytes())?;
        self.listed_to = Some(text.len() as u64);
        Ok(())
    }
}

/// A frame in the list.
fn entry((time, file): &(f64, String)) -> String {
    format!("<DataSet timestep=\"{time:e}\" part=\"0\" file=\"{file}\"/>\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::Tensor2;

    /// Every kind's natural element with a displacement and a stress that no symmetry hides.
    #[test]
    fn elements_of_every_kind_and_their_fields_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let values = |attribute: &Attribute| match attribute {
            Attribute::DataArray(array) => array.data.cast_into::<f64>().unwrap(),
            Attribute::Field { .. } => panic!("expected an array"),
        };
        let stress = Tensor2([-1.0, 0.5, 0.1, 0.4, -2.0, 0.2, 0.3, 0.6, -3.0]);
        for kind in ElementKind::ALL {
            let path = folder.path().join("step-0001.vtu");
            let nodes = crate::element::node_places(kind).to_vec();
            let elements = vec![(0..nodes.len()).collect::<Vec<_>>()];
            let displacement: Vec<[f64; 3]> = nodes.iter().map(|&[x, y, z]| [0.1 * x, -0.2 * y, z]).collect();
            let grid = FieldGrid { nodes: &nodes, elements: &elements, kinds: &[kind] };
            let on_elements = [Field::tensor("stress", &[stress]), Field::scalar("void ratio", vec![0.2])];
            write_grid(&path, grid, &[Field::vector("displacement", &displacement)], &on_elements).unwrap();

            let DataSet::UnstructuredGrid { pieces, .. } = Vtk::import(&path).unwrap().data else {
                panic!("not an unstructured grid")
            };
            let piece = pieces[0].load_piece_data(None).unwrap();
            assert_eq!(piece.cells.types, vec![kind.interpolation().vtk]);
            assert_eq!(piece.num_points(), nodes.len());
            assert_eq!(values(&piece.data.point[0]), displacement.as_flattened());
            assert_eq!(values(&piece.data.cell[0]), stress.0);
            assert_eq!(piece.data.cell[1].name(), "void ratio");
        }
    }

    #[test]
    fn fields_that_do_not_fit_and_incomplete_elements_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bad.vtu");
        let nodes = crate::element::node_places(ElementKind::Q8).to_vec();
        let elements = vec![(0..8).collect::<Vec<_>>()];
        let grid = FieldGrid { nodes: &nodes, elements: &elements, kinds: &[ElementKind::Q8] };
        let error = write_grid(&path, grid, &[Field::scalar("short", vec![0.0; 7])], &[]).unwrap_err();
        assert!(error.to_string().contains("field short has 7 numbers, not 8"), "{error}");
        assert!(write_grid(&path, FieldGrid { kinds: &[ElementKind::T3], ..grid }, &[], &[]).is_err());
        assert!(write_grid(&path, FieldGrid { kinds: &[], ..grid }, &[], &[]).is_err());
        assert!(!path.exists());
    }

    #[test]
    fn the_series_lists_its_frames_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fields.pvd");
        let mut series = FieldSeries::new(&path);
        series.add(0.0, "fields/step-0000.vtu".to_owned()).unwrap();
        series.add(0.5, "fields/step-0001.vtu".to_owned()).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let first = text.find("step-0000").unwrap();
        assert!(first < text.find("timestep=\"5e-1\" part=\"0\" file=\"fields/step-0001").unwrap());
    }

    #[test]
    fn what_a_series_has_written_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fields.pvd");
        let mut series = FieldSeries::new(&path);
        for (step, time) in [0.0, 0.1 + 0.2, 1.234_567_890_123_456_7e-300].into_iter().enumerate() {
            series.add(time, format!("fields/step-{step:04}.vtu")).unwrap();
        }
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(FieldSeries::listed(&text), series.frames());
        let again = folder.path().join("again.pvd");
        FieldSeries::new(&again).restore(series.frames().to_vec()).unwrap();
        assert_eq!(std::fs::read_to_string(&again).unwrap(), text);
        let cut = text.find("step-0002").unwrap();
        assert_eq!(FieldSeries::listed(&text[..cut]), series.frames()[..2]);
        assert_eq!(FieldSeries::listed(""), []);
    }
}

//! Fields on the finite-element mesh as `.vtu`, and the `.pvd` that strings them into a film for ParaView.

use super::{OutputError, write_atomically};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use vtkio::model::{
    Attribute, Attributes, ByteOrder, CellType, Cells, DataSet, UnstructuredGridPiece, Version, VertexNumbers, Vtk,
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

    /// Plane vectors; ParaView wants three components.
    pub fn plane_vector(name: &str, values: &[[f64; 2]]) -> Self {
        let values = values.iter().flat_map(|&[x, y]| [x, y, 0.0]).collect();
        Self { name: name.to_owned(), components: 3, values }
    }

    /// Tensors, row by row.
    pub fn tensor(name: &str, values: &[protocol::Tensor2]) -> Self {
        let values = values.iter().flat_map(|tensor| tensor.0).collect();
        Self { name: name.to_owned(), components: 9, values }
    }
}

/// A plane mesh of quadrilaterals as it is drawn.
#[derive(Clone, Copy, Debug)]
pub struct FieldGrid<'a> {
    /// Node positions, m.
    pub nodes: &'a [[f64; 2]],
    /// Node numbers of every element: 4 corners counter-clockwise, or 4 corners and then the 4 mid-side nodes that
    /// follow them (side 0-1, 1-2, 2-3, 3-0).
    pub elements: &'a [Vec<usize>],
}

/// Writes one `.vtu` with fields on nodes and on elements.
///
/// # Errors
/// [`OutputError::Encode`] when a field does not fit the mesh or an element is neither Q4 nor Q8;
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
    for element in grid.elements {
        types.push(match element.len() {
            4 => CellType::Quad,
            8 => CellType::QuadraticQuad,
            count => return Err(OutputError::encode(path, format!("an element with {count} nodes"))),
        });
        connectivity.extend(element.iter().map(|&node| node as u64));
        offsets.push(connectivity.len() as u64);
    }
    let attributes = |fields: &[Field], entries: usize| {
        fields.iter().map(|field| as_attribute(path, field, entries)).collect::<Result<Vec<_>, _>>()
    };
    let piece = UnstructuredGridPiece {
        points: grid.nodes.iter().flat_map(|&[x, y]| [x, y, 0.0]).collect::<Vec<f64>>().into(),
        cells: Cells { cell_verts: VertexNumbers::XML { connectivity, offsets }, types },
        data: Attributes {
            point: attributes(on_nodes, grid.nodes.len())?,
            cell: attributes(on_elements, grid.elements.len())?,
        },
    };
    write_atomically(path, &encode_vtk(path, DataSet::inline(piece))?)
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
}

impl FieldSeries {
    /// A series with no frames; nothing is written yet.
    pub fn new(path: &Path) -> Self {
        Self { path: path.to_owned(), frames: Vec::new() }
    }

    /// Adds a frame (its file relative to the `.pvd`, its time in s) and rewrites the list.
    ///
    /// # Errors
    /// [`OutputError::Write`].
    pub fn add(&mut self, time: f64, file: String) -> Result<(), OutputError> {
        self.frames.push((time, file));
        self.write()
    }

    /// The frames so far.
    pub fn frames(&self) -> &[(f64, String)] {
        &self.frames
    }

    /// Goes on behind the frames of an earlier process; the list is rewritten if there are any.
    ///
    /// # Errors
    /// [`OutputError::Write`].
    pub fn restore(&mut self, frames: Vec<(f64, String)>) -> Result<(), OutputError> {
        self.frames = frames;
        if self.frames.is_empty() { Ok(()) } else { self.write() }
    }

    fn write(&self) -> Result<(), OutputError> {
        let mut text =
            String::from("<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\">\n<Collection>\n");
        for (time, file) in &self.frames {
            writeln!(text, "<DataSet timestep=\"{time:e}\" part=\"0\" file=\"{file}\"/>")
                .expect("writing to a String cannot fail");
        }
        text.push_str("</Collection>\n</VTKFile>\n");
        write_atomically(&self.path, text.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::Tensor2;

    fn one_q8() -> (Vec<[f64; 2]>, Vec<Vec<usize>>) {
        let nodes =
            vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.0], [1.0, 0.5], [0.5, 1.0], [0.0, 0.5]];
        (nodes, vec![(0..8).collect()])
    }

    #[test]
    fn a_quadratic_element_and_its_fields_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("step-0001.vtu");
        let (nodes, elements) = one_q8();
        let displacement: Vec<[f64; 2]> = nodes.iter().map(|&[x, y]| [0.1 * x, -0.2 * y]).collect();
        let stress = Tensor2::from_plane([[-1.0, 0.5], [0.5, -2.0]]);
        write_grid(
            &path,
            FieldGrid { nodes: &nodes, elements: &elements },
            &[Field::plane_vector("displacement", &displacement)],
            &[Field::tensor("stress", &[stress]), Field::scalar("void ratio", vec![0.2])],
        )
        .unwrap();

        let DataSet::UnstructuredGrid { pieces, .. } = Vtk::import(&path).unwrap().data else {
            panic!("not an unstructured grid")
        };
        let piece = pieces[0].load_piece_data(None).unwrap();
        assert_eq!(piece.cells.types, vec![CellType::QuadraticQuad]);
        assert_eq!(piece.num_points(), 8);
        let values = |attribute: &Attribute| match attribute {
            Attribute::DataArray(array) => array.data.cast_into::<f64>().unwrap(),
            Attribute::Field { .. } => panic!("expected an array"),
        };
        assert_eq!(values(&piece.data.point[0])[3..6], [0.1, 0.0, 0.0]);
        assert_eq!(values(&piece.data.cell[0]), stress.0);
        assert_eq!(piece.data.cell[1].name(), "void ratio");
    }

    #[test]
    fn fields_that_do_not_fit_and_unknown_elements_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bad.vtu");
        let (nodes, elements) = one_q8();
        let grid = FieldGrid { nodes: &nodes, elements: &elements };
        let error = write_grid(&path, grid, &[Field::scalar("short", vec![0.0; 7])], &[]).unwrap_err();
        assert!(error.to_string().contains("field short has 7 numbers, not 8"), "{error}");
        let triangle = [vec![0, 1, 2]];
        assert!(write_grid(&path, FieldGrid { nodes: &nodes, elements: &triangle }, &[], &[]).is_err());
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
}

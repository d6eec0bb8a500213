//! Straight lines as `.vtp`, for example the contacts of a cell, with named numbers for each line.

use super::fields::{as_attribute, encode_vtk};
use super::{Field, OutputError, write_without_flush};
use std::path::Path;
use vtkio::model::{Attributes, DataSet, PolyDataPiece, VertexNumbers};

/// Writes lines from point to point, m; each field has one entry per line.
///
/// # Errors
/// [`OutputError::Encode`] when a field's length does not fit; [`OutputError::Write`].
pub fn write_lines(path: &Path, lines: &[[[f64; 3]; 2]], fields: &[Field]) -> Result<(), OutputError> {
    let cell = fields.iter().map(|field| as_attribute(path, field, lines.len())).collect::<Result<Vec<_>, _>>()?;
    let count = lines.len() as u64;
    let piece = PolyDataPiece {
        points: lines.as_flattened().as_flattened().to_vec().into(),
        lines: Some(VertexNumbers::XML {
            connectivity: (0..2 * count).collect(),
            offsets: (1..=count).map(|line| 2 * line).collect(),
        }),
        data: Attributes { point: Vec::new(), cell },
        ..PolyDataPiece::default()
    };
    write_without_flush(path, &encode_vtk(path, DataSet::inline(piece))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use vtkio::Vtk;

    #[test]
    fn lines_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("contacts.vtp");
        let lines = [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [[1.0, 0.0, 0.0], [1.0, 2.0, 0.0]]];
        write_lines(&path, &lines, &[Field::scalar("normal_force", vec![-3.0, -4.0])]).unwrap();
        let DataSet::PolyData { pieces, .. } = Vtk::import(&path).unwrap().data else { panic!("not poly data") };
        let piece = pieces[0].load_piece_data(None).unwrap();
        assert_eq!(piece.points.cast_into::<f64>().unwrap(), lines.as_flattened().as_flattened());
        assert_eq!(piece.lines.unwrap().num_cells(), 2);
        assert_eq!(piece.data.cell[0].name(), "normal_force");
        assert!(write_lines(&path, &lines, &[Field::scalar("too_short", vec![1.0])]).is_err());
    }
}

//! Round particles of one Gauss point as `.vtp`: a cloud of points with named numbers, to be drawn with glyphs.

use super::fields::{as_attribute, encode_vtk};
use super::{Field, OutputError, write_without_flush};
use std::path::Path;
use vtkio::model::{Attributes, DataSet, PolyDataPiece, VertexNumbers};

/// Writes a point cloud. Centres in m; each field has one entry per centre.
///
/// # Errors
/// [`OutputError::Encode`] when a field's length does not fit; [`OutputError::Write`].
pub fn write_particles(path: &Path, centres: &[[f64; 3]], fields: &[Field]) -> Result<(), OutputError> {
    let point = fields.iter().map(|field| as_attribute(path, field, centres.len())).collect::<Result<Vec<_>, _>>()?;
    let count = centres.len() as u64;
    let piece = PolyDataPiece {
        points: centres.as_flattened().to_vec().into(),
        verts: Some(VertexNumbers::XML { connectivity: (0..count).collect(), offsets: (1..=count).collect() }),
        data: Attributes { point, cell: Vec::new() },
        ..PolyDataPiece::default()
    };
    write_without_flush(path, &encode_vtk(path, DataSet::inline(piece))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use vtkio::Vtk;

    #[test]
    fn particles_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("point-0007.vtp");
        let centres = [[0.25, 0.5, 0.0], [1.0, -2.0, 0.5]];
        write_particles(&path, &centres, &[Field::scalar("radius", vec![0.1, 0.2])]).unwrap();
        let DataSet::PolyData { pieces, .. } = Vtk::import(&path).unwrap().data else { panic!("not poly data") };
        let piece = pieces[0].load_piece_data(None).unwrap();
        assert_eq!(piece.points.cast_into::<f64>().unwrap(), centres.as_flattened());
        assert_eq!(piece.verts.unwrap().num_cells(), 2);
        assert_eq!(piece.data.point[0].name(), "radius");
    }
}

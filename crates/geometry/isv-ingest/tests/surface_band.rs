//! The blocks that the surfaces of captures need.

mod support;

use isv_ingest::{MeshIngest, SignMode, decide_sign, ingest_mesh};
use isv_surface::{SurfaceOptions, extract_surface, surface_band};
use isv_volume::{BlockEdge, Grid, Truncation, VoxelSize};

#[test]
fn meshes_of_captures_do_not_change() {
    for (name, edge) in [("dancer", BlockEdge::E8), ("dancer", BlockEdge::E4), ("flag", BlockEdge::E16)] {
        let Some(mesh) = support::load(name, 0) else { return };
        let settings = MeshIngest::new(Grid {
            voxel_size: VoxelSize::from_metres(0.005).unwrap(),
            edge,
            truncation: Truncation::DEFAULT,
        });
        let volume = ingest_mesh(&mesh, &settings, decide_sign(&mesh, SignMode::Paper).0).unwrap();
        let band = surface_band(&volume);
        println!("{name}, {edge:?}: {} of {} blocks", band.block_count(), volume.block_count());
        let options = SurfaceOptions { normals: true };
        assert!(extract_surface(&band, &options) == extract_surface(&volume, &options));
        assert!(band.block_count() < volume.block_count());
    }
}

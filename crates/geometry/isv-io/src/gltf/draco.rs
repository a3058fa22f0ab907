//! Meshes compressed by Draco: `KHR_draco_mesh_compression`.

use super::fault::GltfFault;
use super::limit::Limit;
use crate::error::quote;
use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use isv_foreign::catch_panic;

/// Bytes of a vertex's position, or of a triangle.
const ELEMENT_BYTES: usize = 12;

/// A Draco stream, decoded.
pub(super) struct DracoMesh {
    mesh: Mesh,
}

impl DracoMesh {
    /// Decodes a stream, to no more than the limit allows.
    pub(super) fn decode(source: &[u8], limit: &Limit) -> Result<Self, GltfFault> {
        let left = limit.decompressed_left();
        let most = left / ELEMENT_BYTES as u64;
        let limits =
            DecodeLimits::default().with_max_points(most).with_max_faces(most).with_max_decoded_bytes(left);
        let decoded = catch_panic(|| {
            let mut mesh = Mesh::new();
            let mut buffer = DecoderBuffer::new(source).with_limits(limits);
            MeshDecoder::new().decode(&mut buffer, &mut mesh).map(|()| mesh)
        });
        let mesh = match decoded {
            Some(Ok(mesh)) => mesh,
            Some(Err(error)) => return Err(failed(quote(error.to_string().as_bytes()))),
            None => return Err(failed("it is damaged".to_owned())),
        };
        limit.take_decompressed(mesh.num_faces().saturating_add(mesh.num_points()), ELEMENT_BYTES)?;
        Ok(Self { mesh })
    }

    /// The values of an attribute for every vertex, as numbers that are not normalised yet.
    pub(super) fn floats<const N: usize>(
        &self,
        attribute: u32,
        limit: &Limit,
    ) -> Result<Vec<[f32; N]>, GltfFault> {
        let count = self.mesh.num_attributes().max(0) as usize;
        let found = self.mesh.attribute_by_unique_id(attribute);
        let found =
            found.ok_or(GltfFault::NoSuch { kind: "Draco attribute", index: attribute as usize, count })?;
        let components = found.num_components();
        if usize::from(components) != N {
            return Err(failed(format!(
                "attribute {attribute} has {components} numbers where {N} are needed"
            )));
        }
        let points = self.mesh.num_points();
        limit.take(points, N)?;
        let values = catch_panic(|| found.read_f32s(points, N));
        let values = values.ok_or_else(|| failed("it is damaged".to_owned()))?;
        Ok(values.as_chunks().0.to_vec())
    }

    /// The corners of all triangles.
    pub(super) fn corners(&self) -> Vec<u32> {
        self.mesh.faces().iter().flatten().map(|point| point.0).collect()
    }
}

fn failed(why: String) -> GltfFault {
    GltfFault::Compressed { codec: "Draco", why }
}

//! Meshes to volumes on whatever there is.

use crate::{GpuError, GpuIngestError, GpuMeshIngester, VolumeStore};
use isv_ingest::{MeshIngest, MeshIngester, SignDecision};
use isv_volume::{SparseVolume, TriangleMesh};

/// A [`MeshIngester`] on the CPU or one on a GPU. If a GPU fails, it can go on on the CPU.
pub struct AnyMeshIngester {
    settings: MeshIngest,
    ingester: Inner,
    /// Why the GPU was given up, until somebody asks.
    notice: Option<GpuError>,
}

enum Inner {
    Cpu(Box<MeshIngester>),
    Gpu { ingester: Box<GpuMeshIngester>, falls_back: bool },
}

impl Inner {
    fn on_cpu(settings: MeshIngest) -> Self {
        Self::Cpu(Box::new(MeshIngester::new(settings)))
    }
}

impl AnyMeshIngester {
    /// An ingester on the CPU.
    #[must_use]
    pub fn on_cpu(settings: MeshIngest) -> Self {
        Self { settings, ingester: Inner::on_cpu(settings), notice: None }
    }

    /// An ingester on a GPU. `falls_back`: whether it goes on on the CPU if the GPU fails.
    ///
    /// # Errors
    /// As [`GpuMeshIngester::new`].
    pub fn on_gpu(settings: MeshIngest, store: &VolumeStore, falls_back: bool) -> Result<Self, GpuError> {
        let ingester = Box::new(GpuMeshIngester::new(store, settings)?);
        Ok(Self { settings, ingester: Inner::Gpu { ingester, falls_back }, notice: None })
    }

    /// How meshes become volumes.
    #[must_use]
    pub fn settings(&self) -> &MeshIngest {
        &self.settings
    }

    /// The volume of the next frame.
    ///
    /// # Errors
    /// As [`isv_ingest::ingest_mesh`], and what goes wrong on a GPU, if it does not go on on the CPU.
    pub fn ingest(
        &mut self,
        mesh: &TriangleMesh,
        sign: SignDecision,
    ) -> Result<SparseVolume, GpuIngestError> {
        let error = match &mut self.ingester {
            Inner::Cpu(ingester) => return Ok(ingester.ingest(mesh, sign)?),
            Inner::Gpu { ingester, falls_back } => match ingester.ingest(mesh, sign) {
                Err(GpuIngestError::Gpu(error)) if *falls_back => error,
                volume => return volume,
            },
        };
        (self.ingester, self.notice) = (Inner::on_cpu(self.settings), Some(error));
        self.ingest(mesh, sign)
    }

    /// Why it turned from the GPU to the CPU, if it has since this was last asked.
    pub fn take_notice(&mut self) -> Option<GpuError> {
        self.notice.take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{gpu_alone, grid};
    use isv_ingest::ingest_mesh;
    use isv_testkit::sphere;

    const CLOSED: SignDecision = SignDecision::Closed { flipped: false };

    #[test]
    fn a_lost_gpu_hands_over_to_the_cpu() {
        let Some(gpu) = gpu_alone() else { return };
        let (store, settings) = (VolumeStore::new(&gpu).unwrap(), MeshIngest::new(grid()));
        let mesh = sphere(0.03, 12);
        let expected = ingest_mesh(&mesh, &settings, CLOSED).unwrap();
        let [mut strict, mut auto] =
            [false, true].map(|falls_back| AnyMeshIngester::on_gpu(settings, &store, falls_back).unwrap());
        let on_gpu = auto.ingest(&mesh, CLOSED).unwrap();
        assert!(auto.take_notice().is_none() && on_gpu.coords() == expected.coords());
        gpu.lose();
        assert!(matches!(strict.ingest(&mesh, CLOSED), Err(GpuIngestError::Gpu(GpuError::Lost(_)))));
        assert!(auto.ingest(&mesh, CLOSED).unwrap() == expected);
        assert!(matches!(auto.take_notice(), Some(GpuError::Lost(_))));
        assert!(auto.take_notice().is_none());
    }
}

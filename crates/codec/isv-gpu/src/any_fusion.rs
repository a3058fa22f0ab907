//! Depth fusion on whatever there is.

use crate::{Gpu, GpuError, GpuFusion};
use isv_fusion::{Accumulator, FusionError, FusionSettings, fuse, fuse_on};
use isv_volume::{DepthImage, SparseVolume};

/// [`isv_fusion::fuse`] on the CPU or on a GPU. If a GPU fails, it can go on on the CPU with the same images.
#[derive(Debug)]
pub struct AnyFusion {
    fusion: Inner,
    /// Why the GPU was given up, until somebody asks.
    notice: Option<FusionError>,
}

#[derive(Debug)]
enum Inner {
    Cpu,
    Gpu { fusion: Box<GpuFusion>, falls_back: bool },
}

impl AnyFusion {
    /// Fusion on the CPU.
    #[must_use]
    pub fn on_cpu() -> Self {
        Self { fusion: Inner::Cpu, notice: None }
    }

    /// Fusion on a GPU. `falls_back`: whether it goes on on the CPU if the GPU fails.
    ///
    /// # Errors
    /// As [`GpuFusion::new`].
    pub fn on_gpu(gpu: &Gpu, falls_back: bool) -> Result<Self, GpuError> {
        let fusion = Box::new(GpuFusion::new(gpu)?);
        Ok(Self { fusion: Inner::Gpu { fusion, falls_back }, notice: None })
    }

    /// Fuses the images of one instant into a volume.
    ///
    /// # Errors
    /// See [`FusionError`]; [`FusionError::Backend`] if it does not go on on the CPU.
    pub fn fuse(
        &mut self,
        images: &[DepthImage],
        settings: &FusionSettings,
    ) -> Result<SparseVolume, FusionError> {
        let error = match &mut self.fusion {
            Inner::Cpu => return fuse(images, settings),
            Inner::Gpu { fusion, falls_back } => match fuse_on(&mut **fusion, images, settings) {
                Err(error @ FusionError::Backend(_)) if *falls_back => error,
                volume => return volume,
            },
        };
        (self.fusion, self.notice) = (Inner::Cpu, Some(error));
        fuse(images, settings)
    }

    /// Why it turned from the GPU to the CPU, if it has since this was last asked.
    pub fn take_notice(&mut self) -> Option<FusionError> {
        self.notice.take()
    }
}

/// An [`Accumulator`] on the CPU or on a GPU. It cannot go from one to the other: what a GPU has summed up is lost with it.
#[derive(Debug)]
pub enum AnyAccumulator {
    /// On the CPU.
    Cpu(Accumulator),
    /// On a GPU.
    Gpu(Box<Accumulator<GpuFusion>>),
}

impl AnyAccumulator {
    /// An accumulator on the CPU that has seen nothing.
    #[must_use]
    pub fn on_cpu(settings: FusionSettings) -> Self {
        Self::Cpu(Accumulator::new(settings))
    }

    /// An accumulator on a GPU that has seen nothing.
    ///
    /// # Errors
    /// As [`GpuFusion::new`].
    pub fn on_gpu(gpu: &Gpu, settings: FusionSettings) -> Result<Self, GpuError> {
        Ok(Self::Gpu(Box::new(Accumulator::on(GpuFusion::new(gpu)?, settings))))
    }

    /// Adds the images of one instant.
    ///
    /// # Errors
    /// As [`Accumulator::integrate`].
    pub fn integrate(&mut self, images: &[DepthImage]) -> Result<(), FusionError> {
        match self {
            Self::Cpu(accumulator) => accumulator.integrate(images),
            Self::Gpu(accumulator) => accumulator.integrate(images),
        }
    }

    /// The volume of all that was seen so far.
    ///
    /// # Errors
    /// [`FusionError::Backend`].
    pub fn volume(&mut self) -> Result<SparseVolume, FusionError> {
        match self {
            Self::Cpu(accumulator) => Ok(accumulator.volume()),
            Self::Gpu(accumulator) => accumulator.try_volume(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{gpu_alone, gpu_for_tests, grid};
    use glam::{DMat4, DVec2};
    use isv_volume::{CameraPose, Intrinsics};

    /// A wall 1 m away.
    fn wall() -> DepthImage {
        let (focal, principal) = (DVec2::splat(50.0), DVec2::new(15.5, 11.5));
        let lens = Intrinsics { width: 32, height: 24, focal, principal };
        DepthImage::new(lens, CameraPose::from_matrix(DMat4::IDENTITY).unwrap(), vec![1.0; 32 * 24]).unwrap()
    }

    #[test]
    fn a_lost_gpu_hands_over_to_the_cpu_within_a_frame() {
        let Some(gpu) = gpu_alone() else { return };
        let (wall, settings) = ([wall()], FusionSettings::new(grid()));
        let mut fusion = AnyFusion::on_gpu(&gpu, true).unwrap();
        let mut strict = AnyFusion::on_gpu(&gpu, false).unwrap();
        // Images that cannot be fused are no fault of the GPU.
        let none = FusionSettings { max_depth_m: 0.5, ..settings };
        assert!(matches!(fusion.fuse(&wall, &none), Err(FusionError::NoReading { .. })));
        for lost in [false, true, true] {
            if lost {
                gpu.lose();
            }
            let before = matches!(fusion.fusion, Inner::Cpu);
            assert!(fusion.fuse(&wall, &settings).unwrap().block_count() > 0);
            assert_eq!(fusion.take_notice().is_some(), lost && !before);
        }
        assert!(matches!(strict.fuse(&wall, &settings), Err(FusionError::Backend(_))));
    }

    #[test]
    fn an_accumulator_is_the_same_on_both() {
        let Some(gpu) = gpu_for_tests() else { return };
        let settings = FusionSettings::new(grid());
        let both = [AnyAccumulator::on_cpu(settings), AnyAccumulator::on_gpu(&gpu, settings).unwrap()];
        let [cpus, ours] = both.map(|mut accumulator| {
            assert_eq!(accumulator.volume().unwrap().block_count(), 0);
            accumulator.integrate(&[wall()]).unwrap();
            accumulator.volume().unwrap()
        });
        assert!(cpus.block_count() > 0 && cpus.coords() == ours.coords());
    }
}

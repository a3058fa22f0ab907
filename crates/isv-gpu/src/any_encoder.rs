//! An encoder on whatever there is.

use crate::{GpuBackend, GpuError, GpuMotionSearch, GpuVolume, VolumeStore};
use isv_decode::BackendError;
use isv_encode::{EncodedFrame, Encoder, EncoderSettings, MainEncoder, PaperEncoder};
use isv_format::{Profile, StreamHeader};
use isv_volume::{BlockEdge, SparseVolume};

/// An [`Encoder`] on the CPU or on a GPU, where in profile `main` motion is searched for. If a GPU fails, it can go on with a
/// keyframe on the CPU.
#[derive(Debug)]
pub struct AnyEncoder {
    header: StreamHeader,
    settings: EncoderSettings,
    encoder: Inner,
    /// Why the GPU was given up, until somebody asks.
    notice: Option<BackendError>,
}

#[derive(Debug)]
enum Inner {
    Cpu(Box<Encoder>),
    Gpu { encoder: GpuEncoder, falls_back: bool },
}

/// An encoder of each profile.
#[derive(Debug)]
enum GpuEncoder {
    Paper(Box<PaperEncoder<GpuBackend>>),
    Main(Box<MainEncoder<GpuMotionSearch>>),
}

impl GpuEncoder {
    fn new(header: &StreamHeader, settings: EncoderSettings, store: &VolumeStore) -> Result<Self, GpuError> {
        if header.grid.edge != BlockEdge::E8 {
            return Err(GpuError::Unsupported("blocks of another edge than 8 voxels"));
        }
        Ok(match &header.profile {
            Profile::Paper(paper) => {
                let backend = GpuBackend::new(store)?;
                Self::Paper(Box::new(PaperEncoder::new(header.grid, paper, settings, backend)))
            }
            Profile::Main => {
                let search = GpuMotionSearch::new(store)?;
                Self::Main(Box::new(MainEncoder::new(header.grid, settings, search)))
            }
        })
    }

    fn encode(&mut self, volume: &SparseVolume) -> Result<EncodedFrame, BackendError> {
        match self {
            Self::Paper(encoder) => encoder.encode(volume),
            Self::Main(encoder) => encoder.encode(volume),
        }
    }

    fn reconstruction(&self) -> Result<Option<SparseVolume>, GpuError> {
        match self {
            Self::Paper(encoder) => encoder.reconstruction().map(GpuVolume::download).transpose(),
            Self::Main(encoder) => Ok(encoder.reconstruction().cloned()),
        }
    }
}

impl Inner {
    fn on_cpu(header: &StreamHeader, settings: EncoderSettings) -> Self {
        Self::Cpu(Box::new(Encoder::new(header, settings)))
    }
}

impl AnyEncoder {
    /// An encoder on the CPU.
    ///
    /// # Panics
    /// If `settings.gop` is 0.
    #[must_use]
    pub fn on_cpu(header: &StreamHeader, settings: EncoderSettings) -> Self {
        Self { header: *header, settings, encoder: Inner::on_cpu(header, settings), notice: None }
    }

    /// An encoder on a GPU. `falls_back`: whether it goes on on the CPU if the GPU fails.
    ///
    /// # Errors
    /// [`GpuError::Unsupported`] for blocks of another edge than 8 voxels, and [`GpuError::Refused`] if the driver does not take a
    /// kernel.
    ///
    /// # Panics
    /// If `settings.gop` is 0.
    pub fn on_gpu(
        header: &StreamHeader,
        settings: EncoderSettings,
        store: &VolumeStore,
        falls_back: bool,
    ) -> Result<Self, GpuError> {
        let encoder = Inner::Gpu { encoder: GpuEncoder::new(header, settings, store)?, falls_back };
        Ok(Self { header: *header, settings, encoder, notice: None })
    }

    /// Codes the next frame.
    ///
    /// # Errors
    /// What goes wrong on a GPU, if it does not go on on the CPU.
    ///
    /// # Panics
    /// If the volume is not on the stream's grid.
    pub fn encode(&mut self, volume: &SparseVolume) -> Result<EncodedFrame, BackendError> {
        let error = match &mut self.encoder {
            Inner::Cpu(encoder) => return Ok(encoder.encode(volume)),
            Inner::Gpu { encoder, falls_back } => match encoder.encode(volume) {
                Err(error) if *falls_back => error,
                frame => return frame,
            },
        };
        // Its first frame is a keyframe, so nothing of the GPU's is wanted any more.
        (self.encoder, self.notice) = (Inner::on_cpu(&self.header, self.settings), Some(error));
        self.encode(volume)
    }

    /// What the decoder will have after the last frame; nothing before the first.
    ///
    /// # Errors
    /// What goes wrong on a GPU.
    pub fn reconstruction(&self) -> Result<Option<SparseVolume>, GpuError> {
        match &self.encoder {
            Inner::Cpu(encoder) => Ok(encoder.reconstruction().cloned()),
            Inner::Gpu { encoder, .. } => encoder.reconstruction(),
        }
    }

    /// Why it turned from the GPU to the CPU, if it has since this was last asked.
    pub fn take_notice(&mut self) -> Option<BackendError> {
        self.notice.take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Gpu;
    use crate::tests::{gpu_for_tests, grid};
    use isv_decode::{Decoder, Limits};
    use isv_encode::MotionMode;
    use isv_format::{FrameRate, PacketReader, PacketWriter, PaperParameters, Prediction};
    use isv_testkit::ball;

    fn header(profile: Profile) -> StreamHeader {
        StreamHeader { profile, grid: grid(), frame_rate: FrameRate { numerator: 30, denominator: 1 } }
    }

    const PAPER: Profile = Profile::Paper(PaperParameters { coefficients: 64, dc_step: 819, ac_step: 2048 });

    /// Frames of a ball, the GPU lost before the third: all of them decode on the CPU to what the encoder had.
    fn lose_the_gpu(header: &StreamHeader, gpu: &Gpu) {
        let store = VolumeStore::new(gpu).unwrap();
        let motion = MotionMode::Fixed(Prediction::ThreeDof);
        let settings = EncoderSettings { checksums: true, motion, ..EncoderSettings::default() };
        let mut encoder = AnyEncoder::on_gpu(header, settings, &store, true).unwrap();
        let mut writer = PacketWriter::new(Vec::new(), header).unwrap();
        let mut keyframes = Vec::new();
        for frame in 0..4 {
            if frame == 2 {
                gpu.lose();
            }
            let coded = encoder.encode(&ball(grid(), f64::from(frame))).unwrap();
            assert_eq!(encoder.take_notice().is_some(), frame == 2);
            keyframes.push(coded.keyframe);
            writer.write_frame(coded.keyframe, 0, &coded.payload()).unwrap();
        }
        assert_eq!(keyframes, [true, false, true, false]);
        let bytes = writer.finish().unwrap();
        let mut packets = PacketReader::new(&bytes[..]).unwrap();
        let mut decoder = Decoder::new(header, Limits::default());
        while let Some(packet) = packets.next_frame().unwrap() {
            assert!(decoder.decode_and_verify(&packet).unwrap().stated_hash.is_some());
        }
    }

    #[test]
    fn a_lost_gpu_hands_over_to_the_cpu_at_a_keyframe() {
        for profile in [PAPER, Profile::Main] {
            let Some(gpu) = gpu_for_tests("a_lost_gpu_hands_over_to_the_cpu_at_a_keyframe") else { return };
            lose_the_gpu(&header(profile), &gpu);
        }
    }

    #[test]
    fn a_lost_gpu_is_an_error_where_a_gpu_was_asked_for() {
        for profile in [PAPER, Profile::Main] {
            let Some(gpu) = gpu_for_tests("a_lost_gpu_is_an_error_where_a_gpu_was_asked_for") else { return };
            let (header, store) = (header(profile), VolumeStore::new(&gpu).unwrap());
            let settings = EncoderSettings::default();
            let mut encoder = AnyEncoder::on_gpu(&header, settings, &store, false).unwrap();
            encoder.encode(&ball(grid(), 0.0)).unwrap();
            gpu.lose();
            let error = encoder.encode(&ball(grid(), 1.0)).unwrap_err();
            assert!(matches!(error, BackendError::DeviceFailed(_)), "{error}");
        }
    }

    #[test]
    fn what_is_not_on_a_gpu_is_said() {
        let Some(gpu) = gpu_for_tests("what_is_not_on_a_gpu_is_said") else { return };
        let store = VolumeStore::new(&gpu).unwrap();
        let wide =
            StreamHeader { grid: isv_volume::Grid { edge: BlockEdge::E16, ..grid() }, ..header(PAPER) };
        let encoder = AnyEncoder::on_gpu(&wide, EncoderSettings::default(), &store, false);
        assert!(matches!(encoder, Err(GpuError::Unsupported(_))));
    }
}

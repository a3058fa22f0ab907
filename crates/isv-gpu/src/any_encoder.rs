//! An encoder on whatever there is.

use crate::{GpuBackend, GpuError, GpuVolume, VolumeStore};
use isv_decode::BackendError;
use isv_encode::{EncodedFrame, Encoder, EncoderSettings, PaperEncoder};
use isv_format::{Profile, StreamHeader};
use isv_volume::{BlockEdge, SparseVolume};

/// An [`Encoder`] on the CPU or, in profile `paper`, on a GPU. If a GPU fails, it can go on with a keyframe on the CPU.
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
    Gpu { encoder: Box<PaperEncoder<GpuBackend>>, falls_back: bool },
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
    /// [`GpuError::Unsupported`] in profile `main` and for blocks of another edge than 8 voxels; and as [`GpuBackend::new`].
    ///
    /// # Panics
    /// If `settings.gop` is 0.
    pub fn on_gpu(
        header: &StreamHeader,
        settings: EncoderSettings,
        store: &VolumeStore,
        falls_back: bool,
    ) -> Result<Self, GpuError> {
        let Profile::Paper(paper) = &header.profile else {
            return Err(GpuError::Unsupported("encoding in profile main"));
        };
        if header.grid.edge != BlockEdge::E8 {
            return Err(GpuError::Unsupported("blocks of another edge than 8 voxels"));
        }
        let encoder = PaperEncoder::new(header.grid, paper, settings, GpuBackend::new(store)?);
        let encoder = Inner::Gpu { encoder: Box::new(encoder), falls_back };
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
            Inner::Gpu { encoder, .. } => encoder.reconstruction().map(GpuVolume::download).transpose(),
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
    #[test]
    fn a_lost_gpu_hands_over_to_the_cpu_at_a_keyframe() {
        let Some(gpu) = gpu_for_tests("a_lost_gpu_hands_over_to_the_cpu_at_a_keyframe") else { return };
        let (header, store) = (header(PAPER), VolumeStore::new(&gpu).unwrap());
        let motion = MotionMode::Fixed(Prediction::ThreeDof);
        let settings = EncoderSettings { checksums: true, motion, ..EncoderSettings::default() };
        let mut encoder = AnyEncoder::on_gpu(&header, settings, &store, true).unwrap();
        let mut writer = PacketWriter::new(Vec::new(), &header).unwrap();
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
        let mut decoder = Decoder::new(&header, Limits::default());
        while let Some(packet) = packets.next_frame().unwrap() {
            assert!(decoder.decode_and_verify(&packet).unwrap().stated_hash.is_some());
        }
        // Where a GPU was asked for, it is an error.
        let mut strict = AnyEncoder::on_gpu(&header, settings, &store, false).unwrap();
        let error = strict.encode(&ball(grid(), 0.0)).unwrap_err();
        assert!(matches!(error, BackendError::DeviceFailed(_)), "{error}");
    }

    #[test]
    fn what_is_not_on_a_gpu_is_said() {
        let Some(gpu) = gpu_for_tests("what_is_not_on_a_gpu_is_said") else { return };
        let store = VolumeStore::new(&gpu).unwrap();
        let wide =
            StreamHeader { grid: isv_volume::Grid { edge: BlockEdge::E16, ..grid() }, ..header(PAPER) };
        for header in [header(Profile::Main), wide] {
            let encoder = AnyEncoder::on_gpu(&header, EncoderSettings::default(), &store, false);
            assert!(matches!(encoder, Err(GpuError::Unsupported(_))));
        }
    }
}

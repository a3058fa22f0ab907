//! A coder on whatever there is.

use crate::{GpuBackend, GpuError, GpuMotionSearch, GpuVolume, VolumeStore};
use isv_decode::BackendError;
use isv_decode::backend::Cpu;
use isv_encode::{EncoderSettings, FrameCoder, MainEncoder, PaperCoder, UnwrittenFrame};
use isv_format::{Profile, StreamHeader};
use isv_volume::{BlockEdge, SparseVolume};

/// A [`FrameCoder`] on the CPU or on a GPU, where in profile `main` motion is searched for. If a GPU fails, it can go on with a
/// keyframe on the CPU. A [`FrameWriter`](isv_encode::FrameWriter) writes its frames, whoever coded them.
#[derive(Debug)]
pub struct AnyCoder {
    header: StreamHeader,
    settings: EncoderSettings,
    coder: Inner,
    /// Why the GPU was given up, until somebody asks.
    notice: Option<BackendError>,
}

#[derive(Debug)]
enum Inner {
    Cpu(FrameCoder<Cpu, Cpu>),
    Gpu { coder: FrameCoder<GpuBackend, GpuMotionSearch>, falls_back: bool },
}

impl Inner {
    fn on_cpu(header: &StreamHeader, settings: EncoderSettings) -> Self {
        Self::Cpu(FrameCoder::on_cpu(header, settings))
    }
}

impl AnyCoder {
    /// A coder on the CPU.
    ///
    /// # Panics
    /// If `settings.gop` is 0.
    #[must_use]
    pub fn on_cpu(header: &StreamHeader, settings: EncoderSettings) -> Self {
        Self { header: *header, settings, coder: Inner::on_cpu(header, settings), notice: None }
    }

    /// A coder on a GPU. `falls_back`: whether it goes on on the CPU if the GPU fails.
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
        let coder = Inner::Gpu { coder: coder_on_gpu(header, settings, store)?, falls_back };
        Ok(Self { header: *header, settings, coder, notice: None })
    }

    /// Codes the next frame.
    ///
    /// # Errors
    /// What goes wrong on a GPU, if it does not go on on the CPU.
    ///
    /// # Panics
    /// If the volume is not on the stream's grid.
    pub fn code(&mut self, volume: &SparseVolume) -> Result<UnwrittenFrame, BackendError> {
        let error = match &mut self.coder {
            Inner::Cpu(coder) => return coder.code(volume),
            Inner::Gpu { coder, falls_back } => match coder.code(volume) {
                Err(error) if *falls_back => error,
                frame => return frame,
            },
        };
        // Its first frame is a keyframe, so nothing of the GPU's is wanted any more.
        (self.coder, self.notice) = (Inner::on_cpu(&self.header, self.settings), Some(error));
        self.code(volume)
    }

    /// What the decoder will have after the last frame; nothing before the first.
    ///
    /// # Errors
    /// What goes wrong on a GPU.
    pub fn reconstruction(&self) -> Result<Option<SparseVolume>, GpuError> {
        match &self.coder {
            Inner::Cpu(coder) => Ok(coder.reconstruction().cloned()),
            Inner::Gpu { coder: FrameCoder::Paper(coder), .. } => {
                coder.reconstruction().map(GpuVolume::download).transpose()
            }
            Inner::Gpu { coder: FrameCoder::Main(encoder), .. } => Ok(encoder.reconstruction().cloned()),
        }
    }

    /// Why it turned from the GPU to the CPU, if it has since this was last asked.
    pub fn take_notice(&mut self) -> Option<BackendError> {
        self.notice.take()
    }
}

fn coder_on_gpu(
    header: &StreamHeader,
    settings: EncoderSettings,
    store: &VolumeStore,
) -> Result<FrameCoder<GpuBackend, GpuMotionSearch>, GpuError> {
    if header.grid.edge != BlockEdge::E8 {
        return Err(GpuError::Unsupported("blocks of another edge than 8 voxels"));
    }
    Ok(match &header.profile {
        Profile::Paper(paper) => {
            let backend = GpuBackend::new(store)?;
            FrameCoder::Paper(Box::new(PaperCoder::new(header.grid, paper, settings, backend)))
        }
        Profile::Main => {
            let search = GpuMotionSearch::new(store)?;
            FrameCoder::Main(Box::new(MainEncoder::new(header.grid, settings, search)))
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Gpu;
    use crate::tests::{gpu_alone, gpu_for_tests, grid};
    use isv_decode::{Decoder, Limits};
    use isv_encode::{FrameWriter, MotionMode};
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
        let mut coder = AnyCoder::on_gpu(header, settings, &store, true).unwrap();
        let (mut frames, mut writer) =
            (FrameWriter::default(), PacketWriter::new(Vec::new(), header).unwrap());
        let mut keyframes = Vec::new();
        for frame in 0..4 {
            if frame == 2 {
                gpu.lose();
            }
            let coded = frames.write(coder.code(&ball(grid(), f64::from(frame))).unwrap());
            assert_eq!(coder.take_notice().is_some(), frame == 2);
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
            let Some(gpu) = gpu_alone() else { return };
            lose_the_gpu(&header(profile), &gpu);
        }
    }

    #[test]
    fn a_lost_gpu_is_an_error_where_a_gpu_was_asked_for() {
        for profile in [PAPER, Profile::Main] {
            let Some(gpu) = gpu_alone() else { return };
            let (header, store) = (header(profile), VolumeStore::new(&gpu).unwrap());
            let settings = EncoderSettings::default();
            let mut coder = AnyCoder::on_gpu(&header, settings, &store, false).unwrap();
            coder.code(&ball(grid(), 0.0)).unwrap();
            gpu.lose();
            let error = coder.code(&ball(grid(), 1.0)).unwrap_err();
            assert!(matches!(error, BackendError::DeviceFailed(_)), "{error}");
        }
    }

    #[test]
    fn what_is_not_on_a_gpu_is_said() {
        let Some(gpu) = gpu_for_tests() else { return };
        let store = VolumeStore::new(&gpu).unwrap();
        let wide =
            StreamHeader { grid: isv_volume::Grid { edge: BlockEdge::E16, ..grid() }, ..header(PAPER) };
        let coder = AnyCoder::on_gpu(&wide, EncoderSettings::default(), &store, false);
        assert!(matches!(coder, Err(GpuError::Unsupported(_))));
    }
}

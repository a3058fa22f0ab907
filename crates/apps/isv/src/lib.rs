//! isv (implicit surface video): a codec for moving 3-D geometry.
//!
//! Mesh sequences become sparse truncated signed distance fields, which are coded like video: 8x8x8 blocks, 3-D DCT,
//! motion-compensated prediction, adaptive range coding. This crate is what users depend on; it re-exports the crates
//! that do the work, one module each.
//!
//! ```
//! use isv::decode::{Decoder, Limits};
//! use isv::encode::{Encoder, EncoderSettings};
//! use isv::format::{FrameRate, PacketReader, PacketWriter, PaperParameters, Profile, StreamHeader};
//! use isv::volume::{BlockEdge, Grid, SparseVolume, Truncation, VoxelSize};
//!
//! let grid = Grid {
//!     voxel_size: VoxelSize::from_metres(0.005)?,
//!     edge: BlockEdge::E8,
//!     truncation: Truncation::from_voxels(8)?,
//! };
//! let header = StreamHeader {
//!     profile: Profile::Paper(PaperParameters {
//!         coefficients: 64,
//!         dc_step: 819,
//!         ac_step: 8192,
//!     }),
//!     grid,
//!     frame_rate: FrameRate { numerator: 30, denominator: 1 },
//! };
//! let volume = SparseVolume::empty(grid); // in earnest: `isv::ingest::ingest_mesh`
//!
//! let mut encoder = Encoder::new(&header, EncoderSettings::default());
//! let mut writer = PacketWriter::new(Vec::new(), &header)?;
//! let frame = encoder.encode(&volume);
//! writer.write_frame(frame.keyframe, 0, &frame.payload())?;
//! let bytes = writer.finish()?;
//!
//! let mut reader = PacketReader::new(&bytes[..])?;
//! let mut decoder = Decoder::new(reader.header().expect("just opened"), Limits::default());
//! while let Some(packet) = reader.next_frame()? {
//!     assert_eq!(decoder.decode(&packet)?.volume, &volume);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use isv_decode as decode;
pub use isv_encode as encode;
pub use isv_format as format;
pub use isv_fusion as fusion;
#[cfg(feature = "gpu")]
pub use isv_gpu as gpu;
pub use isv_ingest as ingest;
pub use isv_io as io;
pub use isv_kernels as kernels;
pub use isv_metrics as metrics;
pub use isv_simplify as simplify;
pub use isv_surface as surface;
pub use isv_take as take;
pub use isv_volume as volume;

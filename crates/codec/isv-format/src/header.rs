//! The stream header: what holds for every frame.

use crate::bytes::ByteReader;
use crate::reader::read_up_to;
use crate::{ColourLayers, FormatError, FormatVersion, FrameRate, MaskCoding};
use isv_volume::{BlockEdge, Grid, Truncation, VoxelSize};
use std::io::Read;

/// First bytes of a stream. As in PNG, the first is not ASCII, so no text begins so, and the line ends show a transfer that
/// rewrote them.
pub const MAGIC: [u8; 8] = *b"\x89ISV\r\n\x1a\n";

/// Largest quantizer step, in sixteenths of a code.
pub(crate) const STEP_LIMIT: u32 = 1 << 20;

/// Profile byte of [`Profile::Paper`].
const PAPER: u8 = 0;
/// Profile byte of [`Profile::Main`].
const MAIN: u8 = 1;

/// Which of the codec's two sets of tools a stream uses, and what the set needs to know for all frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Profile {
    /// The paper as written.
    Paper(PaperParameters),
    /// The tools that compress best. Blocks have edge 8, and each frame states its own parameters.
    Main,
}

impl Profile {
    /// Name of the profile: `paper` or `main`.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Paper(_) => "paper",
            Self::Main => "main",
        }
    }
}

/// What holds for every frame of a stream of profile `paper`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PaperParameters {
    /// How many coefficients of a block are coded: K in Sec. 3.3, 1 up to a block's voxels.
    pub coefficients: u16,
    /// DC step in sixteenths of a code, `1 ..= 2^20`.
    pub dc_step: u32,
    /// AC step in sixteenths of a code, `1 ..= 2^20`.
    pub ac_step: u32,
}

impl PaperParameters {
    /// Ranges of the fields, in blocks of some number of voxels.
    fn check(&self, block_voxels: usize) -> Result<(), FormatError> {
        require((1..=block_voxels).contains(&usize::from(self.coefficients)), 32, || {
            format!("{} coefficients in a block of {block_voxels} voxels", self.coefficients)
        })?;
        for (at, step) in [(36, self.dc_step), (40, self.ac_step)] {
            require((1..=STEP_LIMIT).contains(&step), at, || format!("quantizer step {step}"))?;
        }
        Ok(())
    }
}

/// What holds for every frame of a stream. 48 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StreamHeader {
    /// The version of the format. Streams that use nothing of version 2 are written as version 1, which older programs read too.
    pub version: FormatVersion,
    /// The set of tools and its parameters.
    pub profile: Profile,
    /// Voxel size, block edge and truncation.
    pub grid: Grid,
    /// Nominal frame rate.
    pub frame_rate: FrameRate,
    /// Layers of colour that frames may have; none in version 1 and in profile `paper`.
    pub colour_layers: ColourLayers,
    /// How unobserved voxels are coded; by voxels in version 1 and in profile `paper`.
    pub mask_coding: MaskCoding,
}

impl StreamHeader {
    /// Size in bytes.
    pub const BYTES: usize = 48;

    /// The header of a stream of geometry alone, in version 1.
    #[must_use]
    pub fn new(profile: Profile, grid: Grid, frame_rate: FrameRate) -> Self {
        Self {
            version: FormatVersion::V1,
            profile,
            grid,
            frame_rate,
            colour_layers: ColourLayers::None,
            mask_coding: MaskCoding::Voxels,
        }
    }

    /// The header of a stream of geometry alone with all tools that its profile has, in the version that they need.
    #[must_use]
    pub fn newest(profile: Profile, grid: Grid, frame_rate: FrameRate) -> Self {
        let header = Self::new(profile, grid, frame_rate);
        match profile {
            Profile::Main => header.with_mask_coding(MaskCoding::Cells),
            Profile::Paper(_) => header,
        }
    }

    /// Sets the layers of colour. A header with any has version 2.
    #[must_use]
    pub fn with_colour(self, colour_layers: ColourLayers) -> Self {
        let version = if colour_layers.is_some() { FormatVersion::V2 } else { self.version };
        Self { version, colour_layers, ..self }
    }

    /// Sets how unobserved voxels are coded. A header that says by cells has version 2.
    #[must_use]
    pub fn with_mask_coding(self, mask_coding: MaskCoding) -> Self {
        let version = if mask_coding == MaskCoding::Cells { FormatVersion::V2 } else { self.version };
        Self { version, mask_coding, ..self }
    }

    /// The header as bytes.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut out = Vec::with_capacity(Self::BYTES);
        out.extend(MAGIC);
        out.extend(self.version.number().to_le_bytes());
        out.extend((Self::BYTES as u16).to_le_bytes());
        out.push(match self.profile {
            Profile::Paper(_) => PAPER,
            Profile::Main => MAIN,
        });
        out.push(self.grid.edge.log2() as u8);
        out.push(self.grid.truncation.voxels() as u8);
        out.push(self.colour_layers.count() | self.mask_coding.bits());
        out.extend(self.grid.voxel_size.nanometres().to_le_bytes());
        out.extend(self.frame_rate.numerator.to_le_bytes());
        out.extend(self.frame_rate.denominator.to_le_bytes());
        match self.profile {
            Profile::Paper(paper) => {
                out.extend(paper.coefficients.to_le_bytes());
                out.extend([0; 2]);
                out.extend(paper.dc_step.to_le_bytes());
                out.extend(paper.ac_step.to_le_bytes());
            }
            Profile::Main => out.extend([0; 12]),
        }
        out.extend(crc32fast::hash(&out).to_le_bytes());
        out.try_into().expect("the fields above fill the header")
    }

    /// Reads and checks the header that a source begins with.
    ///
    /// # Errors
    /// As [`Self::parse`], of fewer bytes too: a later version may have a shorter header. Bytes that end inside it.
    pub(crate) fn read(source: &mut impl Read) -> Result<Self, FormatError> {
        let mut bytes = [0; Self::BYTES];
        let length = read_up_to(source, &mut bytes)?;
        if length == bytes.len() {
            return Self::parse(&bytes);
        }
        find_version(&bytes[..length])?;
        Err(FormatError::Truncated { at: length as u64, inside: "the stream header" })
    }

    /// Parses and checks a header.
    ///
    /// # Errors
    /// Any of the format errors; the version is looked at before anything else may be judged.
    pub fn parse(bytes: &[u8; Self::BYTES]) -> Result<Self, FormatError> {
        let version = find_version(bytes)?;
        let mut fields = ByteReader::new(bytes, 0, "the stream header");
        fields.take(MAGIC.len() + 2)?;
        let (body, checksum) = bytes.split_at(Self::BYTES - 4);
        if crc32fast::hash(body).to_le_bytes() != checksum {
            return Err(FormatError::Checksum { at: 0, what: "the stream header" });
        }
        let length = fields.u16()?;
        require(usize::from(length) == Self::BYTES, 10, || format!("header length {length}"))?;
        let header = Self::parse_fields(version, &mut fields)?;
        header.check()?;
        Ok(header)
    }

    /// The fields after the length, in order.
    fn parse_fields(version: FormatVersion, fields: &mut ByteReader) -> Result<Self, FormatError> {
        let profile = fields.u8()?;
        if profile != PAPER && profile != MAIN {
            return Err(FormatError::Profile { found: profile });
        }
        let edge_log2 = fields.u8()?;
        let edge = BlockEdge::from_voxels(1u32.checked_shl(u32::from(edge_log2)).unwrap_or(0));
        let truncation = Truncation::from_voxels(u32::from(fields.u8()?));
        let (colour_layers, mask_coding) = parse_tools(version, fields.u8()?)?;
        let voxel_size = VoxelSize::from_nanometres(fields.u64()?);
        let frame_rate = FrameRate { numerator: fields.u32()?, denominator: fields.u32()? };
        let profile = Self::parse_profile(profile, fields)?;
        let malformed = |at, error: isv_volume::GridError| FormatError::malformed(at, error.to_string());
        Ok(Self {
            version,
            profile,
            grid: Grid {
                edge: edge.map_err(|e| malformed(13, e))?,
                truncation: truncation.map_err(|e| malformed(14, e))?,
                voxel_size: voxel_size.map_err(|e| malformed(16, e))?,
            },
            frame_rate,
            colour_layers,
            mask_coding,
        })
    }

    /// The fields from byte 32 on, which are reserved outside profile `paper`.
    fn parse_profile(profile: u8, fields: &mut ByteReader) -> Result<Profile, FormatError> {
        let reserved = |at, field: u32| require(field == 0, at, || format!("reserved field is {field}"));
        let coefficients = fields.u16()?;
        reserved(34, u32::from(fields.u16()?))?;
        let (dc_step, ac_step) = (fields.u32()?, fields.u32()?);
        if profile == PAPER {
            return Ok(Profile::Paper(PaperParameters { coefficients, dc_step, ac_step }));
        }
        reserved(32, u32::from(coefficients))?;
        reserved(36, dc_step)?;
        reserved(40, ac_step)?;
        Ok(Profile::Main)
    }

    /// Ranges of the fields that no type checks.
    fn check(&self) -> Result<(), FormatError> {
        let rate = self.frame_rate;
        require(rate.numerator > 0 && rate.denominator > 0, 24, || {
            format!("frame rate {}/{}", rate.numerator, rate.denominator)
        })?;
        let edge = self.grid.edge;
        match self.profile {
            Profile::Paper(paper) => {
                require(!self.colour_layers.is_some(), 15, || "colour in profile paper".to_owned())?;
                require(self.mask_coding == MaskCoding::Voxels, 15, || {
                    "masks by cell in profile paper".to_owned()
                })?;
                paper.check(edge.block_voxels())
            }
            Profile::Main => require(edge == BlockEdge::E8, 13, || {
                format!("block edge {} in profile main, which has edge 8", edge.voxels())
            }),
        }
    }
}

/// The version of a stream that begins with these bytes, as far as they go: the newest where they end before it.
fn find_version(bytes: &[u8]) -> Result<FormatVersion, FormatError> {
    let (magic, rest) = bytes.split_at(bytes.len().min(MAGIC.len()));
    if magic != &MAGIC[..magic.len()] {
        return Err(FormatError::NotIsv);
    }
    let Some(found) = rest.first_chunk().map(|version| u16::from_le_bytes(*version)) else {
        return Ok(FormatVersion::NEWEST);
    };
    let supported = FormatVersion::NEWEST.number();
    FormatVersion::from_number(found).ok_or(FormatError::Version { found, supported })
}

/// Byte 15: the layers of colour and the coding of masks in version 2, reserved in version 1.
fn parse_tools(version: FormatVersion, byte: u8) -> Result<(ColourLayers, MaskCoding), FormatError> {
    let layers = match version {
        FormatVersion::V1 => (byte == 0).then_some(ColourLayers::None),
        FormatVersion::V2 => ColourLayers::from_count(byte & !MaskCoding::CELLS_BIT),
    };
    let layers =
        layers.ok_or_else(|| FormatError::malformed(15, format!("reserved bits are set in {byte:#x}")))?;
    Ok((layers, MaskCoding::from_bits(byte)))
}

fn require(condition: bool, at: u64, what: impl FnOnce() -> String) -> Result<(), FormatError> {
    if condition { Ok(()) } else { Err(FormatError::malformed(at, what())) }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    const PAPER_PARAMETERS: PaperParameters =
        PaperParameters { coefficients: 64, dc_step: 819, ac_step: 8192 };

    pub(crate) fn header() -> StreamHeader {
        let grid = Grid {
            voxel_size: VoxelSize::from_metres(0.005).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::DEFAULT,
        };
        StreamHeader::new(Profile::Paper(PAPER_PARAMETERS), grid, FrameRate::DEFAULT)
    }

    pub(crate) fn main_header() -> StreamHeader {
        StreamHeader { profile: Profile::Main, ..header() }
    }

    /// A header of version 2, of a stream with colour.
    pub(crate) fn colour_header() -> StreamHeader {
        main_header().with_colour(ColourLayers::HalfVoxels)
    }

    /// Asserts that a header is refused for the field at byte `place`.
    fn assert_malformed(bytes: &[u8; StreamHeader::BYTES], place: u64) {
        match StreamHeader::parse(bytes) {
            Err(FormatError::Malformed { at, .. }) => assert_eq!(at, place),
            other => panic!("byte {place}: {other:?}"),
        }
    }

    #[test]
    fn header_roundtrips() {
        for header in [header(), main_header(), colour_header(), second(header())] {
            assert_eq!(StreamHeader::parse(&header.to_bytes()).unwrap(), header);
        }
    }

    #[test]
    fn every_flipped_bit_is_noticed() {
        for bytes in [header(), main_header(), colour_header()].map(|header| header.to_bytes()) {
            for bit in 0..bytes.len() * 8 {
                let mut damaged = bytes;
                damaged[bit / 8] ^= 1 << (bit % 8);
                assert!(StreamHeader::parse(&damaged).is_err(), "bit {bit}");
            }
        }
    }

    #[test]
    fn fields_out_of_range_are_refused_by_place() {
        let rate = FrameRate { numerator: 0, denominator: 1 };
        assert_malformed(&StreamHeader { frame_rate: rate, ..header() }.to_bytes(), 24);
        let wrong = [
            (32, PaperParameters { coefficients: 513, ..PAPER_PARAMETERS }),
            (36, PaperParameters { dc_step: 0, ..PAPER_PARAMETERS }),
            (40, PaperParameters { ac_step: STEP_LIMIT + 1, ..PAPER_PARAMETERS }),
        ];
        for (place, paper) in wrong {
            let header = StreamHeader { profile: Profile::Paper(paper), ..header() };
            assert_malformed(&header.to_bytes(), place);
        }
    }

    #[test]
    fn profile_main_has_edge_8_and_no_fields_of_the_paper() {
        for edge in [BlockEdge::E4, BlockEdge::E16] {
            let header = StreamHeader { grid: Grid { edge, ..header().grid }, ..main_header() };
            assert_malformed(&header.to_bytes(), 13);
        }
        for byte in 32..44 {
            let place = [32, 34, 36, 36, 40, 40][(byte - 32) / 2];
            assert_malformed(&with_byte(&main_header(), byte, 1), place);
        }
    }

    #[test]
    fn a_profile_that_is_not_known_is_named() {
        let error = StreamHeader::parse(&with_byte(&main_header(), 12, 2)).unwrap_err();
        assert!(matches!(error, FormatError::Profile { found: 2 }), "{error}");
    }

    /// A header in version 2.
    fn second(header: StreamHeader) -> StreamHeader {
        StreamHeader { version: FormatVersion::V2, ..header }
    }

    #[test]
    fn colour_is_counted_in_version_2_of_profile_main() {
        for layers in ColourLayers::ALL {
            let bytes = second(main_header()).with_colour(layers).to_bytes();
            assert_eq!((bytes[8], bytes[15]), (2, layers.count()));
            assert_eq!(StreamHeader::parse(&bytes).unwrap().colour_layers, layers);
        }
        for byte in 8..=u8::MAX {
            assert_malformed(&with_byte(&second(main_header()), 15, byte), 15);
        }
        assert_malformed(&header().with_colour(ColourLayers::Voxels).to_bytes(), 15);
        let first = StreamHeader { version: FormatVersion::V1, ..colour_header() };
        assert_malformed(&first.to_bytes(), 15);
    }

    #[test]
    fn masks_are_by_cell_in_version_2_of_profile_main() {
        for layers in ColourLayers::ALL {
            let header = main_header().with_mask_coding(MaskCoding::Cells).with_colour(layers);
            let bytes = header.to_bytes();
            assert_eq!((bytes[8], bytes[15]), (2, 4 | layers.count()));
            assert_eq!(StreamHeader::parse(&bytes).unwrap(), header);
        }
        assert_malformed(&header().with_mask_coding(MaskCoding::Cells).to_bytes(), 15);
        let cells = main_header().with_mask_coding(MaskCoding::Cells);
        assert_malformed(&StreamHeader { version: FormatVersion::V1, ..cells }.to_bytes(), 15);
    }

    #[test]
    fn what_needs_nothing_of_version_2_stays_in_version_1() {
        let header = main_header().with_colour(ColourLayers::None).with_mask_coding(MaskCoding::Voxels);
        assert_eq!((header, header.version), (main_header(), FormatVersion::V1));
    }

    /// A header with one byte changed, its checksum right.
    fn with_byte(header: &StreamHeader, byte: usize, value: u8) -> [u8; StreamHeader::BYTES] {
        let mut bytes = header.to_bytes();
        bytes[byte] = value;
        let (body, checksum) = bytes.split_at_mut(StreamHeader::BYTES - 4);
        checksum.copy_from_slice(&crc32fast::hash(body).to_le_bytes());
        bytes
    }

    #[test]
    fn a_newer_version_is_named_before_its_checksum_is_judged() {
        let mut bytes = header().to_bytes();
        bytes[8] = 3;
        let error = StreamHeader::parse(&bytes).unwrap_err();
        assert!(matches!(error, FormatError::Version { found: 3, supported: 2 }), "{error}");
    }

    #[test]
    fn timestamps_do_not_drift() {
        let rate = FrameRate { numerator: 30_000, denominator: 1001 };
        assert_eq!(rate.timestamp_ns(30_000), 1_001_000_000_000);
        assert_eq!(rate.timestamp_ns(1), 33_366_666);
    }
}

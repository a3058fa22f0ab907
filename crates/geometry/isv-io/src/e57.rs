//! E57, the files of laser scanners of ASTM E2807, by the crate `e57`: scans of points, each with a pose, described in
//! XML.
//!
//! The crate checks the checksum of every page of the file and reports what is wrong. But it believes the
//! lengths and counts that the file declares. Those are held against the file's length here, before they cost
//! memory or time.

use crate::cloud_builder::CloudBuilder;
use crate::error::{Flaw, Malformation};
use crate::raw_colours::Scale;
use e57::{E57Reader, Record, RecordDataType, RecordName as Name, RecordValue};
use glam::{DQuat, DVec3};
use isv_foreign::catch_panic;
use isv_volume::{PointCloud, ScanPlace};
use std::fmt::Display;
use std::io::Cursor;

/// Bytes of the file's header.
const HEADER_BYTES: usize = 48;

/// Most attributes of a point. The standard has 21, normals are 3 more. A packet of 64 KiB unpacks to at most 8 MiB an
/// attribute, of one bit or none.
const MAX_ATTRIBUTES: usize = 64;

/// Most namespaces that the XML declares. Every element in their reach costs the XML parser memory for each.
const MAX_NAMESPACES: usize = 64;

/// Most attributes of an element of the XML, its namespaces among them: the standard has five at most beside those. The
/// XML parser compares each with all others of its element.
const MAX_XML_ATTRIBUTES: usize = 128;

/// How far the length of a pose's quaternion may be from 1.
const LENGTH_TOLERANCE: f64 = 1e-3;

type Reader<'a> = E57Reader<Cursor<&'a [u8]>>;

/// Parses an E57 file in memory: the points of all scans, each moved by its scan's pose. Cartesian coordinates are
/// taken where they are valid, else spherical ones; a point with neither is dropped. Normals of the extension `nor`
/// (`normalX`, `normalY`, `normalZ`) are read; they are unknown, zero, in scans without. The viewpoint is the
/// scanner's place if there is one scan and it has a pose; of several scans each has its own. Colours are read if they are asked for;
/// points without a valid one are white.
pub(crate) fn parse(bytes: &[u8], keeps_colours: bool) -> Result<PointCloud, Flaw> {
    if !bytes.starts_with(b"ASTM-E57") {
        return Err(Flaw::at_byte(0, Malformation::Magic { format: "E57", magic: "ASTM-E57" }));
    }
    let damaged = || Flaw::unreadable("E57", 0, &"its XML or its packets are damaged");
    catch_panic(|| read(bytes, keeps_colours)).unwrap_or_else(|| Err(damaged()))
}

/// Whether points of any scan have colours.
pub(crate) fn has_colours(bytes: &[u8]) -> bool {
    let any = || {
        check_xml(bytes).ok()?;
        let scans = Reader::new(Cursor::new(bytes)).ok()?.pointclouds();
        Some(scans.iter().flat_map(|scan| &scan.prototype).any(|record| record.name == Name::ColorRed))
    };
    catch_panic(any).flatten().unwrap_or_default()
}

/// When the first scan began, in seconds of GPS time, where the file says.
pub(crate) fn start_s(bytes: &[u8]) -> Option<f64> {
    let start = || {
        check_xml(bytes).ok()?;
        let reader = Reader::new(Cursor::new(bytes)).ok()?;
        Some(reader.pointclouds().first()?.acquisition_start.as_ref()?.gps_time)
    };
    catch_panic(start).flatten()
}

fn read(bytes: &[u8], keeps_colours: bool) -> Result<PointCloud, Flaw> {
    check_xml(bytes)?;
    let mut reader = Reader::new(Cursor::new(bytes)).map_err(|why| Flaw::unreadable("E57", 0, &why))?;
    let scans = reader.pointclouds();
    check_sizes(bytes, &scans)?;
    let normals = scans.iter().any(|scan| Attributes::new(scan).normal.is_some());
    let coloured = keeps_colours && scans.iter().any(|scan| Attributes::new(scan).colour.is_some());
    let mut cloud = CloudBuilder::new(normals, 0).with_colours(coloured.then_some(Scale::Byte));
    let any_pose = scans.iter().any(|scan| scan.transform.as_ref().is_some_and(|pose| !is_identity(pose)));
    let mut places = Vec::new();
    for scan in &scans {
        let first = cloud.len();
        read_scan(&mut reader, scan, &mut cloud)?;
        if let Some(viewpoint) = viewpoint_of(scan, any_pose) {
            places.push(ScanPlace { points: first..cloud.len(), viewpoint });
        }
    }
    let mut cloud = cloud.finish(None);
    match &places[..] {
        [place] if scans.len() == 1 => cloud.viewpoint = Some(place.viewpoint),
        _ => cloud.scans = places,
    }
    Ok(cloud)
}

/// Place of the scanner. A scan without a pose, or with one that changes nothing, stands at the origin if
/// another one has a pose. The others are then aligned to it. If none has, nobody knows.
fn viewpoint_of(scan: &e57::PointCloud, any_pose: bool) -> Option<DVec3> {
    let place = scan.transform.as_ref().map_or(DVec3::ZERO, |pose| {
        let e57::Translation { x, y, z } = pose.translation;
        DVec3::new(x, y, z)
    });
    Some(place).filter(|place| any_pose && place.is_finite())
}

/// Whether a pose changes nothing: programs write it that do not know one, as for points of several scans in one.
fn is_identity(pose: &e57::Transform) -> bool {
    let e57::Translation { x, y, z } = pose.translation;
    let turned = &pose.rotation;
    [x, y, z, turned.x, turned.y, turned.z] == [0.0; 6]
}

/// Makes sure that the XML is no longer than the file, declares few namespaces and has elements of few attributes.
fn check_xml(bytes: &[u8]) -> Result<(), Flaw> {
    let header = bytes.first_chunk::<HEADER_BYTES>();
    let header =
        header.ok_or(Flaw::at_byte(bytes.len(), Malformation::EndsBefore { what: "XML section" }))?;
    let length = u64::from_le_bytes(std::array::from_fn(|byte| header[32 + byte]));
    if length > bytes.len() as u64 {
        let why = format!("its XML section has {length} bytes, the file only {}", bytes.len());
        return Err(Flaw::unreadable("E57", 32, &why));
    }
    let xml = Reader::raw_xml(Cursor::new(bytes)).map_err(|why| Flaw::unreadable("E57", 24, &why))?;
    let namespaces = xml.windows(5).filter(|word| word == b"xmlns").count();
    if namespaces > MAX_NAMESPACES {
        return Err(Flaw::unreadable("E57", 24, &format!("its XML declares {namespaces} namespaces")));
    }
    // No tag has a `<` in it but at its start.
    let attributes = xml.split(|b| *b == b'<').map(count_attributes).max().unwrap_or_default();
    if attributes > MAX_XML_ATTRIBUTES {
        let why = format!("an element of its XML has {attributes} attributes");
        return Err(Flaw::unreadable("E57", 24, &why));
    }
    Ok(())
}

/// How many attributes a tag has, given what follows its `<`; none for a comment or an instruction.
fn count_attributes(tag: &[u8]) -> usize {
    if let [b'!' | b'?', ..] = tag {
        return 0;
    }
    let (mut attributes, mut quote) = (0, None);
    for &byte in tag {
        match (quote, byte) {
            (None, b'>') => break,
            (None, b'=') => attributes += 1,
            (None, b'"' | b'\'') => quote = Some(byte),
            (Some(open), _) if open == byte => quote = None,
            _ => {}
        }
    }
    attributes
}

/// Makes sure that the points of all scans together have room in the file, by the bits that a point takes in
/// each. Points must take some bits.
fn check_sizes(bytes: &[u8], scans: &[e57::PointCloud]) -> Result<(), Flaw> {
    let mut room = 8 * bytes.len() as u64;
    for scan in scans {
        let flaw = |why: &dyn Display| Flaw::unreadable("E57", scan.file_offset as usize, why);
        if scan.prototype.len() > MAX_ATTRIBUTES {
            return Err(flaw(&format!("a point has {} attributes", scan.prototype.len())));
        }
        let bits: u64 = scan.prototype.iter().map(|record| bits_of(&record.data_type)).sum();
        if bits == 0 && scan.records > 0 {
            return Err(flaw(&"its points take no bits"));
        }
        room = scan.records.checked_mul(bits).and_then(|taken| room.checked_sub(taken)).ok_or_else(|| {
            flaw(&format!("it declares {} points of {bits} bits, more than the file holds", scan.records))
        })?;
    }
    Ok(())
}

/// Bits that a value takes in the file.
fn bits_of(data_type: &RecordDataType) -> u64 {
    match *data_type {
        RecordDataType::Single { .. } => 32,
        RecordDataType::Double { .. } => 64,
        RecordDataType::ScaledInteger { min, max, .. } | RecordDataType::Integer { min, max } => {
            u64::from((i128::from(max) - i128::from(min)).checked_ilog2().map_or(0, |log| log + 1))
        }
    }
}

fn read_scan(reader: &mut Reader, scan: &e57::PointCloud, cloud: &mut CloudBuilder) -> Result<(), Flaw> {
    let flaw = |why: &dyn Display| Flaw::unreadable("E57", scan.file_offset as usize, why);
    let attributes = Attributes::new(scan);
    if attributes.cartesian.is_none() && attributes.spherical.is_none() {
        return Err(flaw(&"a scan has neither Cartesian nor spherical coordinates"));
    }
    let (rotation, translation) = pose_of(scan).ok_or_else(|| flaw(&"the pose of a scan is no rotation"))?;
    for point in reader.pointcloud_raw(scan).map_err(|why| flaw(&why))? {
        let point = Values { values: &point.map_err(|why| flaw(&why))?, prototype: &scan.prototype };
        if let Some(position) = attributes.position(&point).map_err(|why| flaw(&why))? {
            let normal = attributes.normal.map_or(Ok(DVec3::ZERO), |columns| point.vector(columns));
            let normal = normal.map_err(|why| flaw(&why))?;
            cloud.push(rotation * position + translation, rotation * normal);
            let colour = attributes.colour.as_ref().map(|colour| colour.of_point(&point)).transpose();
            cloud.push_colour(colour.map_err(|why| flaw(&why))?.flatten().unwrap_or([f64::NAN; 3]));
        }
    }
    Ok(())
}

/// Rotation and translation that take a scan's points into the file's coordinates; none if it is no rotation.
fn pose_of(scan: &e57::PointCloud) -> Option<(DQuat, DVec3)> {
    let Some(pose) = &scan.transform else { return Some((DQuat::IDENTITY, DVec3::ZERO)) };
    let e57::Quaternion { w, x, y, z } = pose.rotation;
    let rotation = DQuat::from_xyzw(x, y, z, w);
    let e57::Translation { x, y, z } = pose.translation;
    // Zeros are what pye57 once wrote for no rotation.
    let rotation = if rotation.length() == 0.0 { DQuat::IDENTITY } else { rotation };
    let is_rotation = (rotation.length() - 1.0).abs() <= LENGTH_TOLERANCE;
    is_rotation.then(|| (rotation.normalize(), DVec3::new(x, y, z)))
}

/// Columns in which the values of a point are.
struct Attributes {
    cartesian: Option<[usize; 3]>,
    cartesian_state: Option<usize>,
    /// Range, azimuth, elevation.
    spherical: Option<[usize; 3]>,
    spherical_state: Option<usize>,
    normal: Option<[usize; 3]>,
    colour: Option<ColourAttributes>,
}

impl Attributes {
    fn new(scan: &e57::PointCloud) -> Self {
        let find = |name| scan.prototype.iter().position(|record| record.name == name);
        // Any prefix may stand for the extension.
        let find_normal = |wanted: &str| {
            let is = |name: &Name| matches!(name, Name::Unknown { name, .. } if name == wanted);
            scan.prototype.iter().position(|record| is(&record.name))
        };
        let all = |columns: [Option<usize>; 3]| match columns {
            [Some(a), Some(b), Some(c)] => Some([a, b, c]),
            _ => None,
        };
        Self {
            cartesian: all([Name::CartesianX, Name::CartesianY, Name::CartesianZ].map(find)),
            cartesian_state: find(Name::CartesianInvalidState),
            spherical: all([Name::SphericalRange, Name::SphericalAzimuth, Name::SphericalElevation].map(find)),
            spherical_state: find(Name::SphericalInvalidState),
            normal: all(["normalX", "normalY", "normalZ"].map(find_normal)),
            colour: all([Name::ColorRed, Name::ColorGreen, Name::ColorBlue].map(find)).map(|columns| {
                let state = find(Name::IsColorInvalid);
                ColourAttributes { columns, state, ranges: columns.map(|column| range_of(scan, column)) }
            }),
        }
    }

    /// A point's place in its scan; none if the file says that it has none.
    fn position(&self, point: &Values) -> e57::Result<Option<DVec3>> {
        if let Some(columns) = self.cartesian
            && point.is_valid(self.cartesian_state)?
        {
            return point.vector(columns).map(Some);
        }
        if let Some(columns) = self.spherical
            && point.is_valid(self.spherical_state)?
        {
            let [range, azimuth, elevation] = point.vector(columns)?.to_array();
            let (sin, cos) = elevation.sin_cos();
            let direction = DVec3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin);
            return Ok(Some(range * direction));
        }
        Ok(None)
    }
}

/// Places of a point's colour, and the ranges of its numbers.
struct ColourAttributes {
    columns: [usize; 3],
    state: Option<usize>,
    ranges: [[f64; 2]; 3],
}

impl ColourAttributes {
    /// A point's colour, 0 to 255; none if the file says that it has none.
    fn of_point(&self, point: &Values) -> e57::Result<Option<[f64; 3]>> {
        if !point.is_valid(self.state)? {
            return Ok(None);
        }
        let values = point.vector(self.columns)?.to_array();
        Ok(Some(std::array::from_fn(|channel| {
            let [least, most] = self.ranges[channel];
            255.0 * ((values[channel] - least) / (most - least)).clamp(0.0, 1.0)
        })))
    }
}

/// Smallest and largest value of a colour: the limits that the scan states, else those of the column's type, else 0 to 1.
fn range_of(scan: &e57::PointCloud, column: usize) -> [f64; 2] {
    let record = &scan.prototype[column];
    let limits = scan.color_limits.as_ref().map(|limits| match record.name {
        Name::ColorRed => (&limits.red_min, &limits.red_max),
        Name::ColorGreen => (&limits.green_min, &limits.green_max),
        _ => (&limits.blue_min, &limits.blue_max),
    });
    let number = |value: &Option<RecordValue>| value.as_ref()?.to_f64(&record.data_type).ok();
    let stated = limits.and_then(|(least, most)| number(least).zip(number(most)));
    let of_type = match record.data_type {
        RecordDataType::Integer { min, max } => Some((min as f64, max as f64)),
        RecordDataType::ScaledInteger { min, max, scale, offset } => {
            Some((min as f64 * scale + offset, max as f64 * scale + offset))
        }
        RecordDataType::Single { min, max } => min.zip(max).map(|(min, max)| (min.into(), max.into())),
        RecordDataType::Double { min, max } => min.zip(max),
    };
    let is_range = |(least, most): &(f64, f64)| least < most && (most - least).is_finite();
    let (least, most) = stated.filter(is_range).or(of_type.filter(is_range)).unwrap_or((0.0, 1.0));
    [least, most]
}

/// What the file holds of one point.
struct Values<'a> {
    values: &'a [RecordValue],
    prototype: &'a [Record],
}

impl Values<'_> {
    fn vector(&self, columns: [usize; 3]) -> e57::Result<DVec3> {
        let [x, y, z] = columns.map(|column| self.values[column].to_f64(&self.prototype[column].data_type));
        Ok(DVec3::new(x?, y?, z?))
    }

    /// Whether a state is 0, "valid"; 1 says that there is a direction only, 2 that there is nothing.
    fn is_valid(&self, state: Option<usize>) -> e57::Result<bool> {
        state.map_or(Ok(true), |column| {
            Ok(self.values[column].to_i64(&self.prototype[column].data_type)? == 0)
        })
    }
}

//! E57, written by the crate `e57`.

use e57::{
    E57Writer, Extension, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform, Translation,
};
use std::io::Cursor;

/// Bytes of a page, and of what it holds before its checksum.
const PAGE: usize = 1024;
const PAGE_DATA: usize = 1020;

/// A scan to be written.
#[derive(Clone, Debug)]
pub struct Scan {
    /// What a point has.
    pub prototype: Vec<Record>,
    /// The values of each point.
    pub points: Vec<Vec<RecordValue>>,
    /// From the scanner to the world.
    pub pose: Option<Transform>,
}

/// A file of scans, with the extension for normals declared.
#[must_use]
pub fn file(scans: Vec<Scan>) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, "file").unwrap();
    writer
        .register_extension(Extension::new("nor", "http://www.libe57.org/E57_NOR_surface_normals.txt"))
        .unwrap();
    for (index, scan) in scans.into_iter().enumerate() {
        let mut cloud = writer.add_pointcloud(&format!("scan {index}"), scan.prototype).unwrap();
        cloud.set_transform(scan.pose);
        scan.points.into_iter().for_each(|point| cloud.add_point(point).unwrap());
        cloud.finalize().unwrap();
    }
    writer.finalize().unwrap();
    drop(writer);
    bytes.into_inner()
}

/// A quarter turn about z, then 10 m along x.
#[must_use]
pub fn quarter_turn() -> Transform {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    Transform {
        rotation: Quaternion { w: half, x: 0.0, y: 0.0, z: half },
        translation: Translation { x: 10.0, y: 0.0, z: 0.0 },
    }
}

/// Three Cartesian points with normals, `(1, 2, 3)` and `(-2.5, 0, 0.5)` and between them an invalid one.
#[must_use]
pub fn cartesian(pose: Option<Transform>) -> Scan {
    let scaled = RecordDataType::ScaledInteger { min: -100_000, max: 100_000, scale: 0.001, offset: 1.0 };
    let normal = |name: &str| Record {
        name: RecordName::Unknown { namespace: "nor".to_owned(), name: name.to_owned() },
        data_type: RecordDataType::Single { min: Some(-1.0), max: Some(1.0) },
    };
    let mut prototype = vec![
        Record { name: RecordName::CartesianX, data_type: scaled },
        double(RecordName::CartesianY),
        double(RecordName::CartesianZ),
        state(RecordName::CartesianInvalidState),
        normal("normalX"),
        normal("normalY"),
        normal("normalZ"),
    ];
    // A value that is always the same takes no bits.
    prototype.push(integer(RecordName::RowIndex, 4, 4));
    let point = |x: i64, y: f64, z: f64, state: i64| {
        let [nx, ny, nz] = [0.0, 1.0, 0.0].map(RecordValue::Single);
        let (x, y, z) = (RecordValue::ScaledInteger(x), RecordValue::Double(y), RecordValue::Double(z));
        vec![x, y, z, RecordValue::Integer(state), nx, ny, nz, RecordValue::Integer(4)]
    };
    Scan {
        prototype,
        points: vec![point(0, 2.0, 3.0, 0), point(7, 7.0, 7.0, 2), point(-3500, 0.0, 0.5, 0)],
        pose,
    }
}

/// Points on a sphere of 2 m, the last one a direction only.
#[must_use]
pub fn spherical() -> Scan {
    let prototype = vec![
        double(RecordName::SphericalRange),
        double(RecordName::SphericalAzimuth),
        double(RecordName::SphericalElevation),
        state(RecordName::SphericalInvalidState),
    ];
    let half = std::f64::consts::FRAC_PI_2;
    let point = |azimuth: f64, elevation: f64, state: i64| {
        let [range, azimuth, elevation] = [2.0, azimuth, elevation].map(RecordValue::Double);
        vec![range, azimuth, elevation, RecordValue::Integer(state)]
    };
    let points = vec![point(0.0, 0.0, 0), point(half, 0.0, 0), point(1.0, half, 0), point(1.0, 1.0, 1)];
    Scan { prototype, points, pose: None }
}

/// Points `(i / 2, i - 5, i / 8)` for i from 0 to 9, a coordinate of each type but doubles, with times, intensities and colours of all
/// widths of bits.
#[must_use]
pub fn of_all_types() -> Scan {
    let single = |name| Record { name, data_type: RecordDataType::Single { min: None, max: None } };
    let scaled = RecordDataType::ScaledInteger { min: 0, max: 72, scale: 0.015_625, offset: 0.0 };
    let prototype = vec![
        integer(RecordName::IsIntensityInvalid, 0, 1),
        single(RecordName::CartesianX),
        integer(RecordName::ColorRed, 0, 255),
        integer(RecordName::CartesianY, -5, 4),
        integer(RecordName::ColorGreen, 0, 65_535),
        Record { name: RecordName::CartesianZ, data_type: scaled },
        integer(RecordName::ColorBlue, 0, i64::MAX),
        single(RecordName::Intensity),
        double(RecordName::TimeStamp),
    ];
    let point = |i: i64| {
        vec![
            RecordValue::Integer(i % 2),
            RecordValue::Single(i as f32 / 2.0),
            RecordValue::Integer(20 * i),
            RecordValue::Integer(i - 5),
            RecordValue::Integer(6000 * i),
            RecordValue::ScaledInteger(8 * i),
            RecordValue::Integer(i64::MAX - i),
            RecordValue::Single(0.5),
            RecordValue::Double(i as f64),
        ]
    };
    Scan { prototype, points: (0..10).map(point).collect(), pose: None }
}

fn double(name: RecordName) -> Record {
    Record { name, data_type: RecordDataType::Double { min: None, max: None } }
}

fn integer(name: RecordName, min: i64, max: i64) -> Record {
    Record { name, data_type: RecordDataType::Integer { min, max } }
}

fn state(name: RecordName) -> Record {
    integer(name, 0, 2)
}

/// Gives every whole page its checksum, so that a changed file is read further.
pub fn seal(file: &mut [u8]) {
    for page in file.chunks_exact_mut(PAGE) {
        let (data, checksum) = page.split_at_mut(PAGE_DATA);
        checksum.copy_from_slice(&crc32c(data).to_be_bytes());
    }
}

/// The Castagnoli CRC-32 of the standard.
fn crc32c(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, byte| (crc >> 8) ^ CRC_OF_BYTE[usize::from(crc as u8 ^ byte)])
}

/// What a byte does to the checksum. A fuzzer seals every input: without a table, that takes longer than the rest of its work.
const CRC_OF_BYTE: [u32; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = byte as u32;
        let mut bit = 0;
        while bit < 8 {
            crc = (crc >> 1) ^ if crc & 1 == 1 { 0x82f6_3b78 } else { 0 };
            bit += 1;
        }
        table[byte] = crc;
        byte += 1;
    }
    table
};

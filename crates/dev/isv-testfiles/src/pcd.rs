//! PCD in its three encodings, and LZF.

/// The header of a cloud of three points whose fields come in an odd order, types and number.
const BAROQUE: &str = "# .PCD v.7 - Point Cloud Data file format\nVERSION .7\n\
    FIELDS rgb z _ normal_z x descriptor y _ normal_x normal_y\nSIZE 4 8 1 4 2 4 4 1 4 8\n\
    TYPE U F U F I F F U F F\nCOUNT 1 1 4 1 1 3 1 0 1 1\nWIDTH 3\nHEIGHT 1\nVIEWPOINT 1 2 3 0.5 0.5 0.5 0.5\nPOINTS 3\n";

/// The bytes of each field of each point: x, y and z, then the normal.
fn baroque_fields() -> Vec<[Vec<u8>; 10]> {
    let points =
        [([-3i16, 7, 9], [0f32, 0.0, 2.0]), ([1, 2, 3], [f32::NAN; 3]), ([4, 5, 6], [0.0, -0.5, 0.0])];
    let fields = |([x, y, z], [nx, ny, nz]): ([i16; 3], [f32; 3])| {
        [
            vec![0xff; 4],
            f64::from(z).to_le_bytes().to_vec(),
            vec![0; 4],
            nz.to_le_bytes().to_vec(),
            x.to_le_bytes().to_vec(),
            vec![0x7f; 12],
            f32::from(y).to_le_bytes().to_vec(),
            vec![],
            nx.to_le_bytes().to_vec(),
            f64::from(ny).to_le_bytes().to_vec(),
        ]
    };
    points.map(fields).to_vec()
}

/// Three points, with normals and a viewpoint, in each encoding: text, binary, compressed.
#[must_use]
pub fn baroque_files() -> [Vec<u8>; 3] {
    let fields = baroque_fields();
    let rows = fields.iter().flatten().flatten().copied().collect::<Vec<u8>>();
    let columns: Vec<u8> =
        (0..10).flat_map(|field| fields.iter().flat_map(move |point| point[field].clone())).collect();
    let text = "7 9 0 0 0 0 2.0 -3 1 2 3 7 0 0\r\n\n# none\n8 3 0 0 0 0 nan 1 1 2 3 2 nan nan\n\
                9 6 0 0 0 0 0 4 1 2 3 5 0 -.5";
    [
        [BAROQUE.as_bytes(), b"DATA ascii\r\n", text.as_bytes()].concat(),
        [BAROQUE.as_bytes(), b"DATA binary\n", &rows].concat(),
        [BAROQUE.as_bytes(), b"DATA binary_compressed\n", &compressed(&columns)].concat(),
    ]
}

/// The body of a compressed file: two lengths and LZF.
#[must_use]
pub fn compressed(columns: &[u8]) -> Vec<u8> {
    let packed = lzf(columns);
    let lengths = [packed.len(), columns.len()].map(|bytes| (bytes as u32).to_le_bytes());
    [lengths.as_flattened(), &packed].concat()
}

/// LZF: each time the longest back reference, and literals where there is none.
#[must_use]
pub fn lzf(bytes: &[u8]) -> Vec<u8> {
    let (mut out, mut literals, mut at) = (Vec::new(), Vec::new(), 0);
    while at < bytes.len() {
        let (length, back) = longest_repeat(bytes, at);
        if length < 3 {
            literals.push(bytes[at]);
            at += 1;
            continue;
        }
        put_literals(&mut out, &mut literals);
        let offset = back - 1;
        match length - 2 {
            short @ ..7 => out.push((short << 5 | offset >> 8) as u8),
            long => out.extend([(7 << 5 | offset >> 8) as u8, (long - 7) as u8]),
        }
        out.push(offset as u8);
        at += length;
    }
    put_literals(&mut out, &mut literals);
    out
}

/// Length of what comes at a place and came before, and how far back that was.
fn longest_repeat(bytes: &[u8], at: usize) -> (usize, usize) {
    const MOST_BACK: usize = 1 << 13;
    const LONGEST: usize = 264;
    let repeats = |back: usize| {
        let pairs = bytes[at..].iter().zip(&bytes[at - back..]);
        pairs.take(LONGEST).take_while(|(a, b)| a == b).count()
    };
    (1..=at.min(MOST_BACK)).map(|back| (repeats(back), back)).max().unwrap_or_default()
}

fn put_literals(out: &mut Vec<u8>, literals: &mut Vec<u8>) {
    for run in literals.chunks(32) {
        out.push(run.len() as u8 - 1);
        out.extend(run);
    }
    literals.clear();
}

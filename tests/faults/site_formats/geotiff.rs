//! GeoTIFFs of every layout, written here byte by byte.

use super::*;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Sample {
    F32,
    F64,
    I16,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Packing {
    None,
    Deflate,
    Lzw,
}

/// How the raster says where it lies.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    Area,
    Point,
    /// A matrix that turns it by 20 degrees.
    Turned,
}

#[derive(Clone, Copy, Debug)]
struct Kind {
    sample: Sample,
    packing: Packing,
    predictor: bool,
    tiled: bool,
    place: Place,
}

const COLUMNS: usize = 40;
const ROWS: usize = 30;
const CELL_M: f64 = 2.0;
const ORIGIN: [f64; 2] = [2_600_000.25, 1_200_000.75];
/// No height there.
const HOLE: (usize, usize) = (25, 20);

/// Whole numbers, in one plane.
fn height(column: f64, row: f64) -> f64 {
    400.0 + 2.0 * column - 3.0 * row
}

/// Map coordinates of a place in the raster, columns and rows from the first height.
fn on_map(place: Place, column: f64, row: f64) -> DVec3 {
    let half = if place == Place::Point { 0.0 } else { 0.5 };
    let (x, y) = ((column + half) * CELL_M, -(row + half) * CELL_M);
    let turn = if place == Place::Turned { 20f64.to_radians() } else { 0.0 };
    let (sin, cos) = turn.sin_cos();
    DVec3::new(ORIGIN[0] + x * cos - y * sin, ORIGIN[1] + x * sin + y * cos, height(column, row))
}

fn zlib(data: &[u8]) -> Vec<u8> {
    let mut out = vec![0x78, 0x01];
    let blocks = data.chunks(60_000).count();
    for (i, block) in data.chunks(60_000).enumerate() {
        out.push(u8::from(i + 1 == blocks));
        let n = block.len() as u16;
        out.extend(n.to_le_bytes());
        out.extend((!n).to_le_bytes());
        out.extend(block);
    }
    let (mut a, mut b) = (1_u32, 0_u32);
    for &byte in data {
        a = (a + u32::from(byte)) % 65_521;
        b = (b + a) % 65_521;
    }
    out.extend((b << 16 | a).to_be_bytes());
    out
}

/// Literals of nine bits, and a clear before the codes would grow.
fn lzw(data: &[u8]) -> Vec<u8> {
    let mut codes = Vec::new();
    for part in data.chunks(200) {
        codes.push(256_u32);
        codes.extend(part.iter().map(|&b| u32::from(b)));
    }
    codes.push(257);
    let (mut out, mut bits, mut count) = (Vec::new(), 0_u32, 0);
    for code in codes {
        bits = bits << 9 | code;
        count += 9;
        while count >= 8 {
            count -= 8;
            out.push((bits >> count) as u8);
            bits &= (1 << count) - 1;
        }
    }
    out.push((bits << (8 - count)) as u8);
    out
}

/// The bytes of a strip or tile, row by row; beyond the raster are zeros.
fn chunk(kind: Kind, [x0, y0]: [usize; 2], [width, rows]: [usize; 2]) -> Vec<u8> {
    let mut out = Vec::new();
    for y in y0..y0 + rows {
        let values: Vec<f64> = (x0..x0 + width)
            .map(|x| match (x, y) {
                _ if x >= COLUMNS || y >= ROWS => 0.0,
                HOLE => -9999.0,
                _ => height(x as f64, y as f64),
            })
            .collect();
        match kind.sample {
            Sample::I16 => {
                let mut last = 0_i16;
                for v in values {
                    let v = v as i16;
                    out.extend(
                        (if kind.predictor { v.wrapping_sub(last) } else { v }).to_le_bytes(),
                    );
                    last = v;
                }
            }
            Sample::F32 => {
                let raw: Vec<[u8; 4]> = values.iter().map(|&v| (v as f32).to_le_bytes()).collect();
                out.extend(float_row(&raw, kind.predictor));
            }
            Sample::F64 => {
                let raw: Vec<[u8; 8]> = values.iter().map(|v| v.to_le_bytes()).collect();
                out.extend(float_row(&raw, kind.predictor));
            }
        }
    }
    match kind.packing {
        Packing::None => out,
        Packing::Deflate => zlib(&out),
        Packing::Lzw => lzw(&out),
    }
}

/// Adobe's floating point predictor: the bytes by significance, then their differences.
fn float_row<const N: usize>(raw: &[[u8; N]], predictor: bool) -> Vec<u8> {
    if !predictor {
        return raw.concat();
    }
    let mut out: Vec<u8> = (0..N).rev().flat_map(|k| raw.iter().map(move |v| v[k])).collect();
    for i in (1..out.len()).rev() {
        out[i] = out[i].wrapping_sub(out[i - 1]);
    }
    out
}

/// Type, count and bytes of a tag.
type Entry = (u16, u32, Vec<u8>);

fn tiff(kind: Kind) -> Vec<u8> {
    let size = if kind.tiled { [16, 16] } else { [COLUMNS, 7] };
    let mut data = Vec::new();
    let (mut offsets, mut counts) = (Vec::new(), Vec::new());
    for y in (0..ROWS).step_by(size[1]) {
        for x in (0..COLUMNS).step_by(size[0]) {
            let rows = if kind.tiled { size[1] } else { size[1].min(ROWS - y) };
            let bytes = chunk(kind, [x, y], [size[0], rows]);
            offsets.push(8 + data.len() as u32);
            counts.push(bytes.len() as u32);
            data.extend(bytes);
            data.resize(data.len().next_multiple_of(8), 0);
        }
    }
    let short =
        |v: &[u16]| (3_u16, v.len() as u32, v.iter().flat_map(|v| v.to_le_bytes()).collect());
    let long =
        |v: &[u32]| (4_u16, v.len() as u32, v.iter().flat_map(|v| v.to_le_bytes()).collect());
    let real =
        |v: &[f64]| (12_u16, v.len() as u32, v.iter().flat_map(|v| v.to_le_bytes()).collect());
    let text = |v: &str| (2_u16, v.len() as u32 + 1, [v.as_bytes(), &[0]].concat());
    let (bits, format) = match kind.sample {
        Sample::F32 => (32, 3),
        Sample::F64 => (64, 3),
        Sample::I16 => (16, 2),
    };
    let compression = match kind.packing {
        Packing::None => 1,
        Packing::Deflate => 8,
        Packing::Lzw => 5,
    };
    let raster = if kind.place == Place::Point { 2 } else { 1 };
    let mut tags: Vec<(u16, Entry)> = vec![
        (256, long(&[COLUMNS as u32])),
        (257, long(&[ROWS as u32])),
        (258, short(&[bits])),
        (259, short(&[compression])),
        (262, short(&[1])),
        (277, short(&[1])),
        (339, short(&[format])),
        (42113, text("-9999")),
        (34735, short(&[1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, raster, 3072, 0, 1, 2056])),
    ];
    if kind.predictor {
        tags.push((317, short(&[if kind.sample == Sample::I16 { 2 } else { 3 }])));
    }
    if kind.tiled {
        let [width, rows] = size.map(|v| v as u32);
        tags.extend([(322, long(&[width])), (323, long(&[rows]))]);
        tags.extend([(324, long(&offsets)), (325, long(&counts))]);
    } else {
        tags.push((278, long(&[size[1] as u32])));
        tags.extend([(273, long(&offsets)), (279, long(&counts))]);
    }
    if kind.place == Place::Turned {
        let (sin, cos) = 20f64.to_radians().sin_cos();
        let (a, b) = (CELL_M * cos, CELL_M * sin);
        let [x, y] = ORIGIN;
        let matrix = [a, b, 0., x, b, -a, 0., y, 0., 0., 0., 0., 0., 0., 0., 1.];
        tags.push((34264, real(&matrix)));
    } else {
        tags.push((33550, real(&[CELL_M, CELL_M, 0.0])));
        tags.push((33922, real(&[0.0, 0.0, 0.0, ORIGIN[0], ORIGIN[1], 0.0])));
    }
    tags.sort_by_key(|t| t.0);
    let mut out = b"II*\0".to_vec();
    let directory = 8 + data.len();
    out.extend((directory as u32).to_le_bytes());
    out.extend(data);
    let mut beyond = directory + 2 + 12 * tags.len() + 4;
    out.extend((tags.len() as u16).to_le_bytes());
    let mut rest = Vec::new();
    for (tag, (kind, count, bytes)) in tags {
        out.extend(tag.to_le_bytes());
        out.extend(kind.to_le_bytes());
        out.extend(count.to_le_bytes());
        if bytes.len() <= 4 {
            let mut bytes = bytes;
            bytes.resize(4, 0);
            out.extend(bytes);
        } else {
            out.extend((beyond as u32).to_le_bytes());
            beyond += bytes.len();
            rest.extend(bytes);
        }
    }
    out.extend([0; 4]);
    out.extend(rest);
    out
}

#[test]
fn geotiffs_of_every_layout_stand_where_they_say() {
    let mut tried = 0;
    for i in 0..108 {
        let kind = Kind {
            sample: [Sample::F32, Sample::F64, Sample::I16][i % 3],
            packing: [Packing::None, Packing::Deflate, Packing::Lzw][i / 3 % 3],
            predictor: i / 9 % 2 == 1,
            tiled: i / 18 % 2 == 1,
            place: [Place::Area, Place::Point, Place::Turned][i / 36],
        };
        // Without compression nothing is predicted.
        if kind.predictor && kind.packing == Packing::None {
            continue;
        }
        let files = SceneFiles::in_memory([("t.tif", tiff(kind))]);
        let loaded = load_from(&files, &SceneSpec::of(["t.tif"]), &[])
            .unwrap_or_else(|e| panic!("{kind:?}: {e}"));
        assert_eq!(loaded.crs.as_deref(), Some("EPSG:2056"), "{kind:?}");
        let site = &loaded.site;
        let at = |column: f64, row: f64| on_map(kind.place, column, row) - site.origin;
        for (column, row) in [(0.3, 0.6), (12.5, 3.25), (38.7, 28.4), (3.0, 28.9), (24.0, 18.5)] {
            let p = at(column, row);
            let z = ground(site, p.x as f32, p.y as f32).unwrap_or_else(|| panic!("{kind:?} {p}"));
            assert!(
                (f64::from(z) - p.z).abs() < 2e-3,
                "{kind:?} at {column}, {row}: {z}, not {}",
                p.z
            );
        }
        let hole = at(HOLE.0 as f64, HOLE.1 as f64);
        assert_eq!(ground(site, hole.x as f32, hole.y as f32), None, "{kind:?}");
        tried += 1;
    }
    assert_eq!(tried, 90);
}

/// Some to be damaged.
pub(super) fn seeds() -> [Vec<u8>; 2] {
    let tiles = Kind {
        sample: Sample::F32,
        packing: Packing::Lzw,
        predictor: true,
        tiled: true,
        place: Place::Turned,
    };
    let (sample, packing) = (Sample::I16, Packing::Deflate);
    [tiff(tiles), tiff(Kind { sample, packing, tiled: false, place: Place::Point, ..tiles })]
}

//! The format page and the code, held together.

use super::*;

const DOC: &str = include_str!("../gmp.md");

/// The rows `| offset | bytes | type | field |` of the table below a line.
fn table(after: &str) -> Vec<(usize, usize, String)> {
    let (_, rest) = DOC.split_once(after).expect("the format page has this line");
    let rows = rest.lines().skip_while(|l| !l.starts_with("| 0 |"));
    rows.take_while(|l| l.starts_with('|'))
        .map(|row| {
            let cells: Vec<&str> = row.split('|').map(str::trim).collect();
            let number = |cell: &str| cell.parse().expect("a number");
            (number(cells[1]), number(cells[2]), cells[4].to_owned())
        })
        .collect()
}

/// Rows follow each other without gaps up to `end`; returns where a field begins.
fn offsets(after: &str, end: usize) -> impl Fn(&str) -> usize {
    let rows = table(after);
    let mut at = 0;
    for (offset, bytes, field) in &rows {
        assert_eq!(*offset, at, "{after} {field}");
        at += bytes;
    }
    assert_eq!(at, end, "{after}");
    move |name| rows.iter().find(|(_, _, field)| field == name).expect("a field").0
}

fn float(bytes: &[u8], at: usize) -> f32 {
    f32::from_bits(word(bytes, at))
}

fn long(bytes: &[u8], at: usize) -> u64 {
    u64::from(word(bytes, at)) | u64::from(word(bytes, at + 4)) << 32
}

#[test]
fn the_directory_lies_as_the_format_page_says() {
    let node = Node {
        min: [1.0, 2.0, 3.0],
        max: [4.0, 5.0, 6.0],
        level: 7,
        first_child: 8,
        children: 9,
        first_page: 10,
        pages: 11,
    };
    let page = PageEntry {
        min: [1.5, 2.5, 3.5],
        max: [4.5, 5.5, 6.5],
        first_photon: 1 << 40,
        offset: 1 << 41,
        length: 12,
        photons: 13,
        first_cell: 1 << 42,
        last_cell: 1 << 43,
        checksum: 14,
        reserved: 0,
    };
    let bytes = encode_directory(&[node], &[page]).expect("encodes");
    assert_eq!(decode_directory(&bytes, 1, 1).expect("decodes"), (vec![node], vec![page]));
    assert!(decode_directory(&bytes, 2, 1).is_err());
    assert!(decode_directory(&bytes, u64::MAX, u64::MAX).is_err());
    let (first, second) = bytes.split_at(NODE_BYTES);
    let at = offsets("Node, 44 bytes:", NODE_BYTES);
    for axis in 0..3 {
        assert_eq!(float(first, at("min") + 4 * axis), node.min[axis]);
        assert_eq!(float(first, at("max") + 4 * axis), node.max[axis]);
    }
    assert_eq!(word(first, at("level")), node.level);
    assert_eq!(word(first, at("first_child")), node.first_child);
    assert_eq!(word(first, at("children")), node.children);
    assert_eq!(word(first, at("first_page")), node.first_page);
    assert_eq!(word(first, at("pages")), node.pages);
    let at = offsets("Page entry, 72 bytes:", ENTRY_BYTES);
    for axis in 0..3 {
        assert_eq!(float(second, at("min") + 4 * axis), page.min[axis]);
        assert_eq!(float(second, at("max") + 4 * axis), page.max[axis]);
    }
    assert_eq!(long(second, at("first_photon")), page.first_photon);
    assert_eq!(long(second, at("offset")), page.offset);
    assert_eq!(word(second, at("length")), page.length);
    assert_eq!(word(second, at("photons")), page.photons);
    assert_eq!(long(second, at("first_cell")), page.first_cell);
    assert_eq!(long(second, at("last_cell")), page.last_cell);
    assert_eq!(word(second, at("checksum")), page.checksum);
    assert_eq!(word(second, at("reserved")), page.reserved);
}

fn columns(count: u64, flux: Flux) -> Columns {
    let noise = |i: u64| (i + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 16;
    let mut position: Vec<u64> = (0..count).map(noise).collect();
    position.sort_unstable();
    let pair = |i: u64| [noise(i) as i16, noise(i + 99) as i16];
    Columns {
        origin: [-1.0, 2.0, 3.0],
        step: 1e-4,
        position,
        normal_table: (0..count.min(3)).map(pair).collect(),
        normal: (0..count).map(|i| (i % count.min(3)) as u16).collect(),
        direction: (0..count).map(pair).collect(),
        flux,
        timestep: (0..count).map(|i| 70 + (noise(i) % 1000) as u32).collect(),
        surface: (0..count).map(|i| (i / 9) as u16).collect(),
    }
}

#[test]
fn a_page_lies_as_the_format_page_says_and_comes_back() {
    let mut encoder = Encoder::new().expect("a context");
    let mut decoder = Decoder::new().expect("a context");
    for count in [1u64, 2, 127, 1000, 8192] {
        let codes: Vec<u32> = (0..count).map(|i| 0x3_F000 + i as u32 % 700).collect();
        for flux in [Flux::Equal(1.5f32.to_bits()), Flux::Codes(codes)] {
            let columns = columns(count, flux);
            let bytes = encoder.page(&columns).expect("encodes");
            assert_eq!(decoder.page(&bytes).expect("decodes"), columns);
            let at = offsets("## Page\n", PAGE_HEAD_BYTES);
            assert_eq!(word(&bytes, at("checksum")), crc32c(&bytes[4..]));
            assert_eq!(word(&bytes, at("photons")), count as u32);
            assert_eq!(word(&bytes, at("normals")), columns.normal_table.len() as u32);
            for axis in 0..3 {
                assert_eq!(float(&bytes, at("origin") + 4 * axis), columns.origin[axis]);
            }
            assert_eq!(float(&bytes, at("step")), columns.step);
            let (flags, flux) = match columns.flux {
                Flux::Equal(bits) => (1, bits),
                Flux::Codes(_) => (0, 0x3_F000),
            };
            assert_eq!((word(&bytes, at("flags")), word(&bytes, at("flux"))), (flags, flux));
            let first = columns.timestep.iter().min().expect("one");
            assert_eq!(word(&bytes, at("timestep")), *first);
            let planes: u32 = (0..PLANES).map(|p| word(&bytes, at("planes") + 4 * p)).sum();
            assert_eq!(PAGE_HEAD_BYTES + planes as usize, bytes.len());
        }
    }
}

#[test]
fn the_planes_are_those_of_the_format_page() {
    let (_, rest) = DOC.split_once("| planes | column |").expect("the table");
    let rows = rest.lines().filter(|l| l.starts_with("| ") && l.contains("| photons |"));
    let sum: usize = rows
        .map(|row| row.split('|').nth(1).map_or(0, |n| n.trim().parse().expect("a number")))
        .sum();
    assert_eq!(sum + NORMAL_TABLE_PLANES, PLANES);
}

/// With a checksum that holds, the content is checked for itself: nothing panics, and what
/// the decoder lets through is in range.
#[test]
fn pages_that_lie_are_refused_or_in_range() {
    let mut encoder = Encoder::new().expect("a context");
    let mut decoder = Decoder::new().expect("a context");
    let codes: Vec<u32> = (0..500).map(|i| 0x3_F000 + i % 700).collect();
    let sound = encoder.page(&columns(500, Flux::Codes(codes))).expect("encodes");
    let mut refused = 0;
    for at in 4..sound.len() {
        for bit in [0, 3, 7] {
            let mut bytes = sound.clone();
            bytes[at] ^= 1 << bit;
            let sum = crc32c(&bytes[4..]);
            bytes[..4].copy_from_slice(&sum.to_le_bytes());
            match decoder.page(&bytes) {
                Err(_) => refused += 1,
                Ok(columns) => {
                    assert!(columns.position.is_sorted() && columns.position[499] >> 48 == 0);
                    let normals = columns.normal_table.len();
                    assert!(columns.normal.iter().all(|&n| usize::from(n) < normals));
                    assert!(columns.origin.iter().all(|v| v.is_finite()));
                }
            }
        }
    }
    assert!(refused > 100, "{refused}");
    for short in 0..sound.len() {
        assert!(decoder.page(&sound[..short]).is_err());
    }
}

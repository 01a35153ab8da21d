use std::path::Path;

use glintmap_formats::seal;

use super::rgbe::rgbe_from_color;
use crate::picture::Error;
use crate::picture::channels::{Rgb, check_size};

/// Shortest run that is worth its two bytes.
const MIN_RUN: usize = 4;

/// Writes a picture, run-length encoded, with `header_lines` (`VIEW= -vtl …`, `SOFTWARE=…`) in
/// its header.
///
/// # Errors
/// [`Error::Setting`] for header lines that would end the header or contradict it, [`Error::Io`].
pub fn write(path: &Path, picture: &Rgb, header_lines: &[String]) -> Result<(), Error> {
    let bytes = encode(path, picture, header_lines)?;
    seal::write_bytes(path, &bytes).map_err(Error::write(path))
}

/// [`write()`] into memory; `path` is for messages.
///
/// # Errors
/// As [`write()`].
pub fn encode(path: &Path, picture: &Rgb, header_lines: &[String]) -> Result<Vec<u8>, Error> {
    let (columns, rows) = (picture.columns(), picture.rows());
    check_size(path, columns as u64, rows as u64, 3)?;
    let mut out = b"#?RADIANCE\n".to_vec();
    for line in header_lines {
        let ours = ["FORMAT=", "EXPOSURE=", "COLORCORR="].iter().any(|p| line.starts_with(p));
        if line.is_empty() || line.contains(['\n', '\r', '\0']) || ours {
            return Err(Error::Setting {
                option: "header line",
                value: line.clone(),
                what: "expected one line of text that doesn't change format or exposure".into(),
            });
        }
        out.extend_from_slice(line.as_bytes());
        out.push(b'\n');
    }
    out.extend_from_slice(format!("FORMAT=32-bit_rle_rgbe\n\n-Y {rows} +X {columns}\n").as_bytes());
    for row in 0..rows {
        let pixels: Vec<[u8; 4]> =
            picture.row(row).iter().map(|&color| rgbe_from_color(color)).collect();
        write_scanline(&mut out, &pixels);
    }
    Ok(out)
}

fn write_scanline(out: &mut Vec<u8>, pixels: &[[u8; 4]]) {
    if !(8..=0x7fff).contains(&pixels.len()) {
        // Too narrow or too wide for the newer encoding: flat. No pixel of ours is 1, 1, 1, so
        // none is taken for a repetition: the largest mantissa is 128 at least.
        out.extend(pixels.iter().flatten());
        return;
    }
    let [_, _, high, low] = (pixels.len() as u32).to_be_bytes();
    out.extend_from_slice(&[2, 2, high, low]);
    for channel in 0..4 {
        let bytes: Vec<u8> = pixels.iter().map(|p| p[channel]).collect();
        write_runs(out, &bytes);
    }
}

fn write_runs(out: &mut Vec<u8>, bytes: &[u8]) {
    let mut at = 0;
    while at < bytes.len() {
        // The next run that is long enough, and what comes before it as it is.
        let mut start = at;
        let mut length = 0;
        while start < bytes.len() {
            let rest = &bytes[start..bytes.len().min(start + 127)];
            length = rest.iter().take_while(|&&b| b == rest[0]).count();
            if length >= MIN_RUN {
                break;
            }
            start += length;
            length = 0;
        }
        for literal in bytes[at..start].chunks(128) {
            out.push(literal.len() as u8);
            out.extend_from_slice(literal);
        }
        if length > 0 {
            out.extend_from_slice(&[128 + length as u8, bytes[start]]);
        }
        at = start + length;
    }
}

#[cfg(test)]
mod tests {
    use super::super::{color_from_rgbe, decode};
    use super::*;
    use crate::base::{Grid, Purpose, Stream};

    #[test]
    fn round_trips_are_exact_within_the_format() {
        let mut random = Stream::new(7, Purpose::Survey, 0);
        for columns in [1, 3, 7, 8, 9, 127, 128, 129, 300, 0x7fff, 0x8000] {
            for levels in [1, 2, 9, 400] {
                let data: Vec<[f32; 3]> = (0..columns * 2)
                    .map(|_| {
                        let level = (random.uniform() * levels as f64) as i32;
                        [level as f32 * 0.37, (level % 3) as f32, 1e-3]
                    })
                    .collect();
                let picture = Grid::from_vec(columns, 2, data);
                let path = Path::new("memory.hdr");
                let bytes = encode(path, &picture, &["VIEW= -vtl".into()]).expect("encodes");
                let (back, header) = decode(path, &bytes).expect("decodes");
                let rounded = picture.map(|&c| color_from_rgbe(rgbe_from_color(c)));
                assert!(back == rounded, "{columns} columns, {levels} levels");
                assert_eq!(header.views, ["-vtl"]);
            }
        }
    }

    #[test]
    fn lines_that_would_break_the_header_are_refused() {
        let picture = Grid::filled(2, 2, [1.0f32; 3]);
        for line in ["", "a\n\nb", "FORMAT=none", "EXPOSURE=2"] {
            assert!(encode(Path::new("x"), &picture, &[line.into()]).is_err(), "{line:?}");
        }
    }
}

//! Reads Radiance pictures (RGBE), in all orientations and both run-length encodings.
//!
//! The header is text up to an empty line; `EXPOSURE=` lines multiply, and pixels are divided by
//! the product, so that what is returned are the values before any adjustment. The resolution line
//! says how the pixels lie (`-Y 20 +X 80` is usual), and the picture is turned accordingly.
//! Scanlines are claims: a run that leaves its line is damage, not a reason to grow. After Ward
//! 1991, "Real pixels" (Graphics Gems II), and Radiance's `color.c`.

use std::fs;
use std::path::Path;

use super::rgbe::color_from_rgbe;
use crate::base::Grid;
use crate::picture::Error;
use crate::picture::channels::{Rgb, check_length, check_size};

/// Longest header that is taken for one.
const MAX_HEADER_BYTES: usize = 1 << 20;
/// Widths that the newer run-length encoding covers.
const NEW_RLE_WIDTHS: std::ops::RangeInclusive<usize> = 8..=0x7fff;

/// What a Radiance picture says about itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Header {
    /// Product of all EXPOSURE lines; the pixels were divided by it.
    pub exposure: f64,
    /// The options of the VIEW= lines, in order; the last one holds.
    pub views: Vec<String>,
    /// Every other line of the header, history (indented lines) included.
    pub lines: Vec<String>,
}

/// Reads a picture; the values are those before any exposure adjustment (as `pvalue -o` prints),
/// row 0 at the top, column 0 at the left, whatever the file's orientation.
///
/// # Errors
/// [`Error::Io`], [`Error::Malformed`], [`Error::Unsupported`] for XYZE colours,
/// [`Error::TooLarge`].
pub fn read(path: &Path) -> Result<(Rgb, Header), Error> {
    let bytes = fs::read(path).map_err(Error::read(path))?;
    decode(path, &bytes)
}

/// [`read`] from memory; `path` is for messages.
///
/// # Errors
/// As [`read`].
pub fn decode(path: &Path, bytes: &[u8]) -> Result<(Rgb, Header), Error> {
    let mut input = Input { path, bytes, at: 0 };
    let (header, correction) = read_header(&mut input)?;
    let resolution = Resolution::read(&mut input)?;
    let (width, height) = check_size(path, resolution.length as u64, resolution.lines as u64, 3)?;
    // A line takes four bytes at least, whatever its encoding.
    let least = (input.at + 4 * height) as u64;
    check_length(path, (width as u64, height as u64, 3), least, bytes.len() as u64)?;

    let mut scanline = vec![[0u8; 4]; width];
    let mut lines: Vec<[f32; 3]> = Vec::new();
    for line in 0..height {
        read_scanline(&mut input, &mut scanline, line)?;
        lines.extend(scanline.iter().map(|&pixel| {
            let color = color_from_rgbe(pixel);
            if correction == [1.0; 3] {
                return color;
            }
            [0, 1, 2].map(|c| (f64::from(color[c]) / correction[c]) as f32)
        }));
    }
    Ok((resolution.upright(width, height, lines), header))
}

struct Input<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
}

impl Input<'_> {
    fn wrong(&self, what: &str) -> Error {
        Error::malformed(self.path, format!("byte {}: {what}", self.at))
    }

    fn line(&mut self, what: &str) -> Result<String, Error> {
        let rest = &self.bytes[self.at.min(self.bytes.len())..];
        let rest = &rest[..rest.len().min(MAX_HEADER_BYTES)];
        let Some(end) = rest.iter().position(|&b| b == b'\n') else {
            return Err(self.wrong(&format!("expected {what}, found no end of line")));
        };
        self.at += end + 1;
        let line = rest[..end].strip_suffix(b"\r").unwrap_or(&rest[..end]);
        Ok(String::from_utf8_lossy(line).into_owned())
    }

    fn pixel(&mut self, line: usize) -> Result<[u8; 4], Error> {
        match self.bytes.get(self.at..self.at + 4) {
            Some(&[r, g, b, e]) => {
                self.at += 4;
                Ok([r, g, b, e])
            }
            _ => Err(self.wrong(&format!("the file ends in scan line {line}"))),
        }
    }

    fn byte(&mut self, line: usize) -> Result<u8, Error> {
        let Some(&byte) = self.bytes.get(self.at) else {
            return Err(self.wrong(&format!("the file ends in scan line {line}")));
        };
        self.at += 1;
        Ok(byte)
    }
}

fn read_header(input: &mut Input<'_>) -> Result<(Header, [f64; 3]), Error> {
    let mut header = Header { exposure: 1.0, ..Header::default() };
    let mut correction = [1.0; 3];
    let mut format = None;
    if !input.bytes.starts_with(b"#?") {
        return Err(input.wrong("expected a Radiance picture, which begins with `#?RADIANCE`"));
    }
    input.line("the first line")?;
    loop {
        let line = input.line("a line of the header, or an empty one to end it")?;
        if line.is_empty() {
            break;
        }
        if input.at > MAX_HEADER_BYTES {
            return Err(input.wrong("the header doesn't end within 1 MiB"));
        }
        // Indented lines are the headers of the pictures that this one was made from.
        let history = line.starts_with(['\t', ' ']);
        let value = |name: &str| {
            if history { None } else { line.strip_prefix(name).map(|v| v.trim().to_owned()) }
        };
        let positive = |text: &str| text.parse::<f64>().ok().filter(|v| v.is_normal() && *v > 0.0);
        if let Some(text) = value("EXPOSURE=") {
            let factor = positive(&text).ok_or_else(|| {
                input.wrong(&format!("EXPOSURE= needs a positive number, found `{text}`"))
            })?;
            header.exposure *= factor;
        } else if let Some(text) = value("COLORCORR=") {
            let factors: Vec<f64> = text.split_whitespace().filter_map(positive).collect();
            let &[r, g, b] = factors.as_slice() else {
                let what = format!("COLORCORR= needs three positive numbers, found `{text}`");
                return Err(input.wrong(&what));
            };
            for (c, factor) in correction.iter_mut().zip([r, g, b]) {
                *c *= factor;
            }
            header.lines.push(line);
        } else if let Some(text) = value("VIEW=") {
            header.views.push(text);
        } else if let Some(text) = value("FORMAT=") {
            format = Some(text);
        } else {
            header.lines.push(line);
        }
    }
    match format.as_deref() {
        Some("32-bit_rle_rgbe") => {}
        Some("32-bit_rle_xyze") => {
            return Err(Error::unsupported(
                input.path,
                "holds XYZ colours; convert it with Radiance's `ra_xyze -r` first",
            ));
        }
        Some(other) => {
            return Err(input.wrong(&format!("expected FORMAT=32-bit_rle_rgbe, found `{other}`")));
        }
        None => return Err(input.wrong("the header has no FORMAT= line")),
    }
    let correction = correction.map(|c| c * header.exposure);
    if !header.exposure.is_normal() || correction.iter().any(|c| !c.is_normal()) {
        return Err(input.wrong("the product of the EXPOSURE lines is no usable number"));
    }
    Ok((header, correction))
}

/// The line that says size and orientation: `-Y 480 +X 640` is upright. The first axis numbers
/// the scan lines, the second the pixels of a line; a minus at Y, a plus at X are upright.
struct Resolution {
    lines: usize,
    length: usize,
    columns_first: bool,
    x_falls: bool,
    y_rises: bool,
}

impl Resolution {
    fn read(input: &mut Input<'_>) -> Result<Self, Error> {
        let line = input.line("the resolution, such as `-Y 480 +X 640`")?;
        let wrong = || {
            input.wrong(&format!("expected a resolution such as `-Y 480 +X 640`, found `{line}`"))
        };
        let words: Vec<&str> = line.split_whitespace().collect();
        let &[first, lines, second, length] = words.as_slice() else { return Err(wrong()) };
        let count = |word: &str| word.parse::<u32>().ok().filter(|&n| n > 0).map(|n| n as usize);
        let (Some(lines), Some(length)) = (count(lines), count(length)) else {
            return Err(wrong());
        };
        let axis = |word: &str| match word {
            "+X" => Some(('x', true)),
            "-X" => Some(('x', false)),
            "+Y" => Some(('y', true)),
            "-Y" => Some(('y', false)),
            _ => None,
        };
        let (columns_first, x, y) = match (axis(first), axis(second)) {
            (Some(('y', y)), Some(('x', x))) => (false, x, y),
            (Some(('x', x)), Some(('y', y))) => (true, x, y),
            _ => return Err(wrong()),
        };
        Ok(Self { lines, length, columns_first, x_falls: !x, y_rises: y })
    }

    /// Turns scan lines in the file's order into an upright picture.
    fn upright(&self, length: usize, lines: usize, data: Vec<[f32; 3]>) -> Rgb {
        let (columns, rows) = if self.columns_first { (lines, length) } else { (length, lines) };
        if !self.columns_first && !self.x_falls && !self.y_rises {
            return Grid::from_vec(columns, rows, data);
        }
        let mut out = Grid::filled(columns, rows, [0.0f32; 3]);
        for (at, color) in data.into_iter().enumerate() {
            let (line, place) = (at / length, at % length);
            let (x, y) = if self.columns_first { (line, place) } else { (place, line) };
            let x = if self.x_falls { columns - 1 - x } else { x };
            let y = if self.y_rises { rows - 1 - y } else { y };
            out[(x, y)] = color;
        }
        out
    }
}

fn read_scanline(input: &mut Input<'_>, out: &mut [[u8; 4]], line: usize) -> Result<(), Error> {
    let start = input.at;
    let first = input.pixel(line)?;
    let marked = first[0] == 2 && first[1] == 2 && first[2] < 128;
    if !(NEW_RLE_WIDTHS.contains(&out.len()) && marked) {
        input.at = start;
        return read_old_scanline(input, out, line);
    }
    let claimed = usize::from(first[2]) << 8 | usize::from(first[3]);
    if claimed != out.len() {
        let what = format!("scan line {line} claims {claimed} pixels, expected {}", out.len());
        return Err(input.wrong(&what));
    }
    for channel in 0..4 {
        let mut at = 0;
        while at < out.len() {
            let code = usize::from(input.byte(line)?);
            let (count, run) = if code > 128 { (code & 127, true) } else { (code, false) };
            if count == 0 || count > out.len() - at {
                return Err(input.wrong(&format!("a run in scan line {line} has {count} pixels")));
            }
            if run {
                let value = input.byte(line)?;
                out[at..at + count].iter_mut().for_each(|p| p[channel] = value);
            } else {
                for pixel in &mut out[at..at + count] {
                    pixel[channel] = input.byte(line)?;
                }
            }
            at += count;
        }
    }
    Ok(())
}

/// The encoding before 1991, and flat pixels: a pixel of 1, 1, 1 repeats the one before, as often
/// as its exponent says; several in a row are the digits of one number.
fn read_old_scanline(input: &mut Input<'_>, out: &mut [[u8; 4]], line: usize) -> Result<(), Error> {
    let (mut at, mut shift) = (0, 0u32);
    while at < out.len() {
        let pixel = input.pixel(line)?;
        let [1, 1, 1, digit] = pixel else {
            out[at] = pixel;
            at += 1;
            shift = 0;
            continue;
        };
        let count = usize::from(digit).checked_shl(shift).unwrap_or(usize::MAX);
        if at == 0 || shift > 16 || count > out.len() - at {
            return Err(input.wrong(&format!("a repetition in scan line {line} goes beyond it")));
        }
        let before = out[at - 1];
        out[at..at + count].fill(before);
        at += count;
        shift += 8;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, resolution: &str, pixels: &[u8]) -> Vec<u8> {
        let mut out =
            format!("#?RADIANCE\n{header}FORMAT=32-bit_rle_rgbe\n\n{resolution}\n").into_bytes();
        out.extend_from_slice(pixels);
        out
    }

    fn path() -> &'static Path {
        Path::new("memory.hdr")
    }

    #[test]
    fn exposures_multiply_and_history_counts_for_nothing() {
        let header = "\tEXPOSURE=100\n EXPOSURE=7\nEXPOSURE=2\nVIEW= -vtv -vh 40\nEXPOSURE= 4.0\n\tVIEW= -vta\n";
        let (rgb, about) =
            decode(path(), &file(header, "-Y 1 +X 1", &[127, 63, 0, 129])).expect("reads");
        assert_eq!(about.exposure, 8.0);
        assert_eq!(about.views, ["-vtv -vh 40"]);
        assert_eq!(about.lines.len(), 3);
        assert_eq!(rgb[(0, 0)], [127.5 / 1024.0, 63.5 / 1024.0, 0.5 / 1024.0]);
    }

    #[test]
    fn all_eight_orientations_come_out_upright() {
        // Upright:  1 2 3
        //           4 5 6
        let cases = [
            ("-Y 2 +X 3", [1, 2, 3, 4, 5, 6]),
            ("-Y 2 -X 3", [3, 2, 1, 6, 5, 4]),
            ("+Y 2 +X 3", [4, 5, 6, 1, 2, 3]),
            ("+Y 2 -X 3", [6, 5, 4, 3, 2, 1]),
            ("+X 3 -Y 2", [1, 4, 2, 5, 3, 6]),
            ("+X 3 +Y 2", [4, 1, 5, 2, 6, 3]),
            ("-X 3 -Y 2", [3, 6, 2, 5, 1, 4]),
            ("-X 3 +Y 2", [6, 3, 5, 2, 4, 1]),
        ];
        for (resolution, order) in cases {
            let pixels: Vec<u8> = order.iter().flat_map(|&n| [n * 20, 0, 0, 136]).collect();
            let (rgb, _) = decode(path(), &file("", resolution, &pixels)).expect(resolution);
            assert_eq!((rgb.columns(), rgb.rows()), (3, 2));
            let seen: Vec<f32> = rgb.data().iter().map(|p| (p[0] - 0.5) / 20.0).collect();
            assert_eq!(seen, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "{resolution}");
        }
    }

    #[test]
    fn old_runs_have_digits() {
        // One pixel, then 1,1,1,3 and 1,1,1,1: 3 + 1 * 256 repetitions.
        let pixels = [9, 8, 7, 136, 1, 1, 1, 3, 1, 1, 1, 1, 5, 5, 5, 136];
        let (rgb, _) = decode(path(), &file("", "-Y 1 +X 261", &pixels)).expect("reads");
        assert_eq!(rgb[(259, 0)], [9.5, 8.5, 7.5]);
        assert_eq!(rgb[(260, 0)], [5.5, 5.5, 5.5]);
        assert!(decode(path(), &file("", "-Y 1 +X 200", &pixels)).is_err());
        assert!(decode(path(), &file("", "-Y 1 +X 3", &pixels[4..])).is_err());
    }

    #[test]
    fn claims_beyond_the_file_are_refused_before_anything_is_allocated() {
        for resolution in ["-Y 60000 +X 1000", "-Y 4000000000 +X 1", "-Y 1 +X 0", "-Y 1 +Y 1"] {
            assert!(decode(path(), &file("", resolution, &[0; 64])).is_err(), "{resolution}");
        }
    }
}

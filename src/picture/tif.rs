//! TIFF with 32-bit floats: one channel, or three of a colour picture.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use glintmap_formats::seal;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::encoder::{TiffEncoder, colortype};

use super::channels::{Channels, check_length, check_size};
use super::{Error, Rgb};
use crate::base::{Grid, limits};

/// Writes one channel of floats.
///
/// # Errors
/// [`Error::TooLarge`], [`Error::Io`].
pub fn write(path: &Path, grid: &Grid<f32>) -> Result<(), Error> {
    let (width, height) = size(path, grid)?;
    finish(path, |out| {
        TiffEncoder::new(out)?.write_image::<colortype::Gray32Float>(width, height, grid.data())
    })
}

/// Writes a colour picture of floats, linear light.
///
/// # Errors
/// As [`write()`].
pub fn write_rgb(path: &Path, picture: &Rgb) -> Result<(), Error> {
    let (width, height) = size(path, picture)?;
    let samples: Vec<f32> = picture.data().iter().flatten().copied().collect();
    finish(path, |out| {
        TiffEncoder::new(out)?.write_image::<colortype::RGB32Float>(width, height, &samples)
    })
}

fn size<T>(path: &Path, grid: &Grid<T>) -> Result<(u32, u32), Error> {
    let (columns, rows) = check_size(path, grid.columns() as u64, grid.rows() as u64, 1)?;
    // check_size allows 65,536 at most.
    Ok((columns as u32, rows as u32))
}

fn finish(
    path: &Path,
    fill: impl FnOnce(&mut Cursor<Vec<u8>>) -> Result<(), tiff::TiffError>,
) -> Result<(), Error> {
    let mut out = Cursor::new(Vec::new());
    fill(&mut out)
        .map_err(|e| Error::unsupported(path, format!("can't be written as TIFF: {e}")))?;
    seal::write_bytes(path, &out.into_inner()).map_err(Error::write(path))
}

/// Reads a TIFF of one or three channels (more are dropped) as floats; integers become their
/// numbers, unscaled. One channel is called `value`, three are R, G and B.
///
/// # Errors
/// [`Error::Io`], [`Error::Malformed`], [`Error::Unsupported`], [`Error::TooLarge`].
pub fn read(path: &Path) -> Result<Channels, Error> {
    let bytes = fs::read(path).map_err(Error::read(path))?;
    decode(path, &bytes)
}

/// [`read`] from memory; `path` is for messages.
///
/// # Errors
/// As [`read`].
pub fn decode(path: &Path, bytes: &[u8]) -> Result<Channels, Error> {
    let said = |e: tiff::TiffError| Error::malformed(path, format!("is no TIFF that is read: {e}"));
    let mut limits_of_decoder = Limits::default();
    limits_of_decoder.decoding_buffer_size = limits::MAX_VIEW_PIXELS * 12;
    let mut decoder =
        Decoder::new(Cursor::new(bytes)).map_err(said)?.with_limits(limits_of_decoder);
    let (width, height) = decoder.dimensions().map_err(said)?;
    let color = decoder.colortype().map_err(said)?;
    let step = match color {
        ColorType::Gray(_) => 1,
        ColorType::GrayA(_) => 2,
        ColorType::RGB(_) => 3,
        ColorType::RGBA(_) => 4,
        other => {
            let what = format!("has colours of kind {other:?}; expected grey or RGB");
            return Err(Error::unsupported(path, what));
        }
    };
    let claim = (u64::from(width), u64::from(height), step as u64);
    let (columns, rows) = check_size(path, claim.0, claim.1, claim.2)?;
    // Deflate packs at most 1032 bytes into one, LZW some 2,700.
    check_length(path, claim, claim.0 * claim.1 * claim.2 / 4096, bytes.len() as u64)?;
    let samples: Vec<f32> = match decoder.read_image().map_err(said)? {
        DecodingResult::U8(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::I8(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::U16(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::I16(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::U32(v) => v.into_iter().map(|v| v as f32).collect(),
        DecodingResult::I32(v) => v.into_iter().map(|v| v as f32).collect(),
        DecodingResult::F32(v) => v,
        DecodingResult::F64(v) => v.into_iter().map(|v| v as f32).collect(),
        _ => return Err(Error::unsupported(path, "has samples of a kind that is not read")),
    };
    if samples.len() != columns * rows * step {
        return Err(Error::malformed(path, "holds another number of samples than its header says"));
    }
    let plane = |at: usize| {
        let data = samples.iter().skip(at).step_by(step).copied().collect();
        Grid::from_vec(columns, rows, data)
    };
    let mut out = Channels::new(columns, rows);
    if step < 3 {
        out.push("value", plane(0));
    } else {
        for (at, name) in ["R", "G", "B"].into_iter().enumerate() {
            out.push(name, plane(at));
        }
    }
    Ok(out)
}

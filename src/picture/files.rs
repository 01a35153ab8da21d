//! Rasters in files, told apart by the ending of the name.

use std::fs::File;
use std::path::Path;

use glintmap_formats::npy;

use super::channels::{Channels, check_size};
use super::tonemap::{self, Exposure};
use super::{Error, exr, hdr, png, tif};
use crate::base::Grid;

/// The kinds of files that are read and written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// OpenEXR: any number of named channels.
    Exr,
    /// Radiance: colours.
    Hdr,
    /// 8-bit colours.
    Png,
    /// 32-bit floats, one channel or colours.
    Tif,
    /// NumPy: `[row, column]`, or `[row, column, 3]` for colours.
    Npy,
}

impl Kind {
    /// The kind of a file by its name.
    ///
    /// # Errors
    /// [`Error::Unsupported`] that lists the endings there are.
    pub fn of(path: &Path) -> Result<Self, Error> {
        let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        match ending.to_ascii_lowercase().as_str() {
            "exr" => Ok(Self::Exr),
            "hdr" | "pic" | "rgbe" => Ok(Self::Hdr),
            "png" => Ok(Self::Png),
            "tif" | "tiff" => Ok(Self::Tif),
            "npy" => Ok(Self::Npy),
            _ => Err(Error::unsupported(
                path,
                "expected a name that ends in .exr, .hdr, .png, .npy or .tif",
            )),
        }
    }
}

/// Reads any of the kinds as channels. A PNG's colours become linear light from 0 to 1; a
/// Radiance picture is divided by its exposure, its VIEW and other header lines become the
/// attributes `VIEW` and `header`.
///
/// # Errors
/// Whatever reading that kind says.
pub fn read(path: &Path) -> Result<Channels, Error> {
    match Kind::of(path)? {
        Kind::Exr => exr::read(path),
        Kind::Tif => tif::read(path),
        Kind::Npy => read_npy(path),
        Kind::Hdr => {
            let (picture, header) = hdr::read(path)?;
            let mut out = Channels::from_rgb(&picture);
            if let Some(view) = header.views.last() {
                out.attributes.push(("VIEW".into(), view.clone()));
            }
            if !header.lines.is_empty() {
                out.attributes.push(("header".into(), header.lines.join("\n")));
            }
            Ok(out)
        }
        Kind::Png => {
            let (picture, texts) = png::read(path)?;
            let mut out = Channels::from_rgb(&picture.map(|p| p.map(tonemap::decode)));
            out.attributes = texts;
            Ok(out)
        }
    }
}

/// Writes channels as the kind that the name says.
///
/// * `.exr` takes all channels, or the one that is `wanted`.
/// * `.hdr` takes R, G and B; one channel of values as grey.
/// * `.tif` and `.npy` take R, G and B, or one channel of values.
/// * `.png` takes R, G and B, or Y, tone mapped; values need colours, which
///   `glintmap picture falsecolor` gives them.
///
/// # Errors
/// [`Error::Channel`] where it is not clear what is meant, [`Error::Unsupported`] where the kind
/// can't hold it, and whatever writing says.
pub fn write(
    path: &Path,
    channels: &Channels,
    wanted: Option<&str>,
    source: &Path,
) -> Result<(), Error> {
    let rgb = if wanted.is_none() { channels.rgb() } else { None };
    match (Kind::of(path)?, rgb) {
        (Kind::Exr, _) => {
            if wanted.is_none() {
                return exr::write_channels(path, &exr_names(channels));
            }
            let (name, grid) = channels.values(wanted, source)?;
            exr::write(path, &[(&name, &grid)], &exr_names(channels).attributes)
        }
        (Kind::Hdr, Some(rgb)) => hdr::write(path, &rgb, &header_lines(channels)),
        (Kind::Hdr, None) => {
            let (name, grid) = channels.values(wanted, source)?;
            let mut lines = header_lines(channels);
            lines.push(format!("CHANNEL={name}"));
            hdr::write(path, &grid.map(|&v| [v; 3]), &lines)
        }
        (Kind::Tif, Some(rgb)) if channels.get("Y").is_none() => tif::write_rgb(path, &rgb),
        (Kind::Tif, _) => tif::write(path, &channels.values(wanted, source)?.1),
        (Kind::Npy, Some(rgb)) if channels.get("Y").is_none() => {
            let samples: Vec<f32> = rgb.data().iter().flatten().copied().collect();
            npy::write(path, &[rgb.rows(), rgb.columns(), 3], &samples)
                .map_err(npy_said(path, true))
        }
        (Kind::Npy, _) => {
            let (_, grid) = channels.values(wanted, source)?;
            npy::write(path, &[grid.rows(), grid.columns()], grid.data())
                .map_err(npy_said(path, true))
        }
        (Kind::Png, Some(rgb)) => {
            png::write(path, &tonemap::tonemap(&rgb, Exposure::Auto, false), &png_texts(channels))
        }
        (Kind::Png, None) => {
            let (name, _) = channels.values(wanted, source)?;
            Err(Error::unsupported(
                path,
                format!(
                    "a PNG holds colours, not the values of channel {name}; use `glintmap picture falsecolor`"
                ),
            ))
        }
    }
}

fn npy_said(path: &Path, writing: bool) -> impl FnOnce(npy::Error) -> Error {
    move |e| match e {
        npy::Error::Io(source) => Error::Io { path: path.to_owned(), source, writing },
        e => Error::malformed(path, e.to_string()),
    }
}

/// An array of `float32` or `int32`, two axes or three with the colours last.
fn read_npy(path: &Path) -> Result<Channels, Error> {
    let mut file = File::open(path).map_err(Error::read(path))?;
    let header = npy::Header::read(&mut file).map_err(npy_said(path, false))?;
    let (rows, columns, step) = match *header.shape.as_slice() {
        [rows, columns] => (rows, columns, 1),
        [rows, columns, 3] => (rows, columns, 3),
        _ => {
            let shape = npy::shape_text(&header.shape);
            let what = format!(
                "has shape {shape}; expected [row, column] or [row, column, 3]: choose a slice first"
            );
            return Err(Error::unsupported(path, what));
        }
    };
    let (columns, rows) = check_size(path, columns as u64, rows as u64, step as u64)?;
    let samples: Vec<f32> = if header.descr == "<i4" {
        let numbers = npy::Reader::<i32>::open(path).and_then(|r| r.read_all());
        numbers.map_err(npy_said(path, false))?.into_iter().map(|v| v as f32).collect()
    } else {
        let numbers = npy::Reader::<f32>::open(path).and_then(|r| r.read_all());
        numbers.map_err(npy_said(path, false))?
    };
    let plane = |at: usize| {
        let data = samples.iter().skip(at).step_by(step).copied().collect();
        Grid::from_vec(columns, rows, data)
    };
    let mut out = Channels::new(columns, rows);
    if step == 1 {
        out.push("value", plane(0));
    } else {
        for (at, name) in ["R", "G", "B"].into_iter().enumerate() {
            out.push(name, plane(at));
        }
    }
    Ok(out)
}

/// Attribute names that EXR takes: others are left out, values stay.
fn exr_names(channels: &Channels) -> Channels {
    let mut out = channels.clone();
    out.attributes.retain(|(name, _)| (1..=31).contains(&name.len()));
    out.attributes.sort();
    out.attributes.dedup_by(|a, b| a.0 == b.0);
    out
}

fn header_lines(channels: &Channels) -> Vec<String> {
    let mut out = Vec::new();
    for (name, value) in &channels.attributes {
        // What was the header of a Radiance picture is history now.
        let history = name == "header";
        for line in value.lines().filter(|l| !l.trim().is_empty()) {
            out.push(if history {
                format!("\t{}", line.trim())
            } else {
                format!("{name}= {line}")
            });
        }
    }
    out
}

fn png_texts(channels: &Channels) -> Vec<(String, String)> {
    channels
        .attributes
        .iter()
        .filter(|(name, _)| name.is_ascii() && name.len() < 80)
        .cloned()
        .collect()
}

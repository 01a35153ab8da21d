//! Rasters in files, told apart by the ending of the name.

use std::path::Path;

use super::channels::Channels;
use super::tonemap::{self, Exposure};
use super::{Error, exr, hdr, png, tif};

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
/// * `.tif` takes R, G and B, or one channel of values.
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

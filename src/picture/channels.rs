//! Rasters with named channels, and the sizes that a file may claim.

use std::path::Path;

use super::Error;
use crate::base::{Grid, limits};

/// A colour picture in linear light, Rec. 709 primaries.
pub type Rgb = Grid<[f32; 3]>;

/// A raster with named channels, all of one size: what an EXR holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Channels {
    columns: usize,
    rows: usize,
    list: Vec<(String, Grid<f32>)>,
    /// Text attributes (provenance), by name.
    pub attributes: Vec<(String, String)>,
}

impl Channels {
    /// A raster without channels.
    pub fn new(columns: usize, rows: usize) -> Self {
        Self { columns, rows, list: Vec::new(), attributes: Vec::new() }
    }

    /// A raster with the channels R, G and B.
    pub fn from_rgb(picture: &Rgb) -> Self {
        let mut out = Self::new(picture.columns(), picture.rows());
        for (at, name) in ["R", "G", "B"].into_iter().enumerate() {
            out.list.push((name.to_owned(), picture.map(|p| p[at])));
        }
        out
    }

    /// Adds a channel.
    ///
    /// # Panics
    /// If the sizes differ: a mistake of the caller.
    pub fn push(&mut self, name: &str, grid: Grid<f32>) {
        assert_eq!((grid.columns(), grid.rows()), (self.columns, self.rows), "channel {name}");
        self.list.push((name.to_owned(), grid));
    }

    /// Width in pixels.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Height in pixels.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Names and values in the order of the file.
    pub fn list(&self) -> &[(String, Grid<f32>)] {
        &self.list
    }

    /// The channel of that name.
    pub fn get(&self, name: &str) -> Option<&Grid<f32>> {
        self.list.iter().find(|(n, _)| n == name).map(|(_, grid)| grid)
    }

    /// All names, for messages.
    pub fn names(&self) -> String {
        self.list.iter().map(|(n, _)| n.as_str()).collect::<Vec<_>>().join(", ")
    }

    /// The colour picture, where R, G and B (or only Y, as grey) are there.
    pub fn rgb(&self) -> Option<Rgb> {
        if let Some(y) = self.get("Y") {
            return Some(y.map(|&v| [v; 3]));
        }
        let (r, g, b) = (self.get("R")?, self.get("G")?, self.get("B")?);
        let data = r.data().iter().zip(g.data()).zip(b.data()).map(|((&r, &g), &b)| [r, g, b]);
        Some(Grid::from_vec(self.columns, self.rows, data.collect()))
    }

    /// One raster of values and its name: the channel `wanted`; else the only one; else the
    /// luminance of a colour picture, named `Y`; else the one that is named as the file is
    /// (`annual.wh_m2` of `annual.exr`).
    ///
    /// # Errors
    /// [`Error::Channel`] where the name is unknown or several channels could be meant. `path`
    /// is for the message.
    pub fn values(&self, wanted: Option<&str>, path: &Path) -> Result<(String, Grid<f32>), Error> {
        let wrong =
            |what: String| Error::Channel { path: path.to_owned(), what, found: self.names() };
        if let Some(name) = wanted {
            return match self.get(name) {
                Some(grid) => Ok((name.to_owned(), grid.clone())),
                None => Err(wrong(format!("there is no channel `{name}`"))),
            };
        }
        if let [(name, grid)] = self.list.as_slice() {
            return Ok((name.clone(), grid.clone()));
        }
        if let Some(rgb) = self.rgb() {
            return Ok(("Y".to_owned(), rgb.map(|&p| luminance(p))));
        }
        let stem = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
        let quantity = |name: &str| name.split('.').next() == Some(stem);
        match self.list.iter().find(|(name, _)| quantity(name)) {
            Some((name, grid)) => Ok((name.clone(), grid.clone())),
            None => Err(wrong("it has several channels: choose one with --channel NAME".into())),
        }
    }
}

/// Radiance's brightness of a colour (`0.265 R + 0.670 G + 0.065 B`, src/common/color.h); exactly
/// the value itself for grey.
pub fn luminance([r, g, b]: [f32; 3]) -> f32 {
    if r.to_bits() == g.to_bits() && g.to_bits() == b.to_bits() {
        return r;
    }
    (0.265 * f64::from(r) + 0.670 * f64::from(g) + 0.065 * f64::from(b)) as f32
}

/// How a channel's unit is written for people: the last part of `annual.wh_m2` gives `Wh/m²`.
/// Unknown units are given back as they are, a name without a unit gives nothing.
pub fn unit_label(channel: &str) -> String {
    let Some((_, unit)) = channel.rsplit_once('.') else { return String::new() };
    match unit {
        "wh_m2" => "Wh/m²".into(),
        "kwh_m2" => "kWh/m²".into(),
        "w_m2" => "W/m²".into(),
        "cd_m2" => "cd/m²".into(),
        "lx" | "lux" => "lx".into(),
        "deg" => "°".into(),
        "ratio" | "1" => String::new(),
        other => other.replace('_', "/"),
    }
}

/// Refuses sizes beyond the limits of the program.
pub(super) fn check_size(
    path: &Path,
    columns: u64,
    rows: u64,
    channels: u64,
) -> Result<(usize, usize), Error> {
    let edge = limits::MAX_VIEW_EDGE as u64;
    let pixels = limits::MAX_VIEW_PIXELS as u64;
    let fits = (1..=edge).contains(&columns)
        && (1..=edge).contains(&rows)
        && columns * rows <= pixels
        && channels.saturating_mul(columns * rows) <= 4 * pixels;
    if fits {
        // Both are at most MAX_VIEW_EDGE here.
        return Ok((columns as usize, rows as usize));
    }
    Err(Error::TooLarge {
        path: path.to_owned(),
        columns,
        rows,
        channels,
        limit: format!(
            "allowed are 1 to {edge} pixels an edge, {pixels} in all, {} samples",
            4 * pixels
        ),
    })
}

/// Refuses sizes that a file of `bytes` can't hold, where `least_bytes` is the smallest possible.
pub(super) fn check_length(
    path: &Path,
    (columns, rows, channels): (u64, u64, u64),
    least_bytes: u64,
    bytes: u64,
) -> Result<(), Error> {
    if bytes >= least_bytes {
        return Ok(());
    }
    Err(Error::TooLarge {
        path: path.to_owned(),
        columns,
        rows,
        channels,
        limit: format!(
            "that takes at least {least_bytes} bytes, the file has {bytes}: it is cut short or damaged"
        ),
    })
}

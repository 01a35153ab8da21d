//! A finished picture: what one shows to a client.

use super::Scale;
use super::channels::Rgb;
use super::compose::{Contours, OPACITY};
use crate::base::Grid;

/// A raster in colours over a background, with everything that a reader needs. Places in the
/// picture are pixels of `data`, counted from its upper left corner: the middle of the first
/// pixel is (0.5, 0.5). Letters and lines are sized by the picture's width; small pictures are
/// enlarged by a whole number so that text is legible.
#[derive(Clone, Debug)]
pub struct Figure<'a> {
    /// What it is, in large letters; wrapped where it is long.
    pub title: String,
    /// Where and when, in the second line.
    pub subtitle: String,
    /// What lies under the data, in grey; same size as the data.
    pub background: Option<&'a Rgb>,
    /// The values; exactly 0 is transparent.
    pub data: &'a Grid<f32>,
    /// From values to colours.
    pub scale: Scale,
    /// Heading of the legend: the quantity, without its unit.
    pub legend: String,
    /// What it means where no colour lies; empty: not said.
    pub bare: String,
    /// Notes below the picture, a paragraph each.
    pub caption: Vec<String>,
    /// Words that lie across the picture ("draft, not for assessment").
    pub watermark: Option<String>,
    /// Lines over the picture, in order.
    pub polylines: Vec<Polyline>,
    /// Places with names.
    pub markers: Vec<Marker>,
    /// Labels along the lower edge (compass points of a panorama).
    pub axis: Vec<AxisLabel>,
    /// Size of a pixel of `data` where it is the same everywhere: draws a scale bar.
    pub metres_per_pixel: Option<f64>,
    /// Direction of north, degrees clockwise from up: draws a north arrow.
    pub north_deg: Option<f64>,
    /// Contours instead of continuous colours.
    pub contours: Contours,
    /// Marks the smallest and largest value that is not 0 (Radiance's `-e`).
    pub extrema: bool,
    /// Opacity of the data over the background, 0 to 1.
    pub opacity: f64,
    /// Length and breadth of the colour bar in pixels of the figure; 0: no legend. `None`: fits.
    pub legend_size: Option<[u32; 2]>,
}

/// A line over the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Polyline {
    /// Corners (column, row); one that is not finite breaks the line.
    pub points: Vec<[f64; 2]>,
    /// Colour.
    pub color: [u8; 3],
    /// Width in units of a normal line (1).
    pub width: f64,
    /// Words at its last point; empty: none.
    pub label: String,
}

/// A place with a name.
#[derive(Clone, Debug, PartialEq)]
pub struct Marker {
    /// Column and row.
    pub at: [f64; 2],
    /// The name.
    pub label: String,
}

/// A label along the lower edge.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisLabel {
    /// Where, in columns.
    pub column: f64,
    /// The words.
    pub label: String,
    /// Takes precedence where labels would collide, and is set in bold.
    pub major: bool,
}

impl<'a> Figure<'a> {
    /// A figure of data on a scale, with nothing else.
    pub fn new(data: &'a Grid<f32>, scale: Scale) -> Self {
        Self {
            title: String::new(),
            subtitle: String::new(),
            background: None,
            data,
            scale,
            legend: String::new(),
            bare: String::new(),
            caption: Vec::new(),
            watermark: None,
            polylines: Vec::new(),
            markers: Vec::new(),
            axis: Vec::new(),
            metres_per_pixel: None,
            north_deg: None,
            contours: Contours::None,
            extrema: false,
            opacity: OPACITY,
            legend_size: None,
        }
    }
}

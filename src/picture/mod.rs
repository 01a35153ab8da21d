//! Pictures: reading and writing rasters, colouring them, and drawing figures that a planner can
//! read. The room knows rasters, polylines and texts; what they mean, its callers know.
//!
//! * [`exr`], [`hdr`], [`png`], [`tif`], [`files`]: rasters in files, named channels of `f32`.
//! * [`palette`], [`scale`]: from a value to a colour, and the ticks of the legend.
//! * [`compose`], [`tonemap`]: from rasters to colours per pixel.
//! * [`chart`]: coloured cells over two axes, with words.
//! * [`scatter`]: points over two logarithmic axes.
//! * [`figure`]: the finished picture: title, legend, scale bar, north arrow, markers, notes.

mod canvas;
mod channels;
pub mod chart;
pub mod compose;
mod draw;
mod error;
pub mod exr;
pub mod figure;
pub mod files;
pub mod hdr;
mod layout;
mod legend;
mod marks;
pub mod palette;
pub mod png;
pub mod polar;
pub mod scale;
pub mod scatter;
mod text;
pub mod tif;
pub mod tonemap;

pub use channels::{Channels, Rgb, luminance, unit_label};
pub use chart::Chart;
pub use error::Error;
pub use figure::Figure;
pub use palette::Palette;
pub use scale::Scale;

//! The scene at an instant as an eye sees it: luminances, with the sun, the sky, and the sun's
//! reflection in the PV.

mod painter;
mod sky;

pub use painter::{Moment, WATT_LM, illuminance_lx};
pub use sky::ClearSky;

//! Which instants are computed, where the sun stands, and how strong it is.
//!
//! [`timeline`] turns a [`Place`] and a [`TimeSpec`] into the timesteps of a run; [`parse_day`] and
//! the ranges read what people write; [`write_csv`] prints what came out.

mod calendar;
mod clear_sky;
mod epw;
mod error;
mod far_horizon;
mod gensky;
mod place;
mod position;
mod range;
mod refraction;
mod spec;
mod table;
mod timeline;

pub use calendar::{date_of_day, days_in_year, parse_day};
pub use epw::Weather;
pub use error::Error;
pub use far_horizon::FarHorizon;
pub use place::Place;
pub use position::{altitude_azimuth_deg, sun_direction};
pub use range::{DayRange, HourRange};
pub use refraction::refracted;
pub use spec::{SunModel, SunStrength, TimeSpec};
pub use table::{Row, rows, write_csv};
pub use timeline::timeline;

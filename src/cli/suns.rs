use std::io::{self, BufWriter, Write};
use std::path::PathBuf;

use serde_json::json;

use super::Context;
use crate::sky::{self, DayRange, HourRange, Place, SunModel, SunStrength, TimeSpec, Weather};

/// The timesteps of a run and their suns, as CSV
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example: the 1,280 suns of the paper's case study
  glintmap suns --latitude 47.038 --longitude 8.312 --meridian 15 \\
      --days 0:181:7 --hours 4.5:20.5:0.25 --sun gensky-2018 --half-year

Columns: index,day,hour,altitude_deg,azimuth_deg,x,y,z,irradiance_w_m2,weight_h.
Azimuth counts clockwise from north; x points east, y north, z up. Only suns whose centre stands
above the horizon (without refraction) are listed.")]
pub(super) struct Arguments {
    /// Degrees north
    #[arg(long, value_name = "D", allow_negative_numbers = true)]
    latitude: f64,
    /// Degrees east (negative in the west; gensky's -o has the other sign)
    #[arg(long, value_name = "D", allow_negative_numbers = true)]
    longitude: f64,
    /// Meridian of the standard time, degrees east: 15 times its hours ahead of UTC
    #[arg(long, value_name = "D", allow_negative_numbers = true)]
    meridian: f64,
    /// Above the sea, m; the clear sky depends on it
    #[arg(long, value_name = "M", default_value_t = 0.0, allow_negative_numbers = true)]
    elevation: f64,
    /// Days of the year (0 is 1 January) or dates MM-DD; B is included
    #[arg(long, value_name = "A:B:STEP", default_value = "01-01:12-31:7")]
    days: String,
    /// Hours of the day, standard time (never daylight saving time); B is included
    #[arg(long, value_name = "A:B:STEP", default_value = "0:23.75:0.25")]
    hours: String,
    /// A stretch of the hours with finer steps; may be given several times
    #[arg(long, value_name = "A:B:STEP")]
    finer: Vec<String>,
    /// Where the sun stands
    #[arg(long, value_enum, default_value = "spa")]
    sun: Sun,
    /// How strong it is: gensky (Radiance's visible watts, about half of the full spectrum),
    /// clear-sky (broadband, Ineichen and Perez 2002, Linke turbidity 3) or epw=FILE (the weather
    /// of an EPW file) [default: gensky with gensky's suns, else clear-sky]
    #[arg(long, value_name = "gensky|clear-sky|epw=FILE", value_parser = strength)]
    irradiance: Option<Strength>,
    /// The year; gensky's suns differ in leap years only
    #[arg(long, value_name = "Y", default_value_t = 2025, allow_negative_numbers = true)]
    year: i32,
    /// Half a year stands for the year: weights of the paper's Equation (1), days 0 to 182
    #[arg(long)]
    half_year: bool,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Sun {
    /// Radiance's gensky of 2018, the paper's
    #[value(name = "gensky-2018")]
    Gensky2018,
    /// Today's gensky
    Gensky,
    /// NREL's solar position algorithm
    Spa,
}

#[derive(Clone, Debug)]
enum Strength {
    Gensky,
    ClearSky,
    Epw(PathBuf),
}

fn strength(text: &str) -> Result<Strength, String> {
    match text.split_once('=') {
        Some(("epw", path)) if !path.is_empty() => Ok(Strength::Epw(path.into())),
        None if text == "gensky" => Ok(Strength::Gensky),
        None if text == "clear-sky" => Ok(Strength::ClearSky),
        _ => Err("expected gensky, clear-sky or epw=FILE".to_owned()),
    }
}

impl Arguments {
    fn resolve(&self) -> Result<(Place, TimeSpec), sky::Error> {
        let place = Place {
            latitude_deg: self.latitude,
            longitude_deg: self.longitude,
            meridian_deg: self.meridian,
            elevation_m: self.elevation,
        };
        let sun = match self.sun {
            Sun::Gensky2018 => SunModel::Gensky2018,
            Sun::Gensky => SunModel::Gensky,
            Sun::Spa => SunModel::Spa,
        };
        let irradiance = match &self.irradiance {
            None => sun.default_irradiance(),
            Some(Strength::Gensky) => SunStrength::Gensky,
            Some(Strength::ClearSky) => SunStrength::ClearSky,
            Some(Strength::Epw(path)) => SunStrength::Epw(Weather::read(path)?),
        };
        let spec = TimeSpec {
            year: self.year,
            days: DayRange::parse(&self.days, self.year)?,
            hours: HourRange::parse(&self.hours)?,
            finer: self.finer.iter().map(|f| HourRange::parse(f)).collect::<Result<_, _>>()?,
            sun,
            irradiance,
            half_year: self.half_year,
        };
        Ok((place, spec))
    }
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let (place, spec) = arguments.resolve()?;
    let timeline = sky::timeline(&place, &spec)?;
    let mut out = BufWriter::new(io::stdout().lock());
    if context.common.json {
        let document = json!({
            "place": place,
            "time": spec,
            "basis": timeline.basis,
            "sun_diameter_deg": timeline.sun_diameter_deg,
            "timesteps": sky::rows(&timeline).collect::<Vec<_>>(),
        });
        // As an io::Error a closed pipe is known for what it is.
        serde_json::to_writer_pretty(&mut out, &document).map_err(io::Error::from)?;
        writeln!(out)?;
    } else {
        sky::write_csv(&mut out, &timeline)?;
    }
    out.flush()?;
    Ok(())
}

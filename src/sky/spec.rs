use std::str::FromStr;

use super::{DayRange, Error, HourRange};

/// Where the site lies on Earth.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Place {
    /// Degrees north.
    pub latitude_deg: f64,
    /// Degrees **east** (gensky counts west).
    pub longitude_deg: f64,
    /// Meridian of the zone's standard time, degrees **east**: local standard time is
    /// UTC + meridian / 15.
    pub meridian_deg: f64,
    /// Above the sea, m. The clear sky depends on it.
    pub elevation_m: f64,
}

/// Which formulas say where the sun stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub enum SunModel {
    /// Radiance's gensky as of 2018, as the paper used it.
    #[serde(rename = "gensky-2018")]
    Gensky2018,
    /// Today's gensky.
    #[serde(rename = "gensky")]
    Gensky,
    /// NREL's solar position algorithm (Reda and Andreas 2004). The only one that knows the year.
    #[serde(rename = "spa")]
    Spa,
}

impl SunModel {
    /// The name in project files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gensky2018 => "gensky-2018",
            Self::Gensky => "gensky",
            Self::Spa => "spa",
        }
    }

    /// The strength that goes with it where none is asked for.
    pub fn default_irradiance(self) -> Irradiance {
        match self {
            Self::Gensky2018 | Self::Gensky => Irradiance::Gensky,
            Self::Spa => Irradiance::ClearSky,
        }
    }
}

impl FromStr for SunModel {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        [Self::Gensky2018, Self::Gensky, Self::Spa]
            .into_iter()
            .find(|model| model.name() == text)
            .ok_or_else(|| Error::SunModel(text.to_owned()))
    }
}

/// How strong the sun is.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Irradiance {
    /// Radiance's visible watts, for comparison with the paper; a disc of 0.5 degrees.
    Gensky,
    /// Broadband, Ineichen and Perez 2002 with a Linke turbidity of 3.
    ClearSky,
    /// The same with the Linke turbidity of each month, January first.
    Ineichen {
        /// Linke turbidity, 1 to 15; interpolated between the middles of the months.
        linke: [f64; 12],
    },
    /// The same direct normal irradiance for each sun, W/m2, broadband.
    Constant(f64),
    /// Measured or typical weather, broadband. Within a record the strength follows the clear sky
    /// of the instant, scaled so that the record's mean is kept.
    Epw(super::Weather),
}

/// Which instants are computed, by which sun.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct TimeSpec {
    /// The year, 1583 to 5999.
    pub year: i32,
    /// Days of the year.
    pub days: DayRange,
    /// Hours of the day, local standard time.
    pub hours: HourRange,
    /// Where the sun stands.
    pub sun: SunModel,
    /// How strong it is.
    pub irradiance: Irradiance,
    /// The paper's Equation (1): half a year stands for the year.
    pub half_year: bool,
}

impl Place {
    /// Checks that the numbers can be a place.
    pub(super) fn check(&self) -> Result<(), Error> {
        let checks = [
            ("latitude", self.latitude_deg, -90.0, 90.0, "-90 to 90 degrees north"),
            ("longitude", self.longitude_deg, -180.0, 180.0, "-180 to 180 degrees east"),
            ("meridian", self.meridian_deg, -180.0, 180.0, "-180 to 180 degrees east"),
            ("elevation_m", self.elevation_m, -500.0, 9000.0, "-500 to 9000 m"),
        ];
        for (field, found, least, most, expected) in checks {
            if !(least..=most).contains(&found) {
                return Err(Error::Place { field, expected, found });
            }
        }
        Ok(())
    }
}

impl Irradiance {
    /// Checks that the numbers can be a sun's.
    pub(super) fn check(&self) -> Result<(), Error> {
        match self {
            Self::Gensky | Self::ClearSky | Self::Epw(_) => Ok(()),
            Self::Ineichen { linke } => match linke.iter().find(|t| !(1.0..=15.0).contains(*t)) {
                None => Ok(()),
                Some(found) => Err(Error::Irradiance {
                    expected: "Linke turbidities of 1 to 15, one for each month",
                    found: found.to_string(),
                }),
            },
            Self::Constant(w_m2) => {
                if *w_m2 > 0.0 && *w_m2 <= 2000.0 {
                    Ok(())
                } else {
                    Err(Error::Irradiance {
                        expected: "a constant above 0 and up to 2000 W/m2",
                        found: w_m2.to_string(),
                    })
                }
            }
        }
    }
}

impl TimeSpec {
    /// How many instants are looked at, day and night; the ranges were checked.
    pub(super) fn candidates(&self) -> u64 {
        let days = (self.days.to - self.days.from) / self.days.step + 1;
        u64::from(days) * u64::from(self.hours.count())
    }

    /// Checks everything that doesn't need the sun.
    pub(super) fn check(&self) -> Result<(), Error> {
        if !(1583..6000).contains(&self.year) {
            return Err(Error::Year(self.year));
        }
        self.days.check(self.year)?;
        self.hours.check()?;
        self.irradiance.check()?;
        if self.half_year && self.days.to > 182 {
            return Err(Error::HalfYear { from: self.days.from, to: self.days.to });
        }
        Ok(())
    }
}

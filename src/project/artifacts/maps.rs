//! The maps of a material in a view: their files, their channels, their units, their titles.

use crate::base::{Irradiance, MONTHS, SpectralBasis};
use crate::glare::YearMap;

/// One of the series of a view. That of the irradiance which the project asks for has the plain
/// name; another one says in its name what it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SeriesOf {
    /// What it holds.
    pub quantity: Irradiance,
    /// What the project asks for.
    pub asked: Irradiance,
}

impl SeriesOf {
    /// All that there may be, whatever is asked for.
    pub fn all() -> [Self; 3] {
        let [surface, facing] = [Irradiance::Surface, Irradiance::FacingBeam];
        let of = |quantity, asked| Self { quantity, asked };
        [of(surface, surface), of(surface, facing), of(facing, surface)]
    }

    /// A file name with the irradiance in it, where it isn't the one that was asked for.
    pub(super) fn named(self, stem: &str) -> String {
        match self.quantity {
            _ if self.quantity == self.asked => stem.to_owned(),
            Irradiance::Surface => format!("{stem}_surface"),
            Irradiance::FacingBeam => format!("{stem}_normal"),
        }
    }
}

/// A map of a material in a view: one channel of an EXR file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Map {
    /// Radiant exposure of the year on the surface, Wh/m2.
    Annual,
    /// The same on planes that face the beams, Wh/m2.
    AnnualNormal,
    /// Search radius of the photons of [`Map::Annual`], m.
    Radius,
    /// Its standard error by the photons, Wh/m2.
    StandardError,
    /// Its error where it was integrated, Wh/m2.
    IntegrationError,
    /// Largest irradiance of any timestep, W/m2.
    Peak(SeriesOf),
    /// The irradiance that one photon of the series stands for, W/m2.
    PhotonIrradiance,
    /// Search radius of the photons of the series, m.
    SeriesRadius,
    /// [`Map::Annual`] divided by that of the reference.
    Ratio,
    /// From the analysis at a threshold, W/m2.
    Glare(f64, GlareMap),
}

/// A map of an analysis at a threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GlareMap {
    /// Hours of the year, filtered.
    Cumulative,
    /// The longest event, h, filtered.
    Sustained,
    /// The longest run without a break, h, filtered.
    LongestRun,
    /// Hours of the year with two standard errors taken off every irradiance, unfiltered.
    AtLeast,
    /// Hours of the year, unfiltered.
    Hours,
    /// Hours of the year with two standard errors added to every irradiance, unfiltered.
    AtMost,
    /// From the series as it is.
    Unfiltered(YearMap),
}

impl Map {
    /// The EXR file below the folder of the view, without its extension.
    pub(super) fn stem(self) -> String {
        match self {
            Self::Annual
            | Self::AnnualNormal
            | Self::Radius
            | Self::StandardError
            | Self::IntegrationError => "annual".into(),
            Self::Peak(series) => series.named("peak"),
            Self::PhotonIrradiance | Self::SeriesRadius => "noise".into(),
            Self::Ratio => "ratio".into(),
            Self::Glare(threshold, map) => {
                let file = match map {
                    GlareMap::Cumulative => "cumulative".into(),
                    GlareMap::Sustained => "sustained".into(),
                    GlareMap::LongestRun => "longest_run".into(),
                    GlareMap::AtLeast | GlareMap::Hours | GlareMap::AtMost => "band".into(),
                    GlareMap::Unfiltered(map) => format!("unfiltered/{}", map.name()),
                };
                format!("{}/{file}", analysis(threshold))
            }
        }
    }

    /// The picture below the folder of the view, without its extension: that of the file, where
    /// the file holds no other map that is drawn.
    pub(super) fn picture(self) -> String {
        match self {
            Self::Radius => "radius".into(),
            Self::StandardError => "standard_error".into(),
            Self::Glare(threshold, GlareMap::AtLeast) => {
                format!("{}/band_low_h", analysis(threshold))
            }
            Self::Glare(threshold, GlareMap::AtMost) => {
                format!("{}/band_high_h", analysis(threshold))
            }
            _ => self.stem(),
        }
    }

    /// The channel of the EXR file: what it is, then its unit.
    pub fn channel(self) -> String {
        let name = match self {
            Self::Annual => "annual.wh_m2",
            Self::AnnualNormal => "annual_normal.wh_m2",
            Self::Radius => "radius.m",
            Self::StandardError => "standard_error.wh_m2",
            Self::IntegrationError => "error.wh_m2",
            Self::Peak(SeriesOf { quantity: Irradiance::Surface, .. }) => "peak.w_m2",
            Self::Peak(SeriesOf { quantity: Irradiance::FacingBeam, .. }) => "peak_normal.w_m2",
            Self::PhotonIrradiance => "photon.w_m2",
            Self::SeriesRadius => "series_radius.m",
            Self::Ratio => "ratio",
            Self::Glare(_, map) => match map {
                GlareMap::Cumulative => "cumulative.h",
                GlareMap::Sustained => "sustained.h",
                GlareMap::LongestRun => "longest_run.h",
                GlareMap::AtLeast => "low.h",
                GlareMap::Hours => "hours.h",
                GlareMap::AtMost => "high.h",
                GlareMap::Unfiltered(map) => match map {
                    YearMap::Above => "above.h",
                    YearMap::Days => "days.d",
                    YearMap::LongestRun => "longest_run.h",
                    YearMap::LongestDay => "longest_day.h",
                    YearMap::FirstHour => "first_hour.h",
                    YearMap::LastHour => "last_hour.h",
                    YearMap::ExceededOnWorstDay => "exceeded_30min.w_m2",
                    YearMap::ExceededInYear => "exceeded_50h.w_m2",
                    YearMap::Month(month) => return format!("month_{month:02}.h"),
                },
            },
        };
        name.to_owned()
    }

    /// The unit of its values, for people.
    pub fn unit(self, basis: SpectralBasis) -> &'static str {
        match self {
            Self::Annual | Self::AnnualNormal | Self::StandardError | Self::IntegrationError => {
                exposure_unit(basis)
            }
            Self::Peak(_) | Self::PhotonIrradiance => irradiance_unit(basis),
            Self::Radius | Self::SeriesRadius => "m",
            Self::Ratio => "",
            Self::Glare(_, GlareMap::Unfiltered(map)) => match map {
                YearMap::Days => "d",
                YearMap::ExceededOnWorstDay | YearMap::ExceededInYear => irradiance_unit(basis),
                _ => "h",
            },
            Self::Glare(..) => "h",
        }
    }

    /// What it shows, for people.
    pub fn title(self) -> String {
        let title = match self {
            Self::Annual => "Energy from the PV in a year",
            Self::AnnualNormal => "Energy from the PV in a year, facing the beams",
            Self::Radius => "Radius over which photons were counted",
            Self::StandardError => "Standard error of the energy in a year",
            Self::IntegrationError => "Error of the energy in a year",
            Self::Peak(_) => "Strongest irradiance from the PV",
            Self::PhotonIrradiance => "Irradiance that one photon stands for",
            Self::SeriesRadius => "Radius over which photons of the series were counted",
            Self::Ratio => "Energy in a year compared with the reference",
            Self::Glare(_, map) => match map {
                GlareMap::Sustained => "Longest glare event",
                GlareMap::LongestRun => "Longest glare without a break",
                GlareMap::Unfiltered(map) => match map {
                    YearMap::Days => "Days with glare",
                    YearMap::LongestRun => "Longest unbroken glare",
                    YearMap::LongestDay => "Glare on the worst day",
                    YearMap::FirstHour => "Earliest glare of any day",
                    YearMap::LastHour => "Latest glare of any day",
                    YearMap::ExceededOnWorstDay => "Exceeded for half an hour on the worst day",
                    YearMap::ExceededInYear => "Exceeded for 50 hours of the year",
                    YearMap::Above => "Hours of glare in a year",
                    YearMap::Month(month) => {
                        let name = MONTHS.get(usize::from(month.wrapping_sub(1))).unwrap_or(&"");
                        return format!("Hours of glare in {name}");
                    }
                },
                _ => "Hours of glare in a year",
            },
        };
        title.to_owned()
    }

    /// The title, with the threshold where it counts time above one.
    pub fn title_above(self, basis: SpectralBasis) -> String {
        let watts = irradiance_unit(basis);
        match self {
            Self::Glare(t, _) if self.unit(basis) != watts => {
                format!("{} above {t} {watts}", self.title())
            }
            _ => self.title(),
        }
    }
}

/// The folder of an analysis, below that of the view.
pub(super) fn analysis(threshold_w_m2: f64) -> String {
    format!("glare-{threshold_w_m2}")
}

/// The unit of irradiance, for people.
pub fn irradiance_unit(basis: SpectralBasis) -> &'static str {
    match basis {
        SpectralBasis::Visible => "visible W/m²",
        SpectralBasis::Broadband => "W/m²",
    }
}

fn exposure_unit(basis: SpectralBasis) -> &'static str {
    match basis {
        SpectralBasis::Visible => "visible Wh/m²",
        SpectralBasis::Broadband => "Wh/m²",
    }
}

/// Which irradiance it is, for people.
pub fn quantity_words(quantity: Irradiance) -> &'static str {
    match quantity {
        Irradiance::Surface => "on the surface",
        Irradiance::FacingBeam => "normal to the beam",
    }
}

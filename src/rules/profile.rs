//! Criteria as data: what a profile says, and how it is read and checked.
//!
//! Rules differ by country and change, so none is code: a profile is a `.toml` beside this file or
//! one of the user's, with its source, its standing and its limits. A limit names a quantity, an
//! operator, and the conditions under which it was stated; what the engine can't measure under
//! these conditions is "not evaluated", never silently passed.

use serde::{Deserialize, Serialize};

use super::error::Error;

/// The profiles that come with the program.
const BUILT_IN: [(&str, &str); 9] = [
    ("paper-2018", include_str!("paper-2018.toml")),
    ("de-lai-2015", include_str!("de-lai-2015.toml")),
    ("ch-swissolar-2021", include_str!("ch-swissolar-2021.toml")),
    ("ch-practice-2021", include_str!("ch-practice-2021.toml")),
    ("at-ove-r11-3-2016", include_str!("at-ove-r11-3-2016.toml")),
    ("uk-pagerpower-4", include_str!("uk-pagerpower-4.toml")),
    ("us-faa-2013", include_str!("us-faa-2013.toml")),
    ("us-faa-2021", include_str!("us-faa-2021.toml")),
    ("sandia-hazard", include_str!("sandia-hazard.toml")),
];

/// One set of criteria.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Its name in project files.
    pub id: String,
    /// Edition of this file's content.
    pub version: String,
    /// What standing it has.
    pub status: Status,
    /// Where it comes from.
    pub source: String,
    /// What a reader should know.
    #[serde(default)]
    pub note: String,
    /// Names for how many limits are exceeded, from none; empty where only yes or no counts.
    #[serde(default)]
    pub grades: Vec<String>,
    /// Its limits; none where there is no numerical criterion.
    #[serde(default, rename = "limit")]
    pub limits: Vec<Limit>,
}

/// What standing a profile has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// In force, or in use.
    Current,
    /// Replaced by a later one.
    Superseded,
    /// Taken back.
    Withdrawn,
    /// A custom without the force of a limit.
    Orientation,
    /// A result of research.
    Research,
    /// This file holds only part of what the source says.
    Incomplete,
}

/// Who or what is dazzled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    /// Rooms where people live and sleep.
    Dwelling,
    /// Rooms where people work.
    Office,
    /// Terraces and gardens, 6 to 22 h.
    Outdoor,
    /// Drivers.
    Road,
    /// Train drivers.
    Rail,
    /// Pilots and towers.
    Aviation,
    /// Plants.
    Vegetation,
    /// A plot that may be built on, 2 m above the ground.
    Plot,
}

impl Class {
    /// Clock times at which terraces and gardens are used, h.
    const WAKING_H: [f64; 2] = [6.0, 22.0];

    /// Whether glare counts at a clock time, h: outdoors only when people are up.
    pub fn counts_at(self, civil_hour: f64) -> bool {
        let [from, to] = Self::WAKING_H;
        self != Self::Outdoor || (from..=to).contains(&civil_hour)
    }
}

/// What a limit is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Most minutes of one glare event at one point: the paper's measure.
    SustainedMin,
    /// Longest uninterrupted run at one point, min.
    LongestRunMin,
    /// Most minutes of one day.
    DailyTotalMin,
    /// Hours of the year.
    AnnualH,
    /// Months with glare.
    Months,
    /// Luminance, cd/m2.
    LuminanceCdM2,
    /// Retinal irradiance over that of a potential after-image, `3.59e-5 / w^1.77` W/cm2.
    AfterImageRatio,
    /// Retinal irradiance over that of a burn, `0.118 / w` W/cm2 (1 above w = 0.118 rad).
    BurnRatio,
    /// Largest irradiance of any timestep, W/m2.
    IrradianceWM2,
    /// Distance to the nearest PV in sight, m.
    DistanceM,
    /// Area of all PV, m2.
    PvAreaM2,
    /// Largest angle between two points of the PV in sight, degrees.
    SubtendedDeg,
}

impl Quantity {
    /// Its unit, for people.
    pub fn unit(self) -> &'static str {
        match self {
            Self::SustainedMin | Self::LongestRunMin | Self::DailyTotalMin => "min",
            Self::AnnualH => "h",
            Self::Months => "months",
            Self::LuminanceCdM2 => "cd/m²",
            Self::AfterImageRatio | Self::BurnRatio => "times",
            Self::IrradianceWM2 => "W/m²",
            Self::DistanceM => "m",
            Self::PvAreaM2 => "m²",
            Self::SubtendedDeg => "°",
        }
    }

    /// What it is, for people.
    pub fn words(self) -> &'static str {
        match self {
            Self::SustainedMin => "longest glare event",
            Self::LongestRunMin => "longest glare without a break",
            Self::DailyTotalMin => "glare on the worst day",
            Self::AnnualH => "glare in the year",
            Self::Months => "months with glare",
            Self::LuminanceCdM2 => "luminance",
            Self::AfterImageRatio => "after-image hazard",
            Self::BurnRatio => "burn hazard",
            Self::IrradianceWM2 => "strongest irradiance",
            Self::DistanceM => "distance to the PV",
            Self::PvAreaM2 => "area of the PV",
            Self::SubtendedDeg => "angle that the PV spans",
        }
    }

    /// Whether it counts time above a threshold of irradiance.
    pub fn is_time(self) -> bool {
        matches!(
            self,
            Self::SustainedMin
                | Self::LongestRunMin
                | Self::DailyTotalMin
                | Self::AnnualH
                | Self::Months
        )
    }
}

/// When a limit is exceeded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Operator {
    /// Strictly above the value.
    #[default]
    Above,
    /// At the value already.
    AtLeast,
    /// Strictly below the value: a distance.
    Below,
}

impl Operator {
    /// Whether a value exceeds a limit.
    pub fn exceeds(self, value: f64, limit: f64) -> bool {
        match self {
            Self::Above => value > limit,
            Self::AtLeast => value >= limit,
            Self::Below => value < limit,
        }
    }

    /// As people say it.
    pub fn words(self) -> &'static str {
        match self {
            Self::Above => "more than",
            Self::AtLeast => "at least",
            Self::Below => "less than",
        }
    }
}

/// One limit of a profile.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limit {
    /// Its name in the profile.
    pub id: String,
    /// What is measured.
    pub quantity: Quantity,
    /// When it is exceeded.
    #[serde(default)]
    pub operator: Operator,
    /// The limit, in the quantity's unit.
    pub value: f64,
    /// The irradiance above which time counts, W/m2; none where the rule names none.
    pub threshold_w_m2: Option<f64>,
    /// Whether the irradiance is filtered before it is compared with the threshold.
    #[serde(default)]
    pub filtered: bool,
    /// Whom it protects; empty: everyone.
    #[serde(default)]
    pub classes: Vec<Class>,
    /// What must have been assumed when the quantity was measured.
    #[serde(default)]
    pub conditions: Vec<String>,
    /// A limit of this profile: if that one is kept, this one doesn't matter.
    pub excused_by: Option<String>,
    /// It only excuses others: exceeding it means nothing by itself.
    #[serde(default)]
    pub only_excuses: bool,
    /// It is only listed among the criteria that are met: it decides nothing by itself.
    #[serde(default)]
    pub only_informs: bool,
}

/// The ids of the profiles that come with the program.
pub fn ids() -> impl Iterator<Item = &'static str> {
    BUILT_IN.iter().map(|(id, _)| *id)
}

/// A profile that comes with the program.
///
/// # Errors
/// [`Error::Unknown`] names those that exist.
pub fn built_in(id: &str) -> Result<Profile, Error> {
    let found = BUILT_IN.iter().find(|(known, _)| *known == id);
    let (_, text) = found.ok_or_else(|| Error::Unknown {
        name: id.to_owned(),
        known: ids().collect::<Vec<_>>().join(", "),
    })?;
    load(id, text)
}

/// Reads a profile from TOML; `name` says in errors where it comes from.
///
/// # Errors
/// [`Error::Profile`] for TOML that doesn't hold a profile, limits without a finite value, doubled
/// names, or excuses that lead nowhere.
pub fn load(name: &str, text: &str) -> Result<Profile, Error> {
    let wrong = |message: String| Error::Profile { name: name.to_owned(), message };
    let profile: Profile = toml::from_str(text).map_err(|e| {
        let at = e.span().map_or(0, |span| span.start.min(text.len()));
        let before = text.get(..at).unwrap_or("");
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
        wrong(format!("line {line}, column {column}: {}", e.message()))
    })?;
    let grades = profile.grades.len();
    let counted = profile.limits.iter().filter(|l| !l.only_excuses && !l.only_informs).count();
    if grades != 0 && grades != counted + 1 {
        return Err(wrong(format!(
            "grades: expected a name for 0 to {counted} exceeded limits ({} names), found {grades}",
            counted + 1
        )));
    }
    for (number, limit) in profile.limits.iter().enumerate() {
        let id = &limit.id;
        if !limit.value.is_finite() || !limit.threshold_w_m2.is_none_or(|t| t >= 0.0) {
            return Err(wrong(format!("limit {id}: value and threshold must be finite and >= 0")));
        }
        if profile.limits[..number].iter().any(|other| other.id == *id) {
            return Err(wrong(format!("limit {id} is there twice")));
        }
        if let Some(excuse) = &limit.excused_by {
            let other = profile.limits.iter().find(|other| other.id == *excuse);
            if excuse == id || other.is_none_or(|other| other.excused_by.is_some()) {
                return Err(wrong(format!(
                    "limit {id} is excused by {excuse}, expected another limit that has no excuse"
                )));
            }
        }
    }
    Ok(profile)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_profiles_are_whole() {
        for id in ids() {
            let profile = built_in(id).unwrap();
            assert_eq!(profile.id, id);
            assert!(!profile.source.is_empty() && !profile.version.is_empty(), "{id}");
            let grades = profile.grades.len();
            assert!(grades == 0 || grades == profile.limits.len() + 1, "{id}");
        }
        let error = built_in("paper-2019").unwrap_err().to_string();
        assert!(error.contains("paper-2018"), "{error}");
    }

    #[test]
    fn broken_profiles_are_refused() {
        let head = "id='a'\nversion='1'\nstatus='current'\nsource='s'\n";
        let limit = "[[limit]]\nid='l'\nquantity='annual_h'\nvalue=50\n";
        assert!(load("mine", &format!("{head}{limit}")).is_ok());
        let message = load("mine.toml", &format!("{head}{limit}colour='red'\n")).unwrap_err();
        assert!(message.to_string().contains("line 9"), "{message}");
        for wrong in [
            format!("{head}{limit}{limit}"),
            format!("{head}{limit}colour='red'\n"),
            format!("{head}{limit}excused_by='x'\n"),
            format!("{head}{limit}excused_by='l'\n"),
            format!("{head}{limit}threshold_w_m2=-1\n"),
            format!("{head}grades=['low']\n{limit}"),
            format!("{head}[[limit]]\nid='l'\nquantity='annual_h'\nvalue=nan\n"),
            limit.to_owned(),
            "[".to_owned(),
        ] {
            assert!(matches!(load("mine", &wrong), Err(Error::Profile { .. })), "{wrong}");
        }
    }
}

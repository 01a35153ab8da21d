use super::Error;

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

impl Place {
    /// The numbers that can't be a place's.
    pub fn mistakes(&self) -> Vec<Error> {
        let checks = [
            ("latitude", self.latitude_deg, -90.0, 90.0, "-90 to 90 degrees north"),
            ("longitude", self.longitude_deg, -180.0, 180.0, "-180 to 180 degrees east"),
            ("meridian", self.meridian_deg, -180.0, 180.0, "-180 to 180 degrees east"),
            ("elevation_m", self.elevation_m, -500.0, 9000.0, "-500 to 9000 m"),
        ];
        let outside =
            checks.into_iter().filter(|(_, v, least, most, _)| !(least..=most).contains(&v));
        outside
            .map(|(field, found, .., expected)| Error::Place { field, expected, found })
            .collect()
    }

    /// Checks that the numbers can be a place.
    pub(super) fn check(&self) -> Result<(), Error> {
        self.mistakes().into_iter().next().map_or(Ok(()), Err)
    }
}

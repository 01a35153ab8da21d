use std::io::{self, Write};

use super::altitude_azimuth_deg;
use crate::base::{Timeline, Timestep};

/// A timestep as people read it.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Row {
    /// Index of the timestep.
    pub index: usize,
    /// Day of the year, 0 is 1 January.
    pub day: u32,
    /// Hour of the day, local standard time.
    pub hour: f64,
    /// Geometric altitude of the sun's centre, degrees.
    pub altitude_deg: f64,
    /// Clockwise from north, degrees.
    pub azimuth_deg: f64,
    /// East component of the unit vector to the sun.
    pub x: f64,
    /// North component.
    pub y: f64,
    /// Up component.
    pub z: f64,
    /// Direct normal irradiance, W/m2.
    pub irradiance_w_m2: f64,
    /// How many hours of the year it stands for.
    pub weight_h: f64,
    /// Number of the segment.
    pub segment: u32,
}

impl Row {
    fn new((index, step): (usize, &Timestep)) -> Self {
        let (altitude_deg, azimuth_deg) = altitude_azimuth_deg(step.sun);
        Self {
            index,
            day: step.day,
            hour: step.hour,
            altitude_deg,
            azimuth_deg,
            x: step.sun.x,
            y: step.sun.y,
            z: step.sun.z,
            irradiance_w_m2: step.irradiance_w_m2,
            weight_h: step.weight_h,
            segment: step.segment,
        }
    }
}

/// The rows of a timeline.
pub fn rows(timeline: &Timeline) -> impl Iterator<Item = Row> {
    timeline.steps.iter().enumerate().map(Row::new)
}

/// Writes suns.csv: a line of names, then a line for each timestep, reals with 6 decimals.
///
/// # Errors
/// Whatever the writer says.
pub fn write_csv(out: &mut impl Write, timeline: &Timeline) -> io::Result<()> {
    writeln!(out, "index,day,hour,altitude_deg,azimuth_deg,x,y,z,irradiance_w_m2,weight_h")?;
    for row in rows(timeline) {
        write!(out, "{},{}", row.index, row.day)?;
        let azimuth = if row.azimuth_deg >= 359.999_999_5 { 0.0 } else { row.azimuth_deg };
        for value in [
            row.hour,
            row.altitude_deg,
            azimuth,
            row.x,
            row.y,
            row.z,
            row.irradiance_w_m2,
            row.weight_h,
        ] {
            // What rounds to zero has no sign.
            let value = if value.abs() < 5e-7 { 0.0 } else { value };
            write!(out, ",{value:.6}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::SpectralBasis;
    use glam::DVec3;

    #[test]
    fn the_csv_is_the_handbooks() {
        let step = |sun| Timestep {
            day: 3,
            hour: 4.5,
            sun,
            irradiance_w_m2: 98.25,
            weight_h: 3.5,
            segment: 0,
        };
        let timeline = Timeline {
            steps: vec![step(DVec3::new(1.0, 0.0, 0.0)), step(DVec3::new(-1e-12, 1.0, -1e-9))],
            step_h: 0.25,
            year: 2018,
            half_year: true,
            sun_diameter_deg: 0.5,
            basis: SpectralBasis::Visible,
        };
        let mut out = Vec::new();
        write_csv(&mut out, &timeline).unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap(),
            "index,day,hour,altitude_deg,azimuth_deg,x,y,z,irradiance_w_m2,weight_h\n\
             0,3,4.500000,0.000000,90.000000,1.000000,0.000000,0.000000,98.250000,3.500000\n\
             1,3,4.500000,0.000000,0.000000,0.000000,1.000000,0.000000,98.250000,3.500000\n"
        );
    }
}

//! A volume as pictures, two for each timestep: the numbers and the colours.

use std::fs;
use std::ops::Range;
use std::path::Path;

use anyhow::Context as _;

use crate::base::Irradiance;
use crate::base::{Grid, Progress, Provenance, SpectralBasis};
use crate::picture::{Figure, Scale, exr};
use crate::sky;
use crate::volume::Volume;

/// Decades of the logarithmic scale.
const DECADES: f64 = 3.0;

/// Writes `t00012.exr` and `t00012.png` for each timestep of `range` into `dir`; all in colours of
/// one scale that covers the whole volume, so that parts that are exported one by one compare.
/// Returns the greatest value of the scale, W/m2.
pub(super) fn write(
    volume: &Volume,
    range: Range<usize>,
    dir: &Path,
    progress: &dyn Progress,
) -> anyhow::Result<f64> {
    fs::create_dir_all(dir).with_context(|| format!("{} can't be made", dir.display()))?;
    let peak = volume.peak(progress)?;
    progress.finish();
    let unit = match volume.axis().map(|a| a.basis) {
        Some(SpectralBasis::Visible) => "visible W/m²",
        _ => "W/m²",
    };
    let scale = Scale::fitted([&peak], None, Some(DECADES), unit);
    let [_, rows, columns] = volume.shape();
    let mut slice = Grid::filled(columns, rows, 0.0_f32);
    let channel = match volume.quantity() {
        Some(Irradiance::FacingBeam) => "irradiance_normal.w_m2",
        _ => "irradiance.w_m2",
    };
    progress.begin("pictures", range.len() as u64, "timesteps");
    for timestep in range {
        progress.check()?;
        volume.read(timestep..timestep + 1, slice.data_mut())?;
        let name = |extension: &str| dir.join(format!("t{timestep:05}.{extension}"));
        let when = when(volume, timestep);
        let about = [
            ("glintmap.program".to_owned(), Provenance::PROGRAM.to_owned()),
            ("glintmap.timestep".to_owned(), timestep.to_string()),
            ("glintmap.when".to_owned(), when.clone()),
        ];
        exr::write(&name("exr"), &[(channel, &slice)], &about)?;
        let mut figure = Figure::new(&slice, scale.clone());
        figure.title = format!("Timestep {timestep}");
        figure.subtitle = when;
        figure.legend = match volume.quantity() {
            Some(Irradiance::FacingBeam) => "irradiance normal to the beam".into(),
            _ => "irradiance".into(),
        };
        figure.bare = "no colour: 0".into();
        figure.write_png(&name("png"), &about)?;
        progress.advance(1);
    }
    progress.finish();
    Ok(scale.max)
}

/// `2018-06-21 (day 171), 08:30 standard time`; empty where the volume doesn't know.
fn when(volume: &Volume, timestep: usize) -> String {
    let Some(axis) = volume.axis() else { return String::new() };
    let (Some(&day), Some(&hour)) = (axis.day.get(timestep), axis.hour.get(timestep)) else {
        return String::new();
    };
    // Days and hours of an imported volume are whatever its maker wrote.
    if day >= sky::days_in_year(axis.year) || !(0.0..24.0).contains(&hour) {
        return format!("day {day}, {hour} h");
    }
    let (month, day_of_month) = sky::date_of_day(axis.year, day);
    let minutes = (hour * 60.0).round() as u32;
    format!(
        "{}-{month:02}-{day_of_month:02} (day {day}), {:02}:{:02} standard time",
        axis.year,
        minutes / 60,
        minutes % 60
    )
}

//! Values coloured and laid over a background.

use super::Error;
use super::canvas::mix;
use super::channels::{Rgb, luminance};
use super::scale::Scale;
use super::scale::percentile;
use crate::base::Grid;

/// What shows where there are neither values nor a background.
pub const BARE: [u8; 3] = [0xee, 0xef, 0xf1];
/// How much of the data's colour shows over a background: enough of the grey stays to see roofs.
pub const OPACITY: f64 = 0.9;

/// How values are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Contours {
    /// Every pixel in its own colour.
    #[default]
    None,
    /// Only the lines between the legend's parts (Radiance's `-cl`).
    Lines,
    /// One colour for each part of the legend (Radiance's `-cb`).
    Bands,
}

/// The background in shades of grey, its own contrast spread between dark and middle grey: on it
/// the palettes read as light, much glows and little recedes.
pub fn greyed(background: &Rgb) -> Grid<[u8; 3]> {
    const DARKEST: f64 = 42.0;
    const LIGHTEST: f64 = 196.0;
    // Shares of the lit pixels that turn darkest and lightest: shadows and white walls.
    const DARK_SHARE: f64 = 0.03;
    const LIGHT_SHARE: f64 = 0.99;
    let lightness = background.map(|&p| libm::cbrtf(luminance(p).max(0.0)));
    let dark = percentile([&lightness], DARK_SHARE);
    let light = percentile([&lightness], LIGHT_SHARE);
    let span = (light - dark).max(1e-6);
    lightness.map(|&v| {
        let t = ((f64::from(v) - dark) / span).clamp(0.0, 1.0);
        [(DARKEST + (LIGHTEST - DARKEST) * t + 0.5) as u8; 3]
    })
}

/// The borders of the legend's parts, as places on the palette.
fn borders(scale: &Scale) -> Vec<f64> {
    let mut places: Vec<f64> = scale.ticks().iter().map(|t| t.position).collect();
    places.retain(|p| *p > 1e-6 && *p < 1.0 - 1e-6);
    places
}

/// The colours of each value and their opacity, 0 to 1, before anything is laid under them.
///
/// # Errors
/// [`Error::Setting`] for a scale that can't be used.
pub fn colored(
    data: &Grid<f32>,
    scale: &Scale,
    contours: Contours,
) -> Result<Grid<([u8; 3], f64)>, Error> {
    scale.check()?;
    if contours == Contours::None {
        return Ok(data.map(|&v| (scale.color(f64::from(v)), scale.opacity(f64::from(v)))));
    }
    let borders = borders(scale);
    let part = |v: f32| {
        let place = scale.position(f64::from(v));
        borders.iter().filter(|b| place >= **b).count()
    };
    let band_color = |part: usize| {
        let low = if part == 0 { 0.0 } else { borders[part - 1] };
        let high = borders.get(part).copied().unwrap_or(1.0);
        scale.palette.color((low + high) / 2.0)
    };
    if contours == Contours::Bands {
        return Ok(data.map(|&v| (band_color(part(v)), scale.opacity(f64::from(v)))));
    }
    let mut out = Grid::filled(data.columns(), data.rows(), ([0; 3], 0.0));
    for row in 0..data.rows() {
        for column in 0..data.columns() {
            let here = part(data[(column, row)]);
            let beside = |c: usize, r: usize| part(data[(c, r)]);
            let mut highest = here;
            if column + 1 < data.columns() {
                highest = highest.max(beside(column + 1, row));
            }
            if row + 1 < data.rows() {
                highest = highest.max(beside(column, row + 1));
            }
            if highest > here {
                out[(column, row)] = (scale.palette.color(borders[highest - 1]), 1.0);
            } else if column > 0 && beside(column - 1, row) < here
                || row > 0 && beside(column, row - 1) < here
            {
                out[(column, row)] = (scale.palette.color(borders[here - 1]), 1.0);
            }
        }
    }
    Ok(out)
}

/// New values against old ones: 0 where the old value is 0 or either is not a finite number.
///
/// # Errors
/// [`Error::Size`] for grids of different sizes.
pub fn ratio(new: &Grid<f32>, old: &Grid<f32>) -> Result<Grid<f32>, Error> {
    same_size("the old picture", old, "the new one", new)?;
    let divide = |(&new, &old): (&f32, &f32)| {
        let value = new / old;
        if old == 0.0 || !value.is_finite() { 0.0 } else { value }
    };
    let data = new.data().iter().zip(old.data()).map(divide).collect();
    Ok(Grid::from_vec(new.columns(), new.rows(), data))
}

/// Refuses rasters of different sizes.
///
/// # Errors
/// [`Error::Size`].
pub fn same_size<A, B>(what: &str, a: &Grid<A>, of: &str, b: &Grid<B>) -> Result<(), Error> {
    if (a.columns(), a.rows()) == (b.columns(), b.rows()) {
        return Ok(());
    }
    Err(Error::Size {
        what: what.to_owned(),
        found_columns: a.columns(),
        found_rows: a.rows(),
        columns: b.columns(),
        rows: b.rows(),
        of: of.to_owned(),
    })
}

/// A picture enlarged by a whole number: data keep their pixels, the background is interpolated.
pub(super) fn enlarge(
    data: &Grid<([u8; 3], f64)>,
    background: Option<&Grid<[u8; 3]>>,
    factor: usize,
    opacity: f64,
) -> Grid<[u8; 3]> {
    let (columns, rows) = (data.columns() * factor, data.rows() * factor);
    let mut out = Grid::filled(columns, rows, BARE);
    for y in 0..rows {
        for x in 0..columns {
            let under = background.map_or(BARE, |b| smooth(b, x, y, factor));
            let (color, alpha) = data[(x / factor, y / factor)];
            // Without a background there is nothing to see through to.
            let alpha = if background.is_some() { alpha * opacity } else { alpha };
            out[(x, y)] = if alpha > 0.0 { mix(under, color, alpha) } else { under };
        }
    }
    out
}

fn smooth(picture: &Grid<[u8; 3]>, x: usize, y: usize, factor: usize) -> [u8; 3] {
    if factor == 1 {
        return picture[(x, y)];
    }
    let place = |at: usize, count: usize| {
        let p = ((at as f64 + 0.5) / factor as f64 - 0.5).clamp(0.0, (count - 1) as f64);
        let low = p as usize;
        (low, (low + 1).min(count - 1), p - low as f64)
    };
    let (x0, x1, u) = place(x, picture.columns());
    let (y0, y1, v) = place(y, picture.rows());
    [0, 1, 2].map(|c| {
        let at = |x, y| f64::from(picture[(x, y)][c]);
        let top = at(x0, y0) + (at(x1, y0) - at(x0, y0)) * u;
        let bottom = at(x0, y1) + (at(x1, y1) - at(x0, y1)) * u;
        (top + (bottom - top) * v + 0.5) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ratio_is_zero_where_nothing_was_before() {
        let new = Grid::from_vec(5, 1, vec![2.0, 0.0, 3.0, f32::NAN, 1.0]);
        let old = Grid::from_vec(5, 1, vec![1.0, 4.0, 0.0, 1.0, f32::INFINITY]);
        assert_eq!(ratio(&new, &old).expect("same size").data(), [2.0, 0.0, 0.0, 0.0, 0.0]);
        assert!(ratio(&new, &Grid::filled(4, 1, 1.0)).is_err());
    }

    #[test]
    fn where_nothing_arrives_the_background_shows_untouched() {
        let data = Grid::from_vec(2, 1, vec![0.0, 5.0]);
        let colors = colored(&data, &Scale::linear(10.0, ""), Contours::None).expect("colours");
        let under = Grid::filled(2, 1, [90u8; 3]);
        let out = enlarge(&colors, Some(&under), 3, OPACITY);
        assert_eq!((out.columns(), out.rows()), (6, 3));
        assert_eq!(out[(2, 2)], [90; 3]);
        let full = enlarge(&colors, Some(&under), 3, 1.0);
        assert_eq!(full[(3, 0)], Scale::linear(10.0, "").color(5.0));
    }

    #[test]
    fn bands_have_as_many_colours_as_the_legend_has_parts_and_lines_lie_between() {
        let scale = Scale { divisions: Some(4), ..Scale::linear(8.0, "") };
        let ramp = Grid::from_vec(80, 3, (0..240).map(|i| (i % 80) as f32 * 0.1 + 0.01).collect());
        let bands = colored(&ramp, &scale, Contours::Bands).expect("colours");
        let mut seen: Vec<_> = bands.data().iter().map(|(c, _)| *c).collect();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), 4);
        let lines = colored(&ramp, &scale, Contours::Lines).expect("colours");
        let drawn: Vec<usize> = (0..80).filter(|&c| lines[(c, 1)].1 > 0.0).collect();
        assert_eq!(drawn, [19, 20, 39, 40, 59, 60]);
    }
}

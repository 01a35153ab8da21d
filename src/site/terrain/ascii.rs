use glam::{DMat2, DVec2};

use super::grid::{Grid, Layout, Region};

/// Reads an ESRI ASCII grid: six lines of header, then heights from the north-west, by row. The
/// corner is that of the cell (`xllcorner`) or its middle (`xllcenter`). A fault's line and
/// message.
pub(in crate::site) fn read(bytes: &[u8], region: Option<Region>) -> Result<Grid, (usize, String)> {
    let text = String::from_utf8_lossy(bytes);
    let mut header = Header::default();
    let mut rest = &text[..];
    let mut number = 0;
    // Keys are words, heights aren't.
    while let Some((line, after)) = rest.split_once('\n') {
        let mut words = line.split_ascii_whitespace();
        let key = words.next().unwrap_or_default();
        if key.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)) {
            break;
        }
        number += 1;
        rest = after;
        if key.is_empty() {
            continue;
        }
        let word = words.next().unwrap_or("nothing");
        header.set(key, word).map_err(|message| (number, message))?;
    }
    let layout = header.layout().map_err(|message| (number, message))?;
    // A height takes a digit and a blank at least: a larger number of them is no claim to follow.
    if layout.columns.saturating_mul(layout.rows) > text.len() {
        let message = format!(
            "ncols {} and nrows {} don't fit a file of {} bytes",
            layout.columns,
            layout.rows,
            text.len()
        );
        return Err((number, message));
    }
    let window = layout.window(region).map_err(|message| (number, message))?;
    let mut heights = Vec::with_capacity(window[0].len() * window[1].len());
    let mut count = 0;
    for (i, line) in rest.lines().enumerate() {
        for word in line.split_ascii_whitespace() {
            let (x, y) = (count % layout.columns, count / layout.columns);
            count += 1;
            if !window[0].contains(&x) || !window[1].contains(&y) {
                continue;
            }
            let value = word.parse::<f64>().ok();
            let Some(value) =
                value.filter(|v| v.abs() < 1e6 || Some(*v) == header.nodata || v.is_nan())
            else {
                return Err((
                    number + i + 1,
                    format!("expected a height in metres, found `{word}`"),
                ));
            };
            let none = Some(value) == header.nodata;
            heights.push(if none { f32::NAN } else { value as f32 });
        }
    }
    if count != layout.columns * layout.rows {
        let message = format!(
            "{} columns and {} rows need {} heights, found {count}",
            layout.columns,
            layout.rows,
            layout.columns * layout.rows
        );
        return Err((number + rest.lines().count(), message));
    }
    let whole = [layout.columns, layout.rows];
    Ok(Grid { layout: layout.part(&window), heights, whole, crs: None })
}

#[derive(Default)]
struct Header {
    columns: Option<usize>,
    rows: Option<usize>,
    /// Value, and whether it is the cell's middle.
    x: Option<(f64, bool)>,
    y: Option<(f64, bool)>,
    cell: [Option<f64>; 2],
    nodata: Option<f64>,
}

impl Header {
    fn set(&mut self, key: &str, word: &str) -> Result<(), String> {
        let wrong = || format!("expected a number after {key}, found `{word}`");
        let real = || word.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(wrong);
        match key.to_ascii_lowercase().as_str() {
            "ncols" => self.columns = Some(word.parse().map_err(|_| wrong())?),
            "nrows" => self.rows = Some(word.parse().map_err(|_| wrong())?),
            "xllcorner" => self.x = Some((real()?, false)),
            "xllcenter" => self.x = Some((real()?, true)),
            "yllcorner" => self.y = Some((real()?, false)),
            "yllcenter" => self.y = Some((real()?, true)),
            "cellsize" => self.cell = [Some(real()?); 2],
            "dx" => self.cell[0] = Some(real()?),
            "dy" => self.cell[1] = Some(real()?),
            "nodata_value" => self.nodata = word.parse().ok(),
            _ => {
                return Err(format!(
                    "expected ncols, nrows, xllcorner, yllcorner, cellsize or NODATA_value, found `{key}`: is it an ESRI ASCII grid?"
                ));
            }
        }
        Ok(())
    }

    fn layout(&self) -> Result<Layout, String> {
        let Self { columns: Some(columns), rows: Some(rows), .. } = *self else {
            return Err("the header lacks ncols or nrows".to_owned());
        };
        let (Some(x), Some(y)) = (self.x, self.y) else {
            return Err("the header lacks xllcorner or yllcorner".to_owned());
        };
        let [Some(dx), Some(dy)] = self.cell else {
            return Err("the header lacks cellsize".to_owned());
        };
        if columns == 0 || rows == 0 || dx <= 0.0 || dy <= 0.0 {
            return Err("ncols, nrows and cellsize must be above 0".to_owned());
        }
        let middle = |(at, is_middle): (f64, bool), cell: f64| {
            if is_middle { at } else { at + 0.5 * cell }
        };
        let south = middle(y, dy);
        let origin = DVec2::new(middle(x, dx), south + dy * (rows - 1) as f64);
        let axes = DMat2::from_diagonal(DVec2::new(dx, -dy));
        Ok(Layout { origin, axes, columns, rows })
    }
}

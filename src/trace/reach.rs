use super::compass::{BINS, compass};
use super::emitter::Pieces;

/// Which pieces of an emitter may reach something in a direction: their horizons as one picture,
/// azimuth by elevation, in which each pixel is a set of pieces; and the same with columns of 2,
/// 4, 8, … times the width. Conservative as the horizons are.
///
/// Rows go upwards; a row's pixels hold for every direction above the row's lower edge.
#[derive(Debug)]
pub(super) struct Reach {
    columns: usize,
    rows: usize,
    /// By level; row-major by column, so that a column's rows lie side by side.
    levels: Vec<Vec<Pieces>>,
}

/// Elevation as a number from -1 to 1, from its sine and cosine (or a tangent and 1): even enough
/// about level, and without trigonometry.
fn slope(sine: f64, cosine: f64) -> f64 {
    if sine.is_infinite() {
        return sine.signum();
    }
    sine / (cosine + sine.abs()).max(f64::MIN_POSITIVE)
}

impl Reach {
    /// From the horizons' tangents, [`BINS`] for each piece; `columns` (a power of two, at most
    /// [`BINS`]) and rows.
    pub(super) fn of(tangents: &[f32], (columns, rows): (usize, usize)) -> Self {
        let mut finest = vec![0; columns * rows];
        let merged = BINS / columns;
        for (piece, tangents) in tangents.chunks(BINS).enumerate() {
            for (column, bins) in tangents.chunks(merged).enumerate() {
                let highest = bins.iter().fold(f32::NEG_INFINITY, |a, &b| a.max(b));
                if highest == f32::NEG_INFINITY {
                    continue;
                }
                let top = 0.5 * (slope(f64::from(highest), 1.0) + 1.0) * rows as f64;
                // All rows whose lower edge isn't above the horizon.
                let count = ((top + 1e-6) as usize + 1).min(rows);
                for pixel in &mut finest[column * rows..column * rows + count] {
                    *pixel |= 1 << piece;
                }
            }
        }
        let mut levels = vec![finest];
        let mut wide = columns;
        while wide > 1 {
            wide /= 2;
            let below = &levels[levels.len() - 1];
            let pairs = (0..wide * rows)
                .map(|i| {
                    let (column, row) = (i / rows, i % rows);
                    below[2 * column * rows + row] | below[(2 * column + 1) * rows + row]
                })
                .collect();
            levels.push(pairs);
        }
        Self { columns, rows, levels }
    }

    /// The row of an elevation.
    #[inline]
    pub(super) fn row(&self, sine: f64, cosine: f64) -> usize {
        let at = 0.5 * (slope(sine, cosine) + 1.0) * self.rows as f64 - 1e-6;
        (at.max(0.0) as usize).min(self.rows - 1)
    }

    /// The column of an azimuth, moved by some slack; from 0 to `columns`.
    #[inline]
    pub(super) fn column(&self, x: f64, y: f64, slack: f64) -> u32 {
        let columns = self.columns as f64;
        let at = compass(x, y) * (columns / 4.0) + slack;
        let at = if at < 0.0 { at + columns } else { at };
        (at as u32) & (self.columns as u32 - 1)
    }

    #[inline]
    pub(super) fn at(&self, level: usize, column: usize, row: usize) -> Pieces {
        self.levels[level][column * self.rows + row]
    }

    pub(super) fn all_around(&self, row: usize) -> Pieces {
        self.at(self.levels.len() - 1, 0, row)
    }

    /// All columns from one to another, eastwards of north or not: upwards, around the end.
    pub(super) fn between(&self, from: u32, to: u32, row: usize) -> Pieces {
        let (from, to) = (from as usize, to as usize);
        let count = (to + self.columns - from) % self.columns + 1;
        // Two or three columns of a level that is about as wide hold all of them.
        let level = (count.ilog2() as usize).min(self.levels.len() - 1);
        let wide = self.columns >> level;
        let last = (from + count - 1) >> level;
        ((from >> level)..=last).fold(0, |all, column| all | self.at(level, column % wide, row))
    }
}

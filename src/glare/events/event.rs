use super::threshold::RowRun;

/// One glare event: voxels above the threshold that are connected in time and space, inside one
/// segment.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// First timestep, from 0.
    pub first: u32,
    /// Last timestep, inclusive.
    pub last: u32,
    /// How many voxels it has.
    pub voxels: u64,
    /// How many different pixels it touches.
    pub pixels: u64,
    /// The highest filtered irradiance in it, W/m2.
    pub peak_w_m2: f32,
    /// Timestep of the peak; among equals the voxel with the lowest index.
    pub peak_timestep: u32,
    /// Row of the peak, 0 at the top.
    pub peak_row: u32,
    /// Column of the peak.
    pub peak_column: u32,
    /// Mean row of its voxels.
    pub centroid_row: f64,
    /// Mean column of its voxels.
    pub centroid_column: f64,
    /// Lowest index of its voxels in the volume, `(timestep * rows + row) * columns + column`.
    pub smallest_voxel: u64,
}

/// What is known so far of an event that is still alive.
#[derive(Clone, Copy, Debug)]
pub(in crate::glare) struct Growing {
    first: u32,
    last: u32,
    voxels: u64,
    /// Pixels touched. One that two merged events both touched counts twice until that is found.
    pub pixels: u64,
    peak_w_m2: f32,
    peak_voxel: u64,
    /// Sums over the voxels; 64 bits could overflow in the largest volume that is allowed.
    rows: u128,
    columns: u128,
    smallest_voxel: u64,
}

impl Growing {
    /// An event before its first run.
    pub fn new(timestep: u32) -> Self {
        Self {
            first: timestep,
            last: timestep,
            voxels: 0,
            pixels: 0,
            peak_w_m2: f32::NEG_INFINITY,
            peak_voxel: u64::MAX,
            rows: 0,
            columns: 0,
            smallest_voxel: u64::MAX,
        }
    }

    /// Adds a run of the slice at `timestep`, whose first voxel has the index `slice`.
    pub fn add(&mut self, run: &RowRun, timestep: u32, slice: u64, columns: u64) {
        let (start, end) = (u64::from(run.start), u64::from(run.end));
        let row = slice + u64::from(run.row) * columns;
        self.last = timestep;
        self.voxels += end - start;
        self.rows += u128::from(u64::from(run.row) * (end - start));
        self.columns += u128::from((start + end - 1) * (end - start) / 2);
        self.smallest_voxel = self.smallest_voxel.min(row + start);
        self.raise_peak(run.peak_w_m2, row + u64::from(run.peak_column));
    }

    /// Adds another event that turns out to be the same.
    pub fn merge(&mut self, other: &Self) {
        self.first = self.first.min(other.first);
        self.last = self.last.max(other.last);
        self.voxels += other.voxels;
        self.pixels += other.pixels;
        self.rows += other.rows;
        self.columns += other.columns;
        self.smallest_voxel = self.smallest_voxel.min(other.smallest_voxel);
        self.raise_peak(other.peak_w_m2, other.peak_voxel);
    }

    fn raise_peak(&mut self, peak_w_m2: f32, voxel: u64) {
        let level = peak_w_m2 == self.peak_w_m2 && voxel < self.peak_voxel;
        if peak_w_m2 > self.peak_w_m2 || level {
            (self.peak_w_m2, self.peak_voxel) = (peak_w_m2, voxel);
        }
    }

    /// The event, now that nothing can join it any more.
    pub fn finished(&self, rows: u64, columns: u64) -> Event {
        // Timesteps, rows and columns are bounded by `limits`: they fit.
        let place = |value: u64| value as u32;
        Event {
            first: self.first,
            last: self.last,
            voxels: self.voxels,
            pixels: self.pixels,
            peak_w_m2: self.peak_w_m2,
            peak_timestep: place(self.peak_voxel / columns / rows),
            peak_row: place(self.peak_voxel / columns % rows),
            peak_column: place(self.peak_voxel % columns),
            centroid_row: self.rows as f64 / self.voxels as f64,
            centroid_column: self.columns as f64 / self.voxels as f64,
            smallest_voxel: self.smallest_voxel,
        }
    }
}

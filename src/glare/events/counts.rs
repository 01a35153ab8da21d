use std::ops::Range;

use crate::glare::slices::Calendar;

/// What is counted at each pixel by itself, whatever goes on beside it.
#[derive(Debug)]
pub(in crate::glare) struct Counts {
    columns: usize,
    pixels: Vec<Count>,
    yearly: Option<(Calendar, Vec<Yearly>)>,
}

/// One pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::glare) struct Count {
    /// Timesteps above the threshold.
    pub cumulative: u32,
    /// The most timesteps of an event that was over within one slab.
    pub sustained: u32,
    /// The longest uninterrupted run of timesteps.
    pub longest_run: u32,
    /// When the present run of timesteps began.
    since: u32,
    /// When the pixel was above the threshold last; before any clock if never.
    last: u32,
}

impl Count {
    /// The pixel is above the threshold at `clock`, which jumps where a segment begins and is
    /// never below 2.
    #[inline]
    pub fn touch(&mut self, clock: u32) {
        if self.last + 1 != clock {
            self.since = clock;
        }
        self.last = clock;
        self.cumulative += 1;
        self.longest_run = self.longest_run.max(clock - self.since + 1);
    }
}

/// What a pixel collects where the volume has a calendar.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::glare) struct Yearly {
    /// Hours of the year above the threshold.
    pub hours: f64,
    /// Days with glare.
    pub days: u32,
    /// The most timesteps above the threshold on one day.
    pub longest_day: u32,
    today: u32,
    /// The day after the one that `today` counts; 0 before the first.
    day_after: u32,
}

impl Yearly {
    fn touch(&mut self, day_after: u32, weight_h: f64) {
        if self.day_after != day_after {
            (self.day_after, self.today) = (day_after, 0);
            self.days += 1;
        }
        self.today += 1;
        self.longest_day = self.longest_day.max(self.today);
        self.hours += weight_h;
    }
}

impl Counts {
    /// Bytes for each pixel.
    pub const BYTES_PER_PIXEL: u64 = 20;
    /// The same for what a calendar brings.
    pub const YEARLY_BYTES_PER_PIXEL: u64 = 24;

    pub fn new(rows: usize, columns: usize, calendar: Option<Calendar>) -> Self {
        let pixels = rows * columns;
        let yearly = calendar.map(|calendar| (calendar, vec![Yearly::default(); pixels]));
        Self { columns, pixels: vec![Count::default(); pixels], yearly }
    }

    /// The counts of `rows`, cut into strips of so many rows.
    pub fn strips(&mut self, rows: Range<usize>, strip_rows: usize) -> Vec<StripCounts<'_>> {
        let columns = self.columns;
        let pixels = rows.start * columns..rows.end * columns;
        let mut yearly = self.yearly.as_mut().map(|(calendar, all)| {
            (&*calendar, all[pixels.clone()].chunks_mut(strip_rows * columns))
        });
        let cut = self.pixels[pixels].chunks_mut(strip_rows * columns);
        cut.map(|pixels| {
            let yearly = yearly.as_mut().and_then(|(calendar, all)| Some((*calendar, all.next()?)));
            StripCounts { pixels, yearly }
        })
        .collect()
    }

    pub fn pixels(&self) -> &[Count] {
        &self.pixels
    }

    /// What the calendar brought.
    pub fn yearly(&self) -> Option<&[Yearly]> {
        self.yearly.as_ref().map(|(_, pixels)| pixels.as_slice())
    }
}

/// The counts of some rows.
pub(in crate::glare) struct StripCounts<'a> {
    pub pixels: &'a mut [Count],
    yearly: Option<(&'a Calendar, &'a mut [Yearly])>,
}

impl StripCounts<'_> {
    /// These pixels are above the threshold at `timestep`, as the calendar has it.
    pub fn touch_yearly(&mut self, timestep: usize, pixels: Range<usize>) {
        if let Some((calendar, all)) = &mut self.yearly {
            let day_after = calendar.day[timestep].saturating_add(1);
            let weight_h = calendar.weight_h[timestep];
            all[pixels].iter_mut().for_each(|pixel| pixel.touch(day_after, weight_h));
        }
    }
}

//! The analysis once more, slow and plain: dense Gaussian, flood fill, the whole volume in memory.

use std::collections::BTreeMap;
use std::ops::Range;

use glintmap::base::Grid;
use glintmap::glare::{Connectivity, Event, Settings};

use super::Found;
use super::volumes::Memory;

/// What [`glintmap::glare::analyse`] should give, and the filtered volume.
pub fn analyse(
    volume: &Memory,
    segments: &[Range<usize>],
    settings: &Settings,
) -> (Found, Vec<f32>) {
    let [_, rows, columns] = volume.shape;
    let pixels = rows * columns;
    let mut filtered = volume.data.clone();
    let mut maps = [vec![0; pixels], vec![0; pixels], vec![0; pixels]];
    let mut events = Vec::new();
    for segment in segments {
        let part = &mut filtered[segment.start * pixels..segment.end * pixels];
        let shape = [segment.len(), rows, columns];
        for axis in 0..3 {
            smooth(part, shape, axis, settings.sigma[axis], settings.truncate);
        }
        let mask: Vec<bool> = part.iter().map(|v| *v > settings.threshold as f32).collect();
        count(&mask, pixels, &mut maps);
        let mut seen = vec![false; mask.len()];
        for start in 0..mask.len() {
            if mask[start] && !seen[start] {
                let voxels = flood(&mask, &mut seen, start, shape, settings.connectivity);
                events.push(event(&voxels, part, segment.start, shape, &mut maps[1]));
            }
        }
    }
    events.sort_by_key(|e: &Event| (e.first, e.last, e.voxels, e.pixels, e.smallest_voxel));
    let (mut days, mut longest_day, mut cumulative_h) = (None, None, None);
    if let Some(calendar) = &volume.calendar {
        let mut per_day = vec![BTreeMap::new(); pixels];
        let mut hours = vec![0.0_f64; pixels];
        for (i, _) in filtered.iter().enumerate().filter(|(_, v)| **v > settings.threshold as f32) {
            *per_day[i % pixels].entry(calendar.day[i / pixels]).or_insert(0) += 1;
            hours[i % pixels] += calendar.weight_h[i / pixels];
        }
        let map = |f: &dyn Fn(&BTreeMap<u32, i32>) -> i32| {
            Some(Grid::from_vec(columns, rows, per_day.iter().map(f).collect()))
        };
        days = map(&|counts| counts.len() as i32);
        longest_day = map(&|counts| counts.values().copied().max().unwrap_or(0));
        let hours = hours.iter().map(|h| *h as f32).collect();
        cumulative_h = Some(Grid::from_vec(columns, rows, hours));
    }
    let [cumulative, sustained, longest_run] = maps.map(|m| Grid::from_vec(columns, rows, m));
    let nonfinite = volume.data.iter().filter(|v| !v.is_finite()).count() as u64;
    let analysis = Found {
        cumulative,
        sustained,
        longest_run,
        days,
        longest_day,
        cumulative_h,
        events,
        nonfinite,
    };
    (analysis, filtered)
}

/// Every output voxel from all its inputs, looked up one by one in a mirrored line.
fn smooth(part: &mut [f32], shape: [usize; 3], axis: usize, sigma: f64, truncate: f64) {
    if sigma == 0.0 {
        return;
    }
    let radius = (truncate * sigma + 0.5) as i64;
    let raw: Vec<f64> =
        (-radius..=radius).map(|x| libm::exp(-0.5 / (sigma * sigma) * (x * x) as f64)).collect();
    let sum = numpy_sum(&raw);
    let stride: usize = shape[axis + 1..].iter().product();
    let length = shape[axis] as i64;
    let mirrored = |i: i64| {
        let mut i = i;
        while i < 0 || i >= length {
            i = if i < 0 { -1 - i } else { 2 * length - 1 - i };
        }
        i as usize
    };
    for first in (0..part.len()).filter(|i| (i / stride).is_multiple_of(shape[axis])) {
        let line: Vec<f64> =
            (0..shape[axis]).map(|i| f64::from(part[first + i * stride])).collect();
        for i in 0..length {
            let weight = |j: i64| raw[(radius - j) as usize] / sum;
            let mut sum = line[i as usize] * weight(0);
            for j in (1..=radius).rev() {
                sum += (line[mirrored(i - j)] + line[mirrored(i + j)]) * weight(j);
            }
            part[first + i as usize * stride] = sum as f32;
        }
    }
}

fn numpy_sum(raw: &[f64]) -> f64 {
    if raw.len() < 8 {
        return raw.iter().sum();
    }
    assert!(raw.len() <= 128, "the twin knows short kernels only");
    let mut sums: Vec<f64> = raw[..8].to_vec();
    let whole = raw.len() / 8 * 8;
    (8..whole).for_each(|i| sums[i % 8] += raw[i]);
    let pairs: Vec<f64> = sums.chunks(2).map(|p| p[0] + p[1]).collect();
    let start = (pairs[0] + pairs[1]) + (pairs[2] + pairs[3]);
    raw[whole..].iter().fold(start, |s, v| s + v)
}

fn count(mask: &[bool], pixels: usize, maps: &mut [Vec<i32>; 3]) {
    let [cumulative, _, longest_run] = maps;
    for (pixel, (cumulative, longest)) in cumulative.iter_mut().zip(longest_run).enumerate() {
        let mut run = 0;
        for on in mask.iter().skip(pixel).step_by(pixels) {
            run = if *on { run + 1 } else { 0 };
            *cumulative += i32::from(*on);
            *longest = run.max(*longest);
        }
    }
}

fn flood(
    mask: &[bool],
    seen: &mut [bool],
    start: usize,
    shape: [usize; 3],
    connectivity: Connectivity,
) -> Vec<usize> {
    let [depth, rows, columns] = shape.map(|n| n as i64);
    let most = match connectivity {
        Connectivity::Faces => 1,
        Connectivity::Edges => 2,
        Connectivity::Corners => 3,
    };
    seen[start] = true;
    let mut found = vec![start];
    let mut next = 0;
    while next < found.len() {
        let at = found[next] as i64;
        next += 1;
        let (t, y, x) = (at / (rows * columns), at / columns % rows, at % columns);
        for move_ in 0..27_i64 {
            let (dt, dy, dx) = (move_ / 9 - 1, move_ / 3 % 3 - 1, move_ % 3 - 1);
            let (t, y, x) = (t + dt, y + dy, x + dx);
            let inside =
                (0..depth).contains(&t) && (0..rows).contains(&y) && (0..columns).contains(&x);
            if dt.abs() + dy.abs() + dx.abs() > most || !inside {
                continue;
            }
            let to = ((t * rows + y) * columns + x) as usize;
            if mask[to] && !seen[to] {
                seen[to] = true;
                found.push(to);
            }
        }
    }
    found.sort_unstable();
    found
}

fn event(
    voxels: &[usize],
    part: &[f32],
    start: usize,
    shape: [usize; 3],
    sustained: &mut [i32],
) -> Event {
    let [_, rows, columns] = shape;
    let pixels = rows * columns;
    let mut per_pixel = BTreeMap::new();
    for voxel in voxels {
        *per_pixel.entry(voxel % pixels).or_insert(0) += 1;
    }
    for (pixel, count) in &per_pixel {
        sustained[*pixel] = sustained[*pixel].max(*count);
    }
    let peak =
        voxels.iter().fold(voxels[0], |best, &v| if part[v] > part[best] { v } else { best });
    let mean = |f: &dyn Fn(usize) -> usize| {
        voxels.iter().map(|v| f(*v)).sum::<usize>() as f64 / voxels.len() as f64
    };
    Event {
        first: (start + voxels[0] / pixels) as u32,
        last: (start + voxels[voxels.len() - 1] / pixels) as u32,
        voxels: voxels.len() as u64,
        pixels: per_pixel.len() as u64,
        peak_w_m2: part[peak],
        peak_timestep: (start + peak / pixels) as u32,
        peak_row: (peak / columns % rows) as u32,
        peak_column: (peak % columns) as u32,
        centroid_row: mean(&|v| v / columns % rows),
        centroid_column: mean(&|v| v % columns),
        smallest_voxel: (start * pixels + voxels[0]) as u64,
    }
}

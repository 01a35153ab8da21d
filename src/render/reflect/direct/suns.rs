use std::ops::Range;

use glam::DVec3;

use crate::base::{Frame, Timeline};
use crate::render::reflect::facet::Facet;
use crate::sky::date_of_day;

/// The suns in front of a facet, in its frame and in the order of time, one array for each number.
#[derive(Clone, Debug, Default)]
pub(super) struct Suns {
    /// Index into the timeline.
    pub step: Vec<u32>,
    /// Month from 0: the first of those in which crowns let as much through.
    pub month: Vec<u8>,
    pub direction: Vec<DVec3>,
    pub x: Vec<f32>,
    pub y: Vec<f32>,
    pub z: Vec<f32>,
    /// `1 / (x^2 + y^2)`.
    pub steep: Vec<f32>,
    /// Axes across the direction, to the side and up: three numbers each.
    pub across: Vec<[f32; 6]>,
    /// Direct normal irradiance, W/m2.
    pub strength: Vec<f32>,
}

impl Suns {
    pub(super) fn of(facet: &Facet, timeline: &Timeline, alike: &[usize; 12]) -> Self {
        let mut out = Self::default();
        for (i, step) in timeline.steps.iter().enumerate() {
            let sun = facet.frame.local_from_world(step.sun);
            if sun.z <= 0.0 || step.irradiance_w_m2 <= 0.0 {
                continue;
            }
            out.step.push(i as u32);
            let month = date_of_day(timeline.year, step.day).0.clamp(1, 12) as usize - 1;
            out.month.push(alike[month] as u8);
            out.direction.push(sun);
            out.x.push(sun.x as f32);
            out.y.push(sun.y as f32);
            out.z.push(sun.z as f32);
            out.steep.push((1.0 / (sun.x * sun.x + sun.y * sun.y).max(1e-9)) as f32);
            let axes = Frame::around(sun);
            out.across.push(
                [axes.x.x, axes.x.y, axes.x.z, axes.y.x, axes.y.y, axes.y.z].map(|v| v as f32),
            );
            out.strength.push(step.irradiance_w_m2 as f32);
        }
        out
    }

    pub(super) fn len(&self) -> usize {
        self.step.len()
    }

    /// The suns of some timesteps.
    pub(super) fn within(&self, timesteps: &Range<u32>) -> Range<usize> {
        let at = |step: u32| self.step.partition_point(|s| *s < step);
        at(timesteps.start)..at(timesteps.end)
    }

    /// The i-th sun with its frame in the world's axes.
    pub(super) fn in_world(&self, facet: &Facet, i: usize) -> Frame {
        Frame::around(facet.frame.world_from_local(self.direction[i]))
    }
}

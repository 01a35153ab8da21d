//! What is asked of the store, and what it answers.

use std::ops::Range;

use glam::Vec3;

/// What to look for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Query {
    /// Where, metres.
    pub point: Vec3,
    /// Unit normal of the surface there: only photons whose normal is within 60 degrees of it
    /// count. Zero: any photon counts.
    pub normal: Vec3,
    /// How many photons at most.
    pub count: usize,
    /// How far they may lie at most, metres.
    pub max_radius_m: f32,
}

/// All timesteps.
pub const ALWAYS: Range<u32> = 0..u32::MAX;
/// Cosine of the largest angle between the normals of query and photon.
pub(super) const SAME_SIDE: f32 = 0.5;

/// A photon that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour {
    /// Its index in the store.
    pub index: u64,
    /// Square of its distance, m2.
    pub distance2_m2: f32,
    /// Flux, W.
    pub flux_w: f32,
    /// Cosine of incidence: its normal times its direction.
    pub cos: f32,
    /// Index of its timestep.
    pub timestep: u32,
    /// The PV surface that sent it.
    pub surface: u16,
}

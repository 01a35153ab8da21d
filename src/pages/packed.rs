//! A photon on its way to its page.

use std::cmp::Ordering;

use glam::Vec3;

use super::quantise::octahedral;
use crate::base::{Photon, Record};

/// Bytes of a record in a spill: all fields in their order, little endian.
pub(super) const RECORD_BYTES: usize = 30;

/// A photon as it waits for its page: its unit vectors are rounded already, as the page rounds them
/// whatever it is; all else is as it came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Packed {
    /// Metres.
    pub position: Vec3,
    /// See [`octahedral`].
    pub normal: [i16; 2],
    /// See [`octahedral`].
    pub direction: [i16; 2],
    /// Watts.
    pub flux_w: f32,
    /// Its index.
    pub timestep: u32,
    /// Its index.
    pub surface: u16,
}

impl Packed {
    pub fn of(photon: &Photon) -> Self {
        Self {
            position: photon.position,
            normal: octahedral(photon.normal),
            direction: octahedral(photon.direction),
            flux_w: photon.flux_w,
            timestep: photon.timestep,
            surface: photon.surface,
        }
    }

    pub fn read(record: &[u8; RECORD_BYTES]) -> Self {
        let word = |at: usize| [record[at], record[at + 1], record[at + 2], record[at + 3]];
        let half = |at: usize| [record[at], record[at + 1]];
        let float = |at| f32::from_le_bytes(word(at));
        let codes = |at| [i16::from_le_bytes(half(at)), i16::from_le_bytes(half(at + 2))];
        Self {
            position: Vec3::new(float(0), float(4), float(8)),
            normal: codes(12),
            direction: codes(16),
            flux_w: float(20),
            timestep: u32::from_le_bytes(word(24)),
            surface: u16::from_le_bytes(half(28)),
        }
    }
}

impl Record for Packed {
    const BYTES: usize = RECORD_BYTES;

    fn put(&self, out: &mut Vec<u8>) {
        for component in self.position.to_array() {
            out.extend_from_slice(&component.to_le_bytes());
        }
        for code in [self.normal, self.direction].as_flattened() {
            out.extend_from_slice(&code.to_le_bytes());
        }
        out.extend_from_slice(&self.flux_w.to_le_bytes());
        out.extend_from_slice(&self.timestep.to_le_bytes());
        out.extend_from_slice(&self.surface.to_le_bytes());
    }

    fn get(bytes: &[u8]) -> Self {
        let mut record = [0; RECORD_BYTES];
        record.copy_from_slice(bytes);
        Self::read(&record)
    }

    /// The order of photons in one cell. Position first: where millions lie in a cell that can't be
    /// cut further, their pages are slabs that a search can tell apart.
    fn order(&self, other: &Self) -> Ordering {
        let (at, there) = (self.position.to_array(), other.position.to_array());
        let axes = at.iter().zip(&there).map(|(a, b)| a.total_cmp(b));
        axes.fold(Ordering::Equal, Ordering::then)
            .then_with(|| self.timestep.cmp(&other.timestep))
            .then_with(|| self.surface.cmp(&other.surface))
            .then_with(|| self.flux_w.total_cmp(&other.flux_w))
            .then_with(|| (self.normal, self.direction).cmp(&(other.normal, other.direction)))
    }
}

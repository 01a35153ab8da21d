//! STUB of the room `pages` with the signatures that render needs, so that this branch compiles
//! alone. The room's own branch replaces this file whole.

use std::path::Path;

use glam::Vec3;

use crate::base::FaultKind;

/// Stub.
#[derive(Debug, thiserror::Error)]
#[error("pages stub")]
pub struct Error;

impl Error {
    /// Stub.
    pub fn kind(&self) -> FaultKind {
        FaultKind::Failed
    }
}

/// Stub.
pub struct StoreInfo {
    /// Stub.
    pub timesteps: u32,
    /// Stub.
    pub photons: u64,
}

/// Stub.
pub struct Store {
    info: StoreInfo,
}

/// Stub.
pub struct OpenOptions;

/// Stub.
pub struct Query {
    /// Stub.
    pub point: Vec3,
    /// Stub.
    pub normal: Vec3,
    /// Stub.
    pub count: usize,
    /// Stub.
    pub max_radius_m: f32,
}

/// Stub.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour {
    /// Stub.
    pub index: u64,
    /// Stub.
    pub distance2_m2: f32,
    /// Stub.
    pub flux_w: f32,
    /// Stub.
    pub cos: f32,
    /// Stub.
    pub timestep: u32,
    /// Stub.
    pub surface: u16,
}

/// Stub.
#[derive(Default)]
pub struct Neighbours {
    items: Vec<Neighbour>,
}

impl Neighbours {
    /// Stub.
    pub fn new() -> Self {
        Self::default()
    }
    /// Stub.
    pub fn items(&self) -> &[Neighbour] {
        &self.items
    }
    /// Stub.
    pub fn farthest(&self) -> Option<usize> {
        None
    }
    /// Stub.
    pub fn full(&self) -> bool {
        false
    }
}

impl Store {
    /// Stub.
    pub fn open(_path: &Path, _options: &OpenOptions) -> Result<Self, Error> {
        Err(Error)
    }
    /// Stub.
    pub fn info(&self) -> &StoreInfo {
        &self.info
    }
    /// Stub.
    pub fn max_radius_m(&self, _bandwidth: usize) -> f32 {
        1.0
    }
    /// Stub.
    pub fn nearest(&self, _query: &Query, found: &mut Neighbours) -> Result<(), Error> {
        found.items.clear();
        Ok(())
    }
}

//! The photons that the pixels of a group share.

use glam::Vec3;

use crate::base::Aabb;

/// Photons that have a box together.
const BLOCK: usize = 64;

/// What a sum needs to know about a photon.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::render) struct Light {
    /// What it gives the surface, and what a plane that faces it: see [`super::flux`].
    pub surface: i64,
    pub facing: i64,
    /// Its index in the store.
    pub index: u64,
    pub timestep: u32,
}

/// Photons in store order, with boxes around those that follow each other (and lie close together,
/// because the store is in Morton order).
#[derive(Debug, Default)]
pub(in crate::render) struct PhotonSet {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    normal: Vec<Vec3>,
    light: Vec<Light>,
    boxes: Vec<Aabb>,
}

impl PhotonSet {
    pub fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
        self.normal.clear();
        self.light.clear();
        self.boxes.clear();
    }

    pub fn len(&self) -> usize {
        self.light.len()
    }

    /// Adds a photon; its index is above that of all before.
    pub fn push(&mut self, position: Vec3, normal: Vec3, light: Light) {
        if self.len().is_multiple_of(BLOCK) {
            self.boxes.push(Aabb::EMPTY);
        }
        if let Some(bounds) = self.boxes.last_mut() {
            *bounds = Aabb { min: bounds.min.min(position), max: bounds.max.max(position) };
        }
        self.x.push(position.x);
        self.y.push(position.y);
        self.z.push(position.z);
        self.normal.push(normal);
        self.light.push(light);
    }

    /// Becomes those of `from` that `accept` lets through.
    pub fn take(&mut self, from: &Self, accept: impl Fn(Vec3, Vec3) -> bool) {
        self.clear();
        for (i, (&normal, &light)) in from.normal.iter().zip(&from.light).enumerate() {
            let position = from.position(i);
            if accept(position, normal) {
                self.push(position, normal, light);
            }
        }
    }

    /// Becomes those of `from` in a box (borders included) that `accept` lets through.
    pub fn take_in(&mut self, from: &Self, region: Aabb, accept: impl Fn(Vec3, Vec3) -> bool) {
        self.clear();
        for (block, bounds) in from.boxes.iter().enumerate() {
            if bounds.min.cmpgt(region.max).any() || bounds.max.cmplt(region.min).any() {
                continue;
            }
            for i in block * BLOCK..from.len().min((block + 1) * BLOCK) {
                let (position, normal) = (from.position(i), from.normal[i]);
                if region.contains(position) && accept(position, normal) {
                    self.push(position, normal, from.light[i]);
                }
            }
        }
    }

    pub fn normals(&self) -> &[Vec3] {
        &self.normal
    }

    pub fn position(&self, i: usize) -> Vec3 {
        Vec3::new(self.x[i], self.y[i], self.z[i])
    }

    pub fn light(&self, i: u32) -> &Light {
        &self.light[i as usize]
    }

    /// Lists the photons within a distance of a point that `accept` lets through by place and
    /// normal, in their order.
    pub fn within(
        &self,
        point: Vec3,
        distance2_m2: f32,
        accept: Option<&impl Fn(Vec3, Vec3) -> bool>,
        out: &mut Vec<u32>,
    ) {
        out.clear();
        let mut used = 0;
        for (block, bounds) in self.boxes.iter().enumerate() {
            if bounds.distance_squared(point) > distance2_m2 {
                continue;
            }
            if out.len() < used + BLOCK {
                out.resize(2 * (used + BLOCK), 0);
            }
            let from = block * BLOCK;
            let to = self.len().min(from + BLOCK);
            let (x, y, z) = (&self.x[from..to], &self.y[from..to], &self.z[from..to]);
            let mut near = [f32::NAN; BLOCK];
            for (near, ((x, y), z)) in near.iter_mut().zip(x.iter().zip(y).zip(z)) {
                let (dx, dy, dz) = (x - point.x, y - point.y, z - point.z);
                *near = dx * dx + dy * dy + dz * dz;
            }
            // Without a branch that depends on the photon.
            let room = &mut out[used..used + BLOCK];
            let mut kept = 0;
            for (i, &near) in near.iter().enumerate() {
                room[kept % BLOCK] = (from + i) as u32;
                kept += usize::from(near <= distance2_m2);
            }
            if let Some(accept) = accept {
                let listed = kept;
                kept = 0;
                for i in 0..listed {
                    let photon = room[i];
                    room[kept] = photon;
                    let photon = photon as usize;
                    kept += usize::from(accept(self.position(photon), self.normal[photon]));
                }
            }
            used += kept;
        }
        out.truncate(used);
    }
}

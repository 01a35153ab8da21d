use glam::Vec3;

use super::hits::HitMap;
use crate::base::morton::{LEVELS, interleave};
use crate::base::{Aabb, TileRect, limits, tiles};

/// A pixel of a tile as a point that asks what arrives there.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct QueryPoint {
    /// Which pixel of the tile.
    pub pixel: u16,
    pub position: Vec3,
    /// Unit normal of the side that is asked about.
    pub normal: Vec3,
}

/// The tiles of a view and the order in which they are rendered: by the Morton codes of what they
/// show, so that tiles rendered one after the other ask for the same pages of the photon store.
pub(in crate::render) struct Order<'a> {
    hits: &'a HitMap,
    bounds: Aabb,
}

impl<'a> Order<'a> {
    pub(in crate::render) fn of(hits: &'a HitMap) -> Self {
        let places = hits.hits.iter().filter(|h| h.kind.receives()).map(|h| h.position);
        Self { hits, bounds: Aabb::around(places) }
    }

    /// All tiles; those without any receiving surface come last, in their own order.
    pub(in crate::render) fn tiles(&self) -> Vec<TileRect> {
        let mut keyed: Vec<(u64, TileRect)> =
            tiles(self.hits.columns, self.hits.rows, limits::TILE_EDGE)
                .into_iter()
                .map(|tile| {
                    let (mut sum, mut count) = (glam::DVec3::ZERO, 0.0);
                    for pixel in self.receiving(tile) {
                        sum += self.position(tile, pixel).as_dvec3();
                        count += 1.0;
                    }
                    let key =
                        if count == 0.0 { u64::MAX } else { self.code((sum / count).as_vec3()) };
                    (key, tile)
                })
                .collect();
        keyed.sort_by_key(|&(key, _)| key);
        keyed.into_iter().map(|(_, tile)| tile).collect()
    }

    /// The pixels of a tile where photons may lie, by the Morton codes of their hits.
    pub(in crate::render) fn pixels(&self, tile: TileRect) -> Vec<u16> {
        let mut keyed: Vec<(u64, u16)> = self
            .receiving(tile)
            .map(|pixel| (self.code(self.position(tile, pixel)), pixel))
            .collect();
        keyed.sort_unstable();
        keyed.into_iter().map(|(_, pixel)| pixel).collect()
    }

    /// The same with what they show.
    pub(in crate::render) fn query_points(&self, tile: TileRect) -> Vec<QueryPoint> {
        let query_point = |pixel| {
            let hit = &self.hits.hits[self.index(tile, pixel)];
            QueryPoint { pixel, position: hit.position, normal: hit.normal }
        };
        self.pixels(tile).into_iter().map(query_point).collect()
    }

    /// Index of a tile's pixel in the view.
    pub(in crate::render) fn index(&self, tile: TileRect, pixel: u16) -> usize {
        let (row, column) = (usize::from(pixel) / tile.columns, usize::from(pixel) % tile.columns);
        (tile.row + row) * self.hits.columns + tile.column + column
    }

    fn receiving(&self, tile: TileRect) -> impl Iterator<Item = u16> + '_ {
        (0..tile.pixels() as u32)
            .map(|pixel| pixel as u16)
            .filter(move |&pixel| self.hits.hits[self.index(tile, pixel)].kind.receives())
    }

    fn position(&self, tile: TileRect, pixel: u16) -> Vec3 {
        self.hits.hits[self.index(tile, pixel)].position
    }

    fn code(&self, place: Vec3) -> u64 {
        code(&self.bounds, place)
    }
}

/// Morton code of a place in a box, 21 bits an axis. One scale for all axes, so that flat scenes
/// don't spend bits on their height.
pub(in crate::render) fn code(bounds: &Aabb, place: Vec3) -> u64 {
    let size = bounds.size().max_element();
    if !size.is_finite() || size <= 0.0 {
        return 0;
    }
    let cell = (place - bounds.min) * (((1u32 << LEVELS) - 1) as f32 / size);
    interleave(cell.x as u64, cell.y as u64, cell.z as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::view::hits::{Hit, HitKind};

    #[test]
    fn every_tile_and_every_receiving_pixel_comes_once() {
        let (columns, rows) = (70, 45);
        let mut hits = vec![Hit::nothing(HitKind::Sky); columns * rows];
        for (i, hit) in hits.iter_mut().enumerate() {
            if i % 3 != 0 {
                hit.kind = HitKind::Receiver;
                hit.position = Vec3::new((i % columns) as f32, (i / columns) as f32, 0.0);
            }
        }
        let map = HitMap { columns, rows, hits };
        let order = Order::of(&map);
        let mut all = order.tiles();
        let mut met = vec![0; columns * rows];
        for &tile in &all {
            for pixel in order.pixels(tile) {
                met[order.index(tile, pixel)] += 1;
            }
        }
        assert!(met.iter().enumerate().all(|(i, &n)| n == usize::from(i % 3 != 0)));
        all.sort();
        let mut expected = tiles(columns, rows, limits::TILE_EDGE);
        expected.sort();
        assert_eq!(all, expected);
    }
}

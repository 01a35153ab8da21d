use glam::Vec3;

use super::hits::HitMap;
use crate::base::{Aabb, TileRect, limits, tiles};
use crate::render::gather::share::Spot;

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
    pub(in crate::render) fn spots(&self, tile: TileRect) -> Vec<Spot> {
        let spot = |pixel| {
            let hit = &self.hits.hits[self.index(tile, pixel)];
            Spot { pixel, position: hit.position, normal: hit.normal }
        };
        self.pixels(tile).into_iter().map(spot).collect()
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
    let cell = (place - bounds.min) * (((1u32 << 21) - 1) as f32 / size);
    spread(cell.x as u64) | spread(cell.y as u64) << 1 | spread(cell.z as u64) << 2
}

/// Puts two zeros behind each of the lower 21 bits.
fn spread(value: u64) -> u64 {
    let mut v = value & 0x1f_ffff;
    v = (v | v << 32) & 0x001f_0000_0000_ffff;
    v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::view::hits::{Hit, HitKind};

    #[test]
    fn bits_are_spread_as_one_by_one() {
        for v in [0u64, 1, 2, 0x15_5555, 0x1f_ffff, 0x12_3456] {
            let slow = (0..21).fold(0u64, |out, bit| out | (v >> bit & 1) << (3 * bit));
            assert_eq!(spread(v), slow);
        }
    }

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
